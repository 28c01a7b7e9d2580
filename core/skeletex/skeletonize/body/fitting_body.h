// SPDX-License-Identifier: MIT
#pragma once
#include "skeletex/skeletonize/body/voxel_body.h"

namespace skeletex {

/// Handles of a closed mesh, by Euler's formula.
/// \pre closed and in one piece
int genus_of(const TriangleMesh& mesh);

/// The coarsest body that hangs together and has the handles of the mesh, else the one that comes nearest; empty when
/// no voxel is inside. 60,000 voxels, up to 1,500,000.
VoxelBody make_fitting_body(const Surface& surface, int genus);

}  // namespace skeletex
