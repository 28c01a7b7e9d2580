// SPDX-License-Identifier: MIT
#pragma once
#include <string>
#include <vector>

#include "skeletex/geometry/mesh.h"

namespace skeletex {

struct FillOptions {
  double largest = 0.1;  ///< of a hole's bounding box, diagonals of the mesh
  int most_edges = 200;  ///< around a hole
};

/// A hole of a mesh.
struct Hole {
  std::vector<int> loop;  ///< vertices, in the direction in which a triangle of the hole would run through them
  Vec3 centre = Vec3::Zero();
  double size = 0;  ///< diagonal of its bounding box, world units
  bool is_filled = false;
};

struct FillResult {
  std::vector<Hole> holes;
  std::vector<int> origins;  ///< per triangle the one that it was before; -1: it fills a hole
  std::string obstacle;      ///< why the mesh is still not closed; empty: it is closed
};

/// Closes a mesh that lacks a few small pieces: each hole gets the triangulation of its boundary with the least area
/// (Barequet and Sharir, Filling Gaps in the Boundary of a Polyhedron, 1995). Vertices stay as they are; so do
/// triangles, except that those without area and those that occur twice are left out.
FillResult fill_holes(TriangleMesh& mesh, const FillOptions& options = {});

}  // namespace skeletex
