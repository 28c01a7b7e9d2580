// SPDX-License-Identifier: MIT
#pragma once
#include "skeletex/model/texture.h"
#include "skeletex/skeleton/separation_planes.h"
#include "skeletex_structs.h"

namespace skeletex {

/// The axial parameter of map coordinate u: where the foot lies, and how far a cap has turned there (paper 3.4; caps
/// after 3.2.1). Along a bone with two neighbours it is u. A free end takes half of the rectangle for its cap, or a
/// third if both ends are free; in a cap the foot stays on the end node, and the frame turns through the hemisphere.
struct Axial {
  double axial = 0;     ///< position of the foot W between head (0) and tail (1)
  double latitude = 0;  ///< radians: 0 outside caps, up to +pi/2 at the tail's pole, down to -pi/2 at the head's
};
Axial axial_of(double u, bool is_head_free, bool is_tail_free);
/// Map coordinate u of an axial parameter, or of a latitude in a cap: the inverse of axial_of.
double u_of(const Axial& axial, bool is_head_free, bool is_tail_free);

/// The bone tangent frame at (u, turn): out = f / |f|, around = o x s', along = out x around (a left-handed triple
/// along, around, out), with f = s' + [(1 - axial parameter) k_H + axial parameter k_T] o outside caps, and
/// f = cos(latitude) (s' + k o) + sin(latitude) o in a cap, where k is that of the cap's end (0: it is free).
struct TangentFrame {
  Vec3 along, around, out;
  Vec3 foot;  ///< W, world
};
TangentFrame tangent_frame(const Skeleton& skeleton, const SeparationPlanes& separation, BoneIndex bone, double u,
                           double turn);

/// Texel of a point: direction from the foot in the frame, scaled to the point's distance from the bone segment.
Vec3 encode_texel(const TangentFrame& frame, const Vec3& point, const Vec3& head, const Vec3& tail);
/// The point of a texel: where the ray from the foot leaves the capsule of radius |texel| around [head, tail]
/// (paper 3.6.1 and appendix A). The inverse of encode_texel.
Vec3 decode_texel(const TangentFrame& frame, const Vec3& texel, const Vec3& head, const Vec3& tail);

/// The c at which the ray foot + c direction leaves a capsule around an axis from lower to upper (kernels/capsule.h).
/// The foot lies on the axis, at z, inside the capsule.
/// \param along, across  parts of the direction, not both 0
double leave_capsule(double z, double along, double across, double radius, double lower, double upper);

/// The tables that the kernels read (see skeletex_structs.h), for all patches of a model or of a layout.
struct FrameTables {
  std::vector<PatchRecord> patches;
  std::vector<RowRecord> rows;
  std::vector<ColumnRecord> columns;
};
/// \param origin  world position that device coordinates are relative to
FrameTables frame_tables(const Skeleton& skeleton, const SeparationPlanes& separation,
                         const std::vector<Patch>& patches, const Vec3& origin);
/// The axes along, around, out of a texel's frame as columns, from the tables.
Eigen::Matrix3f texel_axes(const FrameTables& tables, PatchIndex patch, int row, int column);

}  // namespace skeletex
