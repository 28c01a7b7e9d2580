// SPDX-License-Identifier: MIT
#pragma once
#include <vector>

#include "skeletex/geometry/mesh.h"

namespace skeletex {

/// Triangles with an angle below 5 degrees, those without area among them.
/// \pre indices are in range
std::vector<int> thin_triangles(const TriangleMesh& mesh);

/// A mesh on some of the vertices of another one.
struct ReducedMesh {
  std::vector<int> vertices;        ///< per vertex its number in the other mesh, ascending
  std::vector<Triangle> triangles;  ///< of own vertex numbers
};

/// Takes thin triangles out of a mesh where the surface stays: edges are collapsed to one of their ends, or flipped.
/// With the mean cell h^2 = area / vertices and the diagonal d, edges that go stay within the smaller of 15 h^2 / d and
/// h / 20 of the surface. Its normals turn by no more than 20 degrees, and no other triangle gets thin. The mesh stays
/// closed, oriented, 2-manifold and of its genus.
///
/// \pre closed, oriented and 2-manifold
ReducedMesh without_thin_triangles(const TriangleMesh& mesh);

/// The vertices' values.
template <class T>
std::vector<T> values_of(const ReducedMesh& reduced, const std::vector<T>& values) {
  std::vector<T> own;
  own.reserve(reduced.vertices.size());
  for (const VertexIndex vertex : reduced.vertices) own.push_back(values[vertex]);
  return own;
}

}  // namespace skeletex
