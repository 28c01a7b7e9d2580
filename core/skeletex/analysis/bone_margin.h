// SPDX-License-Identifier: MIT
#pragma once
#include <limits>
#include <vector>

#include "skeletex/geometry/mesh.h"
#include "skeletex/geometry/triangle_tree.h"
#include "skeletex/skeleton/skeleton.h"

namespace skeletex {

/// A bone needs this much of a margin for its separation planes to count as apart: rays are few, and seams are not
/// exactly where the first exit is.
inline constexpr double kEnoughMargin = 0.05;

/// How far the separation planes at both ends of a bone are from crossing inside the body. At the angle theta about
/// the bone they meet at the distance L / (k_H - k_T) from its axis, with the slopes k of SeparationPlanes. Rays along
/// both leave the body. A plane ends where its ray leaves the body, so the planes cross only where both rays get as
/// far: rho is the lesser of their distances from the axis.
struct BoneMargin {
  /// The least 1 - rho (k_H - k_T) / L of all angles, at most 1. Below 0 the planes cross inside the body.
  double margin = 1;
  Vec3 point = Vec3::Zero();  ///< where the ray of rho leaves the body
  BoneEnd end = BoneEnd::kHead;
  double lean = 1;  ///< mean of sqrt(1 + k^2): how much longer the planes are than planes across the bone
};

/// \param at_nodes    of the skeleton (bones_at_nodes)
/// \param angles      number of rays per end, evenly around the bone
/// \param stop_below  further angles are left out once the margin is below
/// \pre the bone has a length and lies inside the body; directions at its nodes differ
BoneMargin margin_of_bone(const TriangleMesh& mesh, const TriangleTree& tree, const Skeleton& skeleton,
                          const std::vector<std::vector<BoneAtNode>>& at_nodes, BoneIndex bone, int angles = 24,
                          double stop_below = -std::numeric_limits<double>::infinity());

/// Of all bones, on all processors.
std::vector<BoneMargin> bone_margins(const TriangleMesh& mesh, const TriangleTree& tree, const Skeleton& skeleton,
                                     int angles = 24);

}  // namespace skeletex
