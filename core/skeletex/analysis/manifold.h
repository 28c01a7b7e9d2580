// SPDX-License-Identifier: MIT
#pragma once
#include <array>
#include <vector>

#include "skeletex/geometry/mesh.h"

namespace skeletex {

/// What a mesh is, topologically. Each list holds what breaks the rule, for messages; all lists are sorted.
/// Degenerate triangles are counted and otherwise left out.
struct ManifoldReport {
  int vertices = 0, edges = 0, triangles = 0;
  int components = 0;                                  ///< of triangles that share vertices
  std::vector<std::array<int, 2>> boundary_edges;      ///< one triangle only; from, to as that triangle runs
  std::vector<std::array<int, 2>> non_manifold_edges;  ///< more than two triangles
  std::vector<std::array<int, 2>> misoriented_edges;   ///< two triangles that run through it in the same direction
  std::vector<int> non_manifold_vertices;              ///< more than one fan of triangles
  std::vector<int> unreferenced_vertices;
  std::vector<int> non_finite_vertices;
  std::vector<int> degenerate_triangles;  ///< a vertex twice, or an index out of range
  int genus = 0;                          ///< of all components together; meaningful when is_closed_manifold()
  bool is_closed_manifold() const {
    return triangles > 0 && boundary_edges.empty() && non_manifold_edges.empty() && misoriented_edges.empty() &&
           non_manifold_vertices.empty() && degenerate_triangles.empty();
  }
};
/// Cost: O(triangles), a second or less for two million.
ManifoldReport measure_manifold(const TriangleMesh& mesh);

}  // namespace skeletex
