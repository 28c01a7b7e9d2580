// SPDX-License-Identifier: MIT
#include "skeletex/skeletonize/coarse_mesh.h"

#include <OpenMesh/Tools/Decimater/DecimaterT.hh>
#include <OpenMesh/Tools/Decimater/ModEdgeLengthT.hh>

#include "skeletex/geometry/half_edge.h"

namespace skeletex {

TriangleMesh make_coarse_mesh(const TriangleMesh& mesh, int vertices) {
  HalfEdgeMesh half_edges = build_half_edges(mesh);
  OpenMesh::Decimater::DecimaterT<HalfEdgeMesh> decimater(half_edges);
  // Quadric errors are 0 in the plane, where single vertices then gather hundreds of edges, and each collapse takes
  // long.
  OpenMesh::Decimater::ModEdgeLengthT<HalfEdgeMesh>::Handle length;
  decimater.add(length);
  decimater.module(length).set_binary(false);
  decimater.initialize();
  decimater.decimate_to(vertices);
  half_edges.garbage_collection();
  return triangle_mesh_of(half_edges);
}

}  // namespace skeletex
