// SPDX-License-Identifier: MIT
#pragma once
#include "skeletex/model/frame.h"
#include "skeletex/reconstruct/pose/posed_planes.h"

namespace skeletex {

/// How a row of a patch keeps distances in a pose. Bones of different length meet at a seam. Where the surface lies
/// past the end of the shorter one, their distances from it disagree, so there all bones count as long as the longest
/// (PosedPlanes::longest_at). Therefore a bone's capsule extends past its other end near a seam: at the seam by the
/// missing length, and less and less over the first quarter of the bone.
struct PosedRow {
  /// How far the capsule extends past head and tail, in the bind pose and in this one; world units.
  std::array<double, 2> bind_extensions{0, 0}, extensions{0, 0};
};
PosedRow posed_row(const SkeletexModel& model, const PosedPlanes& posed, BoneIndex bone, const Axial& at);

/// The point of a texel at (u, turn) of a bone in a pose (paper 3.4 and 3.6.1): roll and slopes interpolated along the
/// bone, direction from the posed foot, distance by the rule. In the bind pose the same as decode_texel.
Vec3 posed_point(const SkeletexModel& model, const SeparationPlanes& bind, const PosedPlanes& posed, BoneIndex bone,
                 double u, double turn, const Vec3& texel, DistanceRule rule);

/// The posed bones as the kernels see them, with the rectangles, rows and columns of the model's patches.
/// \param origin  world position that posed device coordinates are relative to
std::vector<PatchRecord> posed_patches(const SkeletexModel& model, const PosedPlanes& posed, const Vec3& origin);

/// What the kernels read for a pose, in addition to the tables of the bind pose (frame_tables): same rows, same
/// columns.
struct PoseTables {
  std::vector<PatchRecord> patches;
  std::vector<PosedRowRecord> rows;
  std::vector<PosedColumnRecord> columns;
  Vec3 origin;  ///< world position that posed device coordinates are relative to: the middle of the posed nodes
};
PoseTables pose_tables(const SkeletexModel& model, const PosedPlanes& posed);

}  // namespace skeletex
