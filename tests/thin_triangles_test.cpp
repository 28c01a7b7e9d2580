// SPDX-License-Identifier: MIT
#include "skeletex/reconstruct/thin_triangles.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>

#include "skeletex/analysis/manifold.h"
#include "skeletex/analysis/metro.h"
#include "skeletex/convert/encode_model.h"
#include "skeletex/geometry/half_edge.h"
#include "skeletex/reconstruct/reconstruct_mesh.h"
#include "support/load_model.h"
#include "support/mesh_topology.h"
#include "support/shapes.h"

namespace skeletex {
namespace {

ClContext& device() {
  static ClContext context;
  return context;
}

double least_angle(const TriangleMesh& mesh, const Triangle& t) {
  double least = std::numbers::pi;
  for (int k = 0; k < 3; ++k) {
    const Vec3 &p = mesh.positions[t[k]], first = mesh.positions[t[(k + 1) % 3]] - p,
               second = mesh.positions[t[(k + 2) % 3]] - p;
    least = std::min(least, std::atan2(first.cross(second).norm(), first.dot(second)));
  }
  return least * 180 / std::numbers::pi;
}

double thin_share(const TriangleMesh& mesh) {
  std::vector<int> thin;
  for (std::size_t i = 0; i < mesh.triangles.size(); ++i)
    if (least_angle(mesh, mesh.triangles[i]) < 5) thin.push_back(static_cast<int>(i));
  EXPECT_EQ(thin_triangles(mesh), thin);
  return static_cast<double>(thin.size()) / static_cast<double>(mesh.triangles.size());
}

/// How far edges may move.
double tolerance(const TriangleMesh& mesh) {
  const double cell = std::sqrt(surface_area(mesh) / static_cast<double>(mesh.positions.size()));
  return std::min(15 * cell * cell / bounding_box(mesh).diagonal(), cell / 20);
}

TriangleMesh reduced_mesh(const TriangleMesh& mesh) {
  const ReducedMesh reduced = without_thin_triangles(mesh);
  EXPECT_TRUE(std::is_sorted(reduced.vertices.begin(), reduced.vertices.end()));
  return {values_of(reduced, mesh.positions), reduced.triangles};
}

TriangleMesh box() {
  return {{{0, 0, 0}, {3, 0, 0}, {0, 2, 0}, {3, 2, 0}, {0, 0, 1}, {3, 0, 1}, {0, 2, 1}, {3, 2, 1}},
          {{0, 2, 1},
           {1, 2, 3},
           {4, 5, 6},
           {5, 7, 6},
           {0, 1, 4},
           {1, 5, 4},
           {2, 6, 3},
           {3, 6, 7},
           {0, 4, 2},
           {2, 4, 6},
           {1, 3, 5},
           {3, 7, 5}}};
}

/// The box with more vertices on its faces and edges, most of them near others.
TriangleMesh crowded_box(int count, unsigned seed) {
  HalfEdgeMesh mesh = build_half_edges(box());
  std::mt19937 generator(seed);
  std::uniform_real_distribution<double> share(0.001, 0.999);
  for (int i = 0; i < count; ++i) {
    const double s = share(generator), t = share(generator);
    if (i % 3 == 0) {
      const auto edge = mesh.edge_handle(static_cast<int>(generator() % mesh.n_edges()));
      const auto half_edge = mesh.halfedge_handle(edge, 0);
      mesh.split(edge, (1 - s) * mesh.point(mesh.from_vertex_handle(half_edge)) +
                           s * mesh.point(mesh.to_vertex_handle(half_edge)));
    } else {
      const auto face = mesh.face_handle(static_cast<int>(generator() % mesh.n_faces()));
      std::array<OpenMesh::Vec3d, 3> p;
      int corner = 0;
      for (const auto vertex : mesh.fv_range(face)) p[corner++] = mesh.point(vertex);
      mesh.split(face, (1 - s) * p[0] + s * ((1 - t) * p[1] + t * p[2]));
    }
  }
  return triangle_mesh_of(mesh);
}

TEST(ThinTriangles, LeaveAMeshWithoutThemAsItIs) {
  for (const TriangleMesh& mesh : {box(), y_shape().mesh, torus_shape().mesh}) {
    ASSERT_EQ(thin_share(mesh), 0);
    const TriangleMesh same = reduced_mesh(mesh);
    EXPECT_EQ(same.positions, mesh.positions);
    EXPECT_EQ(measure_manifold(same).edges, measure_manifold(mesh).edges);
    EXPECT_DOUBLE_EQ(signed_volume(same), signed_volume(mesh));
  }
}

TEST(ThinTriangles, GoFromABoxThatKeepsItsEdges) {
  for (unsigned seed = 0; seed < 20; ++seed) {
    const TriangleMesh mesh = crowded_box(300, seed), reduced = reduced_mesh(mesh);
    EXPECT_EQ(broken_rule(reduced, 0), "");
    EXPECT_GT(thin_share(mesh), 0.5);
    EXPECT_LT(thin_share(reduced), 0.3 * thin_share(mesh)) << seed;
    const MetroReport distance = measure_metro(device(), box(), reduced);
    EXPECT_LT(std::max(distance.forward.max, distance.backward.max) * distance.diagonal, 1.2 * tolerance(mesh)) << seed;
  }
}

TEST(ThinTriangles, AreTheSameAtEveryScale) {
  const TriangleMesh mesh = crowded_box(300, 7);
  const ReducedMesh reduced = without_thin_triangles(mesh);
  for (const double scale : {0x1p-190, 0x1p190}) {
    TriangleMesh scaled = mesh;
    for (Vec3& p : scaled.positions) p *= scale;
    const ReducedMesh same = without_thin_triangles(scaled);
    EXPECT_EQ(same.vertices, reduced.vertices) << scale;
    EXPECT_EQ(same.triangles, reduced.triangles) << scale;
  }
}

TEST(ThinTriangles, AreHardlyLeftOfModels) {
  for (const auto& [name, limit] : {std::pair{"bear", 0.003}, std::pair{"man", 0.01}, std::pair{"pinion", 0.01}}) {
    const TestModel input = load_standard_model(name);
    EncodeOptions options;
    options.width = options.height = 256;
    const TriangleMesh mesh =
        reconstruct_mesh(device(), encode_model(device(), input.mesh, input.skeleton, options).model);
    const TriangleMesh reduced = reduced_mesh(mesh);
    EXPECT_EQ(broken_rule(reduced, measure_manifold(mesh).genus), "");
    EXPECT_GT(thin_share(mesh), 0.015);
    EXPECT_LT(thin_share(reduced), limit) << name;
    const MetroReport moved = measure_metro(device(), mesh, reduced);
    EXPECT_LT(std::max(moved.forward.max, moved.backward.max) * moved.diagonal, 3 * tolerance(mesh)) << name;
    // It costs less accuracy than the same number of vertices is worth anywhere else.
    const double before = symmetric_mean(measure_metro(device(), input.mesh, mesh)),
                 after = symmetric_mean(measure_metro(device(), input.mesh, reduced));
    EXPECT_LT(after * static_cast<double>(reduced.positions.size()),
              before * static_cast<double>(mesh.positions.size()))
        << name;
  }
}

}  // namespace
}  // namespace skeletex
