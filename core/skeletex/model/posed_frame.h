// SPDX-License-Identifier: MIT
#pragma once
#include "skeletex/model/frame.h"
#include "skeletex/model/posed_walls.h"

namespace skeletex {

/// How a row of a patch keeps distances in a pose. Its capsule is drawn out past the bone's ends: at a seam past the
/// bone's other end without bound, since the seam knows the half-line from its node only (so the two bones that meet
/// there agree however short they are), and back to the bone itself over the first quarter of the bone's length.
struct PosedRow {
  double reach_head = 0, reach_tail = 0;    ///< world units; 0: the capsule ends at the node
  double weight_head = 0, weight_tail = 0;  ///< share of the gains of PosedSpoke; 1 at the seam, 0 past a quarter
};
PosedRow posed_row(const Station& at, double bind_length, bool is_head_free, bool is_tail_free);

/// The point of a texel at (u, turn) of a bone in a pose (paper 3.4 and 3.6.1): roll and slopes interpolated along the
/// bone, direction from the posed foot, distance by the rule. In the bind pose the same as decode_texel.
Vec3 posed_point(const SkeletexModel& model, const Walls& bind, const PosedWalls& posed, int bone, double u, double turn, const Vec3& texel,
                 DistanceRule rule);

/// What the kernels read for a pose, beside the tables of the bind pose (frame_tables): same rows, same columns.
struct PoseTables {
  std::vector<PatchRecord> patches;
  std::vector<PosedRowRecord> rows;
  std::vector<PosedColumnRecord> columns;
  Vec3 origin;  ///< world position that posed device coordinates are relative to: the middle of the posed nodes
};
PoseTables pose_tables(const SkeletexModel& model, const PosedWalls& posed);

}  // namespace skeletex
