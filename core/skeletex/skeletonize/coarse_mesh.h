// SPDX-License-Identifier: MIT
#pragma once
#include "skeletex/geometry/mesh.h"

namespace skeletex {

/// A mesh with fewer vertices, of about the same distance everywhere, by collapses of the shortest edge (OpenMesh). The
/// genus stays. There can be more vertices than wanted where no further edge can go.
/// \pre closed, oriented and 2-manifold
TriangleMesh make_coarse_mesh(const TriangleMesh& mesh, int vertices);

}  // namespace skeletex
