// SPDX-License-Identifier: MIT
#include "skeletex/edit/transfer/mirror.h"

#include <algorithm>
#include <cmath>

namespace skeletex {
namespace {

double mirrored_turn(double turn) { return turn > 0 ? 1 - turn : 0; }

void mirror_x(Vec3& v) { v.x() = -v.x(); }

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
  mirror_x(result.skeleton.frame.offset);
  // b = o x s comes out opposite to its mirror image: angles run the other way, and so does `around`.
  for (const Patch& patch : model.patches) {
    const auto [x, y, width, height] = patch.rectangle;
    for (int row = y; row < y + height; ++row)
      for (int j = 0; j < width; ++j) {
        const std::size_t line = static_cast<std::size_t>(row) * model.texture.width + x;
        const std::size_t to = line + j, from = line + (width - j) % width;
        result.texture.along[to] = model.texture.along[from];
        result.texture.around[to] = -model.texture.around[from];
        result.texture.out[to] = model.texture.out[from];
      }
  }
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
