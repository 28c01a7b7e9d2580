// SPDX-License-Identifier: MIT
#include <OpenMesh/Tools/Decimater/DecimaterT.hh>
#include <OpenMesh/Tools/Decimater/ModQuadricT.hh>

#include "simplify.h"
#include "skeletex/geometry/half_edge.h"

namespace skeletex {

TriangleMesh decimate(const TriangleMesh& mesh, int vertices) {
  HalfEdgeMesh half_edges = build_half_edges(mesh);
  OpenMesh::Decimater::DecimaterT<HalfEdgeMesh> decimater(half_edges);
  OpenMesh::Decimater::ModQuadricT<HalfEdgeMesh>::Handle quadrics;
  decimater.add(quadrics);
  decimater.module(quadrics).unset_max_err();
  decimater.initialize();
  decimater.decimate_to(vertices);
  half_edges.garbage_collection();
  return triangle_mesh_of(half_edges);
}

}  // namespace skeletex
