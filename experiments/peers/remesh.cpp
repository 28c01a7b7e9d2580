// SPDX-License-Identifier: MIT
#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/Polygon_mesh_processing/remesh.h>
#include <CGAL/Surface_mesh.h>

#include <cmath>
#include <cstdlib>

#include "simplify.h"

namespace skeletex {
namespace {

using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
using SurfaceMesh = CGAL::Surface_mesh<Kernel::Point_3>;

SurfaceMesh to_cgal(const TriangleMesh& mesh) {
  SurfaceMesh surface;
  std::vector<SurfaceMesh::Vertex_index> vertices;
  for (const Vec3& p : mesh.positions) vertices.push_back(surface.add_vertex({p.x(), p.y(), p.z()}));
  for (const Triangle& t : mesh.triangles) surface.add_face(vertices[t[0]], vertices[t[1]], vertices[t[2]]);
  return surface;
}

TriangleMesh from_cgal(SurfaceMesh& surface) {
  surface.collect_garbage();
  TriangleMesh mesh;
  for (const auto vertex : surface.vertices()) {
    const auto& p = surface.point(vertex);
    mesh.positions.push_back({p.x(), p.y(), p.z()});
  }
  for (const auto face : surface.faces()) {
    Triangle triangle{};
    int corner = 0;
    for (const auto vertex : surface.vertices_around_face(surface.halfedge(face)))
      triangle[corner++] = static_cast<int>(vertex.idx());
    mesh.triangles.push_back(triangle);
  }
  return mesh;
}

}  // namespace

TriangleMesh remesh(const TriangleMesh& mesh, int vertices) {
  constexpr int kTries = 4, kIterations = 5;
  // Of equilateral triangles, two per vertex.
  double edge = std::sqrt(surface_area(mesh) * 2 / (std::sqrt(3.0) * vertices));
  SurfaceMesh surface;
  for (int i = 0; i < kTries; ++i) {
    surface = to_cgal(mesh);
    CGAL::Polygon_mesh_processing::isotropic_remeshing(surface.faces(), edge, surface,
                                                       CGAL::parameters::number_of_iterations(kIterations));
    const double ratio = static_cast<double>(surface.number_of_vertices()) / vertices;
    if (std::abs(ratio - 1) < 0.02) break;
    edge *= std::sqrt(ratio);
  }
  return from_cgal(surface);
}

}  // namespace skeletex
