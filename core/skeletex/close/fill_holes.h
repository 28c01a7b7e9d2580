// SPDX-License-Identifier: MIT
#pragma once
#include <string>
#include <vector>

#include "skeletex/geometry/mesh.h"

namespace skeletex {

/// A hole of a mesh.
struct Hole {
  std::vector<int> loop;  ///< vertices, in the direction in which a triangle of the hole would run through them
  Vec3 centre = Vec3::Zero();
  double size = 0;               ///< diagonal of its bounding box, world units
  std::string refusal;           ///< why it is not filled: "has more than 600 edges"; empty: it is filled
  bool is_intersecting = false;  ///< the filling intersects the mesh or another filling
};

struct FillResult {
  std::vector<Hole> holes;
  std::vector<int> origins;  ///< per triangle the one that it was before; -1: it fills a hole
  std::vector<int> copies;   ///< per vertex that was added, at the end, the one that it is a copy of
  long turned = 0;           ///< triangles that did not agree with the others on what is outside
  int removed = 0;           ///< triangles at non-manifold or misoriented edges
  std::string obstacle;      ///< why the mesh is still not one closed body; empty: it is
};

/// Holes with more edges are not filled. The time grows with their third power; for these it is some tenths of a
/// second.
inline constexpr int kMostHoleEdges = 600;

/// Fills the holes of a mesh: each gets the triangulation of its boundary with the least area (Barequet and Sharir,
/// Filling Gaps in the Boundary of a Polyhedron, 1995). A hole stays open where its part of the mesh is a sheet that
/// would enclose next to nothing. Before that, triangles without area, those that occur twice, and a few at
/// non-manifold edges are taken away, and triangles that run the other way round than most are turned; after it,
/// non-manifold vertices are split. All else stays as it is.
/// \pre indices in range, coordinates finite
FillResult fill_holes(TriangleMesh& mesh);

}  // namespace skeletex
