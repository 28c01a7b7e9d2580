// SPDX-License-Identifier: MIT
#pragma once
#include <vector>

#include "skeletex/analysis/manifold.h"
#include "skeletex/geometry/mesh.h"

namespace skeletex {

/// How the triangles of a mesh come to agree on what is outside.
struct TriangleTurns {
  std::vector<bool> is_turned;  ///< per triangle, whether it is to be turned; the smaller part of each component
  long count = 0;               ///< of triangles to turn
  bool is_orientable = true;    ///< false: the surface has one side only, and no turns make all agree
};

/// \param report  of that mesh; its degenerate triangles are left out
TriangleTurns triangles_to_turn(const TriangleMesh& mesh, const ManifoldReport& report);

}  // namespace skeletex
