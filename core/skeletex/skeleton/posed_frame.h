// SPDX-License-Identifier: MIT
#pragma once
#include "skeletex/skeleton/frame.h"
#include "skeletex/skeleton/posed_planes.h"

namespace skeletex {

/// How a row of a patch keeps distances in a pose. Bones of different length meet at a seam, and where the surface lies
/// past the end of the shorter one their distances disagree: there all take the longest one's length
/// (PosedWalls::reach). So near a seam a bone's capsule is drawn out past its other end, at the seam by what is
/// missing, less and less over the first quarter of the bone.
struct PosedRow {
  std::array<double, 2> bind_reaches{0, 0},
      reaches{0, 0};  ///< past head and tail, in the bind pose and in this one; world units
};
PosedRow posed_row(const SkeletexModel& model, const PosedPlanes& posed, int bone, const Axial& at);

/// The point of a texel at (u, turn) of a bone in a pose (paper 3.4 and 3.6.1): roll and slopes interpolated along the
/// bone, direction from the posed foot, distance by the rule. In the bind pose the same as decode_texel.
Vec3 posed_point(const SkeletexModel& model, const SeparationPlanes& bind, const PosedPlanes& posed, int bone, double u,
                 double turn, const Vec3& texel, DistanceRule rule);

/// The posed bones as the kernels see them, with the rectangles, rows and columns of the model's patches.
/// \param origin  world position that posed device coordinates are relative to
std::vector<PatchRecord> posed_patches(const SkeletexModel& model, const PosedPlanes& posed, const Vec3& origin);

/// What the kernels read for a pose, beside the tables of the bind pose (frame_tables): same rows, same columns.
struct PoseTables {
  std::vector<PatchRecord> patches;
  std::vector<PosedRowRecord> rows;
  std::vector<PosedColumnRecord> columns;
  Vec3 origin;  ///< world position that posed device coordinates are relative to: the middle of the posed nodes
};
PoseTables pose_tables(const SkeletexModel& model, const PosedPlanes& posed);

}  // namespace skeletex
