// SPDX-License-Identifier: MIT
#pragma once
#include <vector>

#include "skeletex/skeletonize/body/voxel_body.h"

namespace skeletex {

/// Thins a body to curves of the same topology: voxels go in the order of their distance from the surface as long as
/// they are simple (26-connected object, 6-connected outside); the anchors stay. The ends of the curves are anchors,
/// and the curves have the cycles of the body.
/// \return per voxel whether it stays
std::vector<char> thin_body(const VoxelBody& body, const std::vector<int>& anchors);

}  // namespace skeletex
