// SPDX-License-Identifier: MIT
#include "skeletex/model/texture.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "skeletex/model/error.h"

namespace skeletex {

const char* to_string(SegmentTopology topology) {
  switch (topology) {
    case SegmentTopology::kAnnulus: return "annulus";
    case SegmentTopology::kDisk: return "disk";
    case SegmentTopology::kSphere: return "sphere";
  }
  return "";
}

SkeletexModel in_frame(SkeletexModel model, const UnitFrame& frame) {
  const UnitFrame& own = model.skeleton.frame;
  if (frame == own) return model;
  const double ratio = own.scale / frame.scale;
  if (!(ratio * model.diagonal >= kSmallestDiagonal && ratio * model.diagonal <= kLargestDiagonal))
    throw InputError(fmt::format(
        "one model is {:.3g} times as large as the other; scale the mesh and the skeleton of one and encode "
        "them again",
        std::max(ratio, 1 / ratio)));
  model.origin = frame.from_user(own.to_user(model.origin));
  model.diagonal *= ratio;
  for (std::vector<float>* plane : {&model.texture.along, &model.texture.around, &model.texture.out})
    for (float& x : *plane) x = static_cast<float>(ratio * x);
  for (SeamArc& arc : model.arcs)
    for (SeamSample& sample : arc.samples) sample.distance *= ratio;
  for (SeamCorner& corner : model.corners) corner.sample.distance *= ratio;
  model.skeleton = in_frame(std::move(model.skeleton), frame);
  return model;
}

}  // namespace skeletex
