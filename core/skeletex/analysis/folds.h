// SPDX-License-Identifier: MIT
#pragma once
#include "skeletex/geometry/mesh.h"

namespace skeletex {

/// Where a surface lies back on itself.
struct FoldReport {
  long long edges = 0;         ///< between two triangles
  long long folded_edges = 0;  ///< over which the surface turns by more than 120 degrees
};
/// Triangles without area count as flat. Cost: O(triangles).
FoldReport measure_folds(const TriangleMesh& mesh);

}  // namespace skeletex
