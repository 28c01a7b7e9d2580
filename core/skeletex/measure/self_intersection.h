// SPDX-License-Identifier: MIT
#pragma once
#include <array>
#include <span>
#include <vector>

#include "skeletex/measure/triangle_tree.h"
#include "skeletex/model/mesh.h"

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
/// The same with the mesh's tree at hand.
/// \param is_asked  when not empty, per triangle: only pairs with one that is asked for
std::vector<std::array<int, 2>> find_self_intersections(const TriangleMesh& mesh, const TriangleTree& tree, std::span<const char> is_asked = {});
/// How many there are.
long count_self_intersections(const TriangleMesh& mesh);

}  // namespace skeletex
