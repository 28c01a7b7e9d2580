// SPDX-License-Identifier: MIT
#include "skeletex/skeletonize/decimate.h"

#include <OpenMesh/Tools/Decimater/DecimaterT.hh>
#include <OpenMesh/Tools/Decimater/ModQuadricT.hh>

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

  TriangleMesh result;
  for (const auto vertex : half_edges.vertices()) {
    const OpenMesh::Vec3d& p = half_edges.point(vertex);
    result.positions.push_back({p[0], p[1], p[2]});
  }
  for (const auto face : half_edges.faces()) {
    Triangle triangle{};
    int corner = 0;
    for (const auto vertex : face.vertices()) triangle[corner++] = vertex.idx();
    result.triangles.push_back(triangle);
  }
  return result;
}

}  // namespace skeletex
