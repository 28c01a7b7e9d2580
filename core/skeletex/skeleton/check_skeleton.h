// SPDX-License-Identifier: MIT
#pragma once
#include <cstddef>
#include <span>

#include "skeletex/geometry/cut_mesh.h"
#include "skeletex/skeleton/skeleton.h"

namespace skeletex {

/// More bones than any body has; what is quadratic in their number still takes less than a second.
inline constexpr std::size_t kMostBones = 2000;
/// That a skeleton is not too large for the program, to be asked before anything else is done with it.
/// \throw InputError
void check_size(std::size_t nodes, std::size_t bones);

/// That the skeleton is in one piece and lies inside the closed mesh.
/// \throw TopologyError naming node or bone, the point, and what to move
void check_skeleton_inside(const CutMesh& mesh, const Skeleton& skeleton);

/// How often a closed mesh winds around a point off its surface: 1 inside, 0 outside, -1 inside a mesh that is inside
/// out.
/// \param corners  three vertices per triangle
int winding_number(std::span<const Vec3> positions, std::span<const int> corners, const Vec3& point);

}  // namespace skeletex
