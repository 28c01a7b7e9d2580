// SPDX-License-Identifier: MIT
#pragma once
#include <vector>

#include "skeletex/geometry/mesh.h"

namespace skeletex {

/// A closed triangle mesh that is being cut. Half-edge 3 t + c leads from corner c of triangle t to the next corner.
struct CutMesh {
  std::vector<Vec3> positions;
  std::vector<int> origins;    ///< half-edge -> vertex it starts at
  std::vector<int> opposites;  ///< half-edge -> the one of the neighbour triangle
  std::vector<int> seams;      ///< half-edge -> seam side (node and bone, numbered by the caller), -1 off the seams

  int triangle_count() const { return static_cast<int>(origins.size() / 3); }
  static int next(int h) { return h % 3 == 2 ? h - 2 : h + 1; }
  int target(int h) const { return origins[next(h)]; }
};

/// Corner c is the triangle's corner (c + 2) % 3.
/// \throw InputError when the mesh is no closed, oriented 2-manifold
CutMesh cut_mesh_of(const TriangleMesh& mesh);

/// Splits an edge at its middle; both parts keep its seam.
void split_edge(CutMesh& mesh, int half_edge);

}  // namespace skeletex
