// SPDX-License-Identifier: MIT
#pragma once
#include "skeletex/geometry/mesh.h"
#include "skeletex/model/mesh_attributes.h"

namespace skeletex {

/// The Loop subdivision surface of a mesh (Loop 1987), as triangles: each is divided into four `rounds` times, by
/// OpenMesh, and then all vertices move to their limit positions. Triangle t becomes 4^rounds t and those after it.
/// Colours, texture coordinates and numbers are linear over the mesh's own triangles; normals are left out, as those of
/// the mesh are not the surface's.
/// \param rounds  at least 1
/// \pre closed, oriented and 2-manifold
/// \throw InputError when there would be more than 100 million triangles
AttributedMesh loop_surface(const TriangleMesh& mesh, const MeshAttributes& attributes, int rounds);

}  // namespace skeletex
