// SPDX-License-Identifier: MIT
#pragma once
#include "skeletex/geometry/mesh.h"

namespace skeletex {

/// A mesh with fewer vertices by edge collapses in the order of quadric errors (OpenMesh; Garland and Heckbert 1997).
/// The genus stays. It can have more vertices than wanted where no further edge can go.
/// \pre closed, oriented and 2-manifold
TriangleMesh decimate(const TriangleMesh& mesh, int vertices);

}  // namespace skeletex
