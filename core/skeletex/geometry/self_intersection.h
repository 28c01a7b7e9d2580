// SPDX-License-Identifier: MIT
#pragma once
#include <array>
#include <span>
#include <vector>

#include "skeletex/geometry/mesh.h"
#include "skeletex/geometry/triangle_tree.h"

namespace skeletex {

/// Whether two triangles of a mesh meet anywhere but in the vertices and edges that they share by index: at a shared
/// vertex they may touch in that vertex only, at a shared edge they must not fold onto each other in one plane. Contact
/// counts, and so does a gap that double precision cannot tell from contact. Triangles without area count as segments;
/// two of them do not meet.
bool do_triangles_intersect(const TriangleMesh& mesh, int first, int second);

/// All pairs of triangles that intersect so, the smaller index first, sorted.
/// \pre indices in range, coordinates finite
/// Cost: all processors; well below a second for 70 000 triangles.
std::vector<std::array<int, 2>> find_self_intersections(const TriangleMesh& mesh);
/// \param tree  of the mesh
std::vector<std::array<int, 2>> find_self_intersections(const TriangleMesh& mesh, const TriangleTree& tree);
/// Of these, the pairs with a triangle of a query set at least; the cost grows with that set alone.
/// \param query  triangles
std::vector<std::array<int, 2>> find_self_intersections(const TriangleMesh& mesh, const TriangleTree& tree,
                                                        std::span<const int> query);
/// How many there are.
long count_self_intersections(const TriangleMesh& mesh);

}  // namespace skeletex
