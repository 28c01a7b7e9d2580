// SPDX-License-Identifier: MIT
#pragma once
#include <algorithm>
#include <vector>

#include "skeletex/geometry/loop_turns.h"
#include "skeletex/model/frame.h"
#include "skeletex/model/texture.h"
#include "skeletex/reconstruct/lattice.h"
#include "skeletex/reconstruct/reconstruct_mesh.h"
#include "skeletex/reconstruct/seam_strip.h"
#include "skeletex/skeleton/separation_planes.h"

namespace skeletex::test {

/// How far the first or last row of a patch (where it tends to at u = 0 or 1) lies from the seam beside it; diagonals.
struct SeamGap {
  int bone = 0;
  BoneEnd end = BoneEnd::kHead;
  double row_to_seam = 0;  ///< the largest distance of a row's point from the seam
  double seam_to_row = 0;  ///< and the other way round
  double at_columns = 0;   ///< of a row's point from the seam's point of the same v
};

inline double distance_to_loop(const Vec3& p, const std::vector<Vec3>& loop) {
  double best = 1e300;
  for (std::size_t i = 0; i < loop.size(); ++i) {
    const Vec3 &a = loop[i], b = loop[(i + 1) % loop.size()];
    const double t = std::clamp((p - a).dot(b - a) / std::max(1e-300, (b - a).squaredNorm()), 0.0, 1.0);
    best = std::min(best, (p - a - t * (b - a)).norm());
  }
  return best;
}

inline std::vector<SeamGap> seam_gaps(ClContext& context, const SkeletexModel& model) {
  const SeparationPlanes separation(model.skeleton);
  const Lattice lattice = number_lattice(model);
  const std::vector<Vec3> positions = lattice_positions(context, model);
  std::vector<SeamGap> gaps;
  for (int bone = 0; bone < static_cast<int>(model.patches.size()); ++bone)
    for (const BoneEnd end : {BoneEnd::kHead, BoneEnd::kTail}) {
      if (lattice.poles[bone][static_cast<int>(end)] >= 0) continue;
      const Rectangle& rectangle = model.patches[bone].rectangle;
      const Vec3 &head = end_position(model.skeleton, bone, BoneEnd::kHead),
                 &tail = end_position(model.skeleton, bone, BoneEnd::kTail);
      std::vector<Vec3> row, seam;
      const int r = end == BoneEnd::kHead ? 0 : rectangle.height - 1;
      for (int j = 0; j < rectangle.width; ++j) {
        const std::size_t at = static_cast<std::size_t>(rectangle.y + r) * model.texture.width + rectangle.x + j;
        const TangentFrame frame = tangent_frame(model.skeleton, separation, bone, end == BoneEnd::kHead ? 0 : 1,
                                                 static_cast<double>(j) / rectangle.width);
        row.push_back(decode_texel(
            frame, Vec3(model.texture.along[at], model.texture.around[at], model.texture.out[at]), head, tail));
      }
      std::vector<double> turns;
      for (const int vertex : end_loop(model, lattice, bone, end)) {
        seam.push_back(positions[vertex]);
        turns.push_back(separation.turn_of(bone, seam.back() - end_position(model.skeleton, bone, end)));
      }
      SeamGap gap{bone, end};
      for (const Vec3& p : row) gap.row_to_seam = std::max(gap.row_to_seam, distance_to_loop(p, seam) / model.diagonal);
      for (const Vec3& p : seam) gap.seam_to_row = std::max(gap.seam_to_row, distance_to_loop(p, row) / model.diagonal);
      const std::vector<Vec3> at_columns = points_at_columns(seam, seam_turns(seam, turns), rectangle.width);
      for (std::size_t j = 0; j < row.size(); ++j)
        gap.at_columns = std::max(gap.at_columns, (row[j] - at_columns[j]).norm() / model.diagonal);
      gaps.push_back(gap);
    }
  return gaps;
}

}  // namespace skeletex::test
