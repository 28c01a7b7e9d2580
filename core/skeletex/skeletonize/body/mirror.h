// SPDX-License-Identifier: MIT
#pragma once
#include <optional>

#include "skeletex/skeletonize/body/voxel_body.h"

namespace skeletex {

/// A plane that a body is its own mirror image about.
struct MirrorPlane {
  Vec3 point = Vec3::Zero(), normal = Vec3::UnitX();  ///< the normal points to +x, +y or +z, whichever is nearest
  Vec3 mirrored(const Vec3& p) const { return p - 2 * normal.dot(p - point) * normal; }
  double height(const Vec3& p) const { return normal.dot(p - point); }
};

/// The mirror plane of a body, among those through the middle of it that are across an axis of space or a main axis of
/// the body. None where the surface and its image are apart by more than 0.4 % of the diagonal in the mean.
std::optional<MirrorPlane> find_mirror_plane(const Surface& surface, const VoxelBody& body);

}  // namespace skeletex
