// SPDX-License-Identifier: MIT
#include "skeletex/geometry/half_edge.h"

#include <fmt/format.h>

#include <OpenMesh/Core/System/omstream.hh>

#include "skeletex/model/error.h"

namespace skeletex {

HalfEdgeMesh build_half_edges(const TriangleMesh& mesh) {
  HalfEdgeMesh half_edges;
  half_edges.reserve(mesh.positions.size(), 3 * mesh.triangles.size() / 2, mesh.triangles.size());
  for (const Vec3& p : mesh.positions) half_edges.new_vertex(OpenMesh::Vec3d(p.x(), p.y(), p.z()));

  // OpenMesh reports a face that it cannot link on its error stream; the message below says it instead.
  struct Silence {
    bool was_enabled = ::omerr().is_enabled();
    Silence() { ::omerr().disable(); }
    ~Silence() {
      if (was_enabled) ::omerr().enable();
    }
  } silence;
  const int count = static_cast<int>(mesh.positions.size());
  for (std::size_t f = 0; f < mesh.triangles.size(); ++f) {
    const auto [a, b, c] = mesh.triangles[f];
    for (const int v : mesh.triangles[f])
      if (v < 0 || v >= count)
        throw InputError(
            fmt::format("triangle {} uses vertex {}, and there are {} vertices; repair the mesh", f, v, count));
    if (a == b || b == c || c == a)
      throw InputError(fmt::format("triangle {} uses a vertex twice ({}, {}, {}); remove it", f, a, b, c));
    const std::array<OpenMesh::VertexHandle, 3> corners{OpenMesh::VertexHandle(a), OpenMesh::VertexHandle(b),
                                                        OpenMesh::VertexHandle(c)};
    if (!half_edges.add_face(corners.data(), 3).is_valid())
      throw InputError(fmt::format(
          "triangle {} (vertices {}, {}, {}) shares an edge or a vertex with others in a way that no surface does; "
          "make the mesh 2-manifold and consistently oriented",
          f, a, b, c));
  }
  return half_edges;
}

TriangleMesh triangle_mesh_of(const HalfEdgeMesh& half_edges) {
  TriangleMesh mesh;
  for (const auto vertex : half_edges.vertices()) {
    const OpenMesh::Vec3d& p = half_edges.point(vertex);
    mesh.positions.push_back({p[0], p[1], p[2]});
  }
  for (const auto face : half_edges.faces()) {
    Triangle triangle{};
    int corner = 0;
    for (const auto vertex : face.vertices()) triangle[corner++] = vertex.idx();
    mesh.triangles.push_back(triangle);
  }
  return mesh;
}

}  // namespace skeletex
