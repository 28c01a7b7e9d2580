// SPDX-License-Identifier: MIT
#include "skeletex/edit/transfer/mirror.h"

#include <algorithm>
#include <cmath>

namespace skeletex {
namespace {

double mirrored_turn(double turn) { return turn > 0 ? 1 - turn : 0; }

void mirror_x(Vec3& v) { v.x() = -v.x(); }

/// Columns the other way round, column 0 in its place.
/// \param sign  that the values take
void mirror_plane(const SkeletexModel& model, float sign, std::vector<float>& plane) {
  for (const Patch& patch : model.patches) {
    const auto [x, y, width, height] = patch.rectangle;
    for (int row = y; row < y + height; ++row) {
      float* const line = plane.data() + static_cast<std::size_t>(row) * model.texture.width + x;
      std::reverse(line + 1, line + width);
      for (int j = 0; j < width; ++j) line[j] *= sign;
    }
  }
}

}  // namespace

SkeletexModel mirrored(const SkeletexModel& model) {
  SkeletexModel result = model;
  result.bone_weights.clear();
  const std::vector<BoneBasis> bases = bone_bases(model.skeleton);
  for (std::size_t i = 0; i < bases.size(); ++i) {
    Vec3 s = bases[i].s;
    mirror_x(s);
    result.skeleton.bones[i].s = s;
  }
  for (Node& node : result.skeleton.nodes) mirror_x(node.position);
  mirror_x(result.origin);
  if (result.stance) mirror_x(result.stance->up), mirror_x(result.stance->front);
  mirror_x(result.skeleton.frame.offset);
  // b = o x s comes out opposite to its mirror image: angles run the other way, and so does `around`.
  mirror_plane(model, 1, result.texture.along);
  mirror_plane(model, -1, result.texture.around);
  mirror_plane(model, 1, result.texture.out);
  for (Layer& layer : result.layers)
    for (std::size_t k = 0; k < layer.planes.size(); ++k)
      mirror_plane(model, layer.kind == LayerKind::kNormal && k == 1 ? -1.f : 1.f, layer.planes[k]);
  for (SeamArc& arc : result.arcs) {
    std::reverse(arc.samples.begin(), arc.samples.end());
    std::swap(arc.corners[0], arc.corners[1]);
    for (SeamSample& sample : arc.samples) sample.turn = mirrored_turn(sample.turn);
  }
  for (SeamCorner& corner : result.corners) corner.sample.turn = mirrored_turn(corner.sample.turn);
  for (auto& ends : result.ends)
    for (PatchEnd& end : ends) std::reverse(end.arcs.begin(), end.arcs.end());
  return result;
}

}  // namespace skeletex
