// SPDX-License-Identifier: MIT
#include "skeletex/analysis/manifold.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <numbers>
#include <numeric>
#include <random>

namespace skeletex {
namespace {

TriangleMesh tetrahedron(const Vec3& offset = Vec3::Zero()) {
  TriangleMesh mesh;
  for (const Vec3& p : {Vec3(0, 0, 0), Vec3(1, 0, 0), Vec3(0, 1, 0), Vec3(0, 0, 1)})
    mesh.positions.push_back(p + offset);
  mesh.triangles = {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}};
  return mesh;
}

TriangleMesh joined(const TriangleMesh& a, const TriangleMesh& b) {
  TriangleMesh mesh = a;
  const int base = static_cast<int>(a.positions.size());
  mesh.positions.insert(mesh.positions.end(), b.positions.begin(), b.positions.end());
  for (const Triangle& t : b.triangles) mesh.triangles.push_back({t[0] + base, t[1] + base, t[2] + base});
  return mesh;
}

TriangleMesh torus(int rings, int sides) {
  TriangleMesh mesh;
  for (int i = 0; i < rings; ++i)
    for (int j = 0; j < sides; ++j) {
      const double a = 2 * std::numbers::pi * i / rings, b = 2 * std::numbers::pi * j / sides;
      mesh.positions.emplace_back((3 + std::cos(b)) * std::cos(a), (3 + std::cos(b)) * std::sin(a), std::sin(b));
      const auto at = [&](int r, int s) { return (r % rings) * sides + s % sides; };
      mesh.triangles.push_back({at(i, j), at(i + 1, j), at(i + 1, j + 1)});
      mesh.triangles.push_back({at(i, j), at(i + 1, j + 1), at(i, j + 1)});
    }
  return mesh;
}

}  // namespace

TEST(Manifold, ATetrahedronIsAClosedSphere) {
  const ManifoldReport report = measure_manifold(tetrahedron());
  EXPECT_TRUE(report.is_closed_manifold());
  EXPECT_EQ(report.vertices, 4);
  EXPECT_EQ(report.edges, 6);
  EXPECT_EQ(report.triangles, 4);
  EXPECT_EQ(report.components, 1);
  EXPECT_EQ(report.genus, 0);
}

TEST(Manifold, ATorusHasGenusOneWhateverTheOrderOfItsVerticesAndTriangles) {
  TriangleMesh mesh = torus(17, 11);
  std::mt19937 random(7);
  std::vector<int> order(mesh.positions.size());
  std::iota(order.begin(), order.end(), 0);
  std::shuffle(order.begin(), order.end(), random);
  TriangleMesh shuffled = mesh;
  for (std::size_t i = 0; i < order.size(); ++i) shuffled.positions[order[i]] = mesh.positions[i];
  for (Triangle& t : shuffled.triangles)
    for (int& v : t) v = order[v];
  std::shuffle(shuffled.triangles.begin(), shuffled.triangles.end(), random);
  for (const TriangleMesh& m : {mesh, shuffled}) {
    const ManifoldReport report = measure_manifold(m);
    EXPECT_TRUE(report.is_closed_manifold());
    EXPECT_EQ(report.components, 1);
    EXPECT_EQ(report.genus, 1);
    EXPECT_EQ(report.edges, 3 * 17 * 11);
  }
}

TEST(Manifold, TheGenusOfSeveralComponentsIsTheirSum) {
  const ManifoldReport report = measure_manifold(joined(joined(torus(5, 4), tetrahedron()), torus(3, 3)));
  EXPECT_TRUE(report.is_closed_manifold());
  EXPECT_EQ(report.components, 3);
  EXPECT_EQ(report.genus, 2);
}

TEST(Manifold, AMissingTriangleLeavesItsThreeEdgesAsTheNeighboursRunThem) {
  TriangleMesh mesh = tetrahedron();
  mesh.triangles.pop_back();  // 1 2 3
  const ManifoldReport report = measure_manifold(mesh);
  EXPECT_FALSE(report.is_closed_manifold());
  EXPECT_EQ(report.boundary_edges, (std::vector<std::array<int, 2>>{{1, 3}, {2, 1}, {3, 2}}));
  EXPECT_TRUE(report.non_manifold_vertices.empty());
}

TEST(Manifold, AFlippedTriangleMarksItsEdges) {
  TriangleMesh mesh = tetrahedron();
  std::swap(mesh.triangles[3][0], mesh.triangles[3][1]);
  const ManifoldReport report = measure_manifold(mesh);
  EXPECT_EQ(report.misoriented_edges, (std::vector<std::array<int, 2>>{{1, 2}, {1, 3}, {2, 3}}));
  EXPECT_TRUE(report.boundary_edges.empty());
  EXPECT_TRUE(report.non_manifold_vertices.empty()) << "fans do not depend on orientation";
}

TEST(Manifold, AMeshInsideOutIsStillOriented) {
  TriangleMesh mesh = torus(6, 5);
  for (Triangle& t : mesh.triangles) std::swap(t[0], t[1]);
  EXPECT_TRUE(measure_manifold(mesh).is_closed_manifold());
}

TEST(Manifold, ThreeTrianglesAtAnEdgeAreNotManifold) {
  TriangleMesh mesh = tetrahedron();
  mesh.positions.emplace_back(1, 1, -1);
  mesh.triangles.push_back({0, 1, 4});
  const ManifoldReport report = measure_manifold(mesh);
  EXPECT_EQ(report.non_manifold_edges, (std::vector<std::array<int, 2>>{{0, 1}}));
  EXPECT_EQ(report.boundary_edges.size(), 2u);
  EXPECT_FALSE(report.is_closed_manifold());
}

TEST(Manifold, TwoTetrahedraAtAVertexAreFoundAtThatVertex) {
  TriangleMesh mesh = joined(tetrahedron(), tetrahedron(Vec3(-3, 0, 0)));
  for (Triangle& t : mesh.triangles)
    for (int& v : t)
      if (v == 5) v = 0;
  const ManifoldReport report = measure_manifold(mesh);
  EXPECT_EQ(report.non_manifold_vertices, std::vector<int>{0});
  EXPECT_EQ(report.unreferenced_vertices, std::vector<int>{5});
  EXPECT_EQ(report.components, 1);
  EXPECT_TRUE(report.boundary_edges.empty());
  EXPECT_TRUE(report.non_manifold_edges.empty());
  EXPECT_FALSE(report.is_closed_manifold());
}

TEST(Manifold, TwoTetrahedraAtAnEdgeAreFoundAtThatEdge) {
  TriangleMesh mesh = joined(tetrahedron(), tetrahedron(Vec3(-3, 0, 0)));
  for (Triangle& t : mesh.triangles)
    for (int& v : t) v = v == 5 ? 0 : v == 4 ? 1 : v;
  EXPECT_EQ(measure_manifold(mesh).non_manifold_edges, (std::vector<std::array<int, 2>>{{0, 1}}));
}

TEST(Manifold, BadIndicesRepeatedVerticesAndNotANumberAreListed) {
  TriangleMesh mesh = tetrahedron();
  mesh.positions.emplace_back(0, std::numeric_limits<double>::quiet_NaN(), 0);
  mesh.positions.emplace_back(std::numeric_limits<double>::infinity(), 0, 0);
  mesh.triangles.push_back({0, 0, 1});
  mesh.triangles.push_back({0, 1, 6});
  mesh.triangles.push_back({-1, 1, 2});
  const ManifoldReport report = measure_manifold(mesh);
  EXPECT_EQ(report.non_finite_vertices, (std::vector<int>{4, 5}));
  EXPECT_EQ(report.unreferenced_vertices, (std::vector<int>{4, 5}));
  EXPECT_EQ(report.degenerate_triangles, (std::vector<int>{4, 5, 6}));
  EXPECT_TRUE(report.boundary_edges.empty());
  EXPECT_EQ(report.genus, 0);
  EXPECT_FALSE(report.is_closed_manifold());
}

TEST(Manifold, AnEmptyMeshIsNothing) {
  const ManifoldReport report = measure_manifold({});
  EXPECT_FALSE(report.is_closed_manifold());
  EXPECT_EQ(report.components, 0);
}

TEST(Manifold, AMillionTrianglesArePossible) {
  const ManifoldReport report = measure_manifold(torus(1000, 1000));
  EXPECT_TRUE(report.is_closed_manifold());
  EXPECT_EQ(report.genus, 1);
}

}  // namespace skeletex
