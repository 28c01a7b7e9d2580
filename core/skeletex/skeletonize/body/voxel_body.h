// SPDX-License-Identifier: MIT
#pragma once
#include <array>
#include <vector>

#include "skeletex/skeletonize/body/surface.h"

namespace skeletex {

/// The inside of a closed mesh as cubes, by their centres: one 26-connected piece without cavities.
struct VoxelBody {
  double side = 0;            ///< of a voxel, world units
  std::vector<Vec3> centres;  ///< ordered by x, y, z
  std::vector<double> radii;  ///< distance of the centre from the surface, world units
  /// The voxel at each place around, -1 outside: place (dx + 1) * 9 + (dy + 1) * 3 + dz + 1, with 13 the voxel itself.
  std::vector<std::array<int, 27>> neighbours;
  double kept = 1;  ///< share of the inside voxels that are in this piece
  int size() const { return static_cast<int>(centres.size()); }
};

/// Places around a voxel.
inline constexpr int kVoxelPlaces = 27, kOwnPlace = 13;
/// Distance of a place from the voxel in its middle, in sides.
double place_distance(int place);

/// Voxels whose number is about `count`, whatever the shape: thin and sparse bodies get fine ones. Where parts of the
/// surface nearly touch, so that voxels of both are neighbours, voxels between them are left out.
/// \return an empty body when no voxel's centre is inside
VoxelBody make_voxel_body(const Surface& surface, int count);

}  // namespace skeletex
