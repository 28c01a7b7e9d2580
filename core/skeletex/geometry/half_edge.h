// SPDX-License-Identifier: MIT
#pragma once
#include <OpenMesh/Core/Mesh/TriMesh_ArrayKernelT.hh>

#include "skeletex/geometry/mesh.h"

namespace skeletex {

struct HalfEdgeTraits : OpenMesh::DefaultTraits {
  using Point = OpenMesh::Vec3d;
};
using HalfEdgeMesh = OpenMesh::TriMesh_ArrayKernelT<HalfEdgeTraits>;

/// The half-edge mesh (OpenMesh) of an indexed one, with the same vertex and face indices (paper, Table 1: t_OM).
/// \pre oriented and 2-manifold, with or without boundary (see measure_manifold)
/// \throw InputError when OpenMesh cannot link a face
HalfEdgeMesh build_half_edges(const TriangleMesh& mesh);

/// The indexed mesh of a half-edge mesh, with the same vertex and face indices.
/// \pre nothing in it is marked as deleted
TriangleMesh triangle_mesh_of(const HalfEdgeMesh& half_edges);

}  // namespace skeletex
