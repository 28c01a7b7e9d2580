// SPDX-License-Identifier: MIT
#pragma once
#include <vector>

#include "skeletex/geometry/mesh.h"

namespace skeletex {

/// Takes the triangles at non-manifold and misoriented edges away (ManifoldReport), and what is left of dangling
/// triangles there. Does nothing where that is more than 2 % of the triangles. The holes that remain are to be filled.
/// \param origins  per triangle a number; those of triangles that stay, stay
/// \return how many triangles went
int remove_non_manifold_edges(TriangleMesh& mesh, std::vector<int>& origins);

/// Gives each sheet of surface that meets others in one vertex alone a vertex of its own, in the same place.
/// \return per new vertex, which come last, the one that it is a copy of
std::vector<int> split_non_manifold_vertices(TriangleMesh& mesh);

/// Takes the connected components with less than a share of the area away. Vertices stay.
/// \return how many components went
int remove_small_components(TriangleMesh& mesh, double share);

/// Keeps the connected component with the largest area, if it is a closed manifold. Vertices stay.
/// \param origins  as above
/// \return its share of the area; 0: it is not closed, and nothing was changed
double keep_largest_component(TriangleMesh& mesh, std::vector<int>& origins);

}  // namespace skeletex
