// SPDX-License-Identifier: MIT
#include <OpenMesh/Core/Mesh/TriMesh_ArrayKernelT.hh>
#include <OpenMesh/Tools/Decimater/DecimaterT.hh>
#include <OpenMesh/Tools/Decimater/ModQuadricT.hh>

#include "simplify.h"

namespace skeletex {
namespace {

struct DoubleTraits : OpenMesh::DefaultTraits {
  using Point = OpenMesh::Vec3d;
  using Normal = OpenMesh::Vec3d;
};
using HalfEdgeMesh = OpenMesh::TriMesh_ArrayKernelT<DoubleTraits>;

}  // namespace

TriangleMesh decimate(const TriangleMesh& mesh, int vertices) {
  HalfEdgeMesh half_edges;
  std::vector<HalfEdgeMesh::VertexHandle> handles;
  for (const Vec3& p : mesh.positions) handles.push_back(half_edges.add_vertex({p.x(), p.y(), p.z()}));
  for (const Triangle& t : mesh.triangles) half_edges.add_face(handles[t[0]], handles[t[1]], handles[t[2]]);
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
