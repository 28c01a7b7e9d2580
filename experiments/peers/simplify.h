// SPDX-License-Identifier: MIT
#pragma once
#include "skeletex/geometry/mesh.h"

/// Other ways to bring a mesh to a given number of vertices, which the experiments compare reconstructions with.
namespace skeletex {

/// OpenMesh's decimater with quadrics (Garland and Heckbert 1997): collapses the cheapest halfedges. Closed manifolds
/// stay such.
TriangleMesh decimate(const TriangleMesh& mesh, int vertices);

/// meshoptimizer's quadric simplification. It may stop earlier, and may leave edges with more than two triangles.
TriangleMesh simplify(const TriangleMesh& mesh, int vertices);

/// CGAL's isotropic remeshing (Botsch and Kobbelt 2004), its edge length sought so that the number of vertices is met
/// within 2 %; the vertices are projected onto the input. This function's library is under the GPL.
TriangleMesh remesh(const TriangleMesh& mesh, int vertices);

}  // namespace skeletex
