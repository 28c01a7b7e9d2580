// SPDX-License-Identifier: MIT
// The parts of validate_input. Each appends its findings, with place and remedy.
#pragma once
#include <cstddef>
#include <string>
#include <vector>

#include "skeletex/analysis/manifold.h"
#include "skeletex/analysis/surface_probe.h"
#include "skeletex/analysis/validate_input.h"

namespace skeletex {

/// Two points that are nearer to each other are in the same place; diagonals.
inline constexpr double kSamePlace = 1e-9;

/// "node "neck"", or "node 3" if it has no name
std::string name_of_node(const Skeleton& skeleton, NodeIndex node);
std::string name_of_bone(const Skeleton& skeleton, BoneIndex bone);
/// "0.0123 (0.8 % of the diagonal)"
std::string text_of_distance(double distance, double diagonal);

/// What is wrong with the mesh by itself.
void find_in_mesh(const TriangleMesh& mesh, const ManifoldReport& report, std::vector<Finding>& findings);

/// The mesh without the triangles that have no place (index, repeated vertex or number that is not finite), turned so
/// that neighbours agree as far as they can and the enclosed volume is positive: what "inside" is judged by.
/// Empty for a one-sided surface, which has none.
TriangleMesh usable_surface(const TriangleMesh& mesh, const ManifoldReport& report);

/// What is wrong with the skeleton by itself.
/// \param diagonal  of the mesh; 0 when there is none
/// \return whether its indices and positions can be used at all
bool find_in_skeleton(const Skeleton& skeleton, double diagonal, std::vector<Finding>& findings);

/// Nodes and bones that leave the body.
/// \param is_closed  whether the surface has an inside without doubt
void find_between(const SurfaceProbe& surface, bool is_closed, const Skeleton& skeleton,
                  std::vector<Finding>& findings);

/// Bones whose separation planes cross inside the body, the worst first.
/// \param tree  of the mesh
void find_crossing_planes(const Skeleton& skeleton, const TriangleMesh& mesh, const TriangleTree& tree,
                          std::vector<Finding>& findings);

/// Bones that can be taken away without the skeleton falling apart: its independent cycles.
int count_cycles(const Skeleton& skeleton);

}  // namespace skeletex
