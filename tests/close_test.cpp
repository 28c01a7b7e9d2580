// SPDX-License-Identifier: MIT
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <set>

#include "skeletex/analysis/manifold.h"
#include "skeletex/close/carry_over.h"
#include "skeletex/close/fill_holes.h"
#include "support/shapes.h"

namespace skeletex {
namespace {

/// Takes away the triangles around a vertex and those around its neighbours.
TriangleMesh with_hole(TriangleMesh mesh, int vertex) {
  std::set<int> around{vertex};
  for (const Triangle& t : mesh.triangles)
    if (std::find(t.begin(), t.end(), vertex) != t.end()) around.insert(t.begin(), t.end());
  std::erase_if(mesh.triangles, [&](const Triangle& t) {
    return std::any_of(t.begin(), t.end(), [&](int corner) { return around.count(corner) > 0; });
  });
  return mesh;
}

TEST(FillHoles, SmallHolesAreClosedAndNothingElseChanges) {
  for (const NamedShape& shape : all_shapes()) {
    SCOPED_TRACE(shape.name);
    const TriangleMesh& whole = shape.shape.mesh;
    const int count = static_cast<int>(whole.positions.size());
    TriangleMesh mesh = with_hole(with_hole(whole, count / 3), 2 * count / 3);
    const TriangleMesh open = mesh;
    ASSERT_LT(open.triangles.size(), whole.triangles.size());
    const FillResult result = fill_holes(mesh, {.largest = 0.25});
    EXPECT_EQ(result.obstacle, "");
    EXPECT_EQ(result.holes.size(), 2u);
    const ManifoldReport report = measure_manifold(mesh);
    EXPECT_TRUE(report.is_closed_manifold());
    EXPECT_EQ(report.genus, shape.genus);
    EXPECT_EQ(mesh.positions, open.positions);
    EXPECT_TRUE(std::equal(open.triangles.begin(), open.triangles.end(), mesh.triangles.begin()));
    EXPECT_NEAR(signed_volume(mesh), signed_volume(whole), 0.02 * signed_volume(whole));
  }
}

TEST(FillHoles, AFlatHoleGetsItsOwnArea) {
  // A cube without its lid, which has a fold in its boundary.
  TriangleMesh mesh;
  mesh.positions = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}, {0, 0, 1}, {1, 0, 1}, {1, 1, 1}, {0, 1, 1}};
  mesh.triangles = {{0, 2, 1}, {0, 3, 2}, {0, 1, 5}, {0, 5, 4}, {1, 2, 6},
                    {1, 6, 5}, {2, 3, 7}, {2, 7, 6}, {3, 0, 4}, {3, 4, 7}};
  EXPECT_NE(fill_holes(mesh).obstacle.find("too large"), std::string::npos);
  EXPECT_EQ(fill_holes(mesh, {.largest = 1}).obstacle, "");
  EXPECT_NEAR(surface_area(mesh), 6, 1e-12);
  EXPECT_NEAR(signed_volume(mesh), 1, 1e-12);
}

TEST(FillHoles, WhatStandsInTheWayIsSaid) {
  const TriangleMesh torus = torus_shape().mesh;
  TriangleMesh two = torus;
  for (const Vec3& p : torus.positions) two.positions.push_back(p + Vec3(10, 0, 0));
  for (const Triangle& t : torus.triangles) {
    const int offset = static_cast<int>(torus.positions.size());
    two.triangles.push_back({t[0] + offset, t[1] + offset, t[2] + offset});
  }
  EXPECT_NE(fill_holes(two).obstacle.find("2 parts"), std::string::npos);
  TriangleMesh fin = torus;
  fin.positions.push_back(Vec3(0, 0, 3));
  fin.triangles.push_back({torus.triangles[0][0], torus.triangles[0][1], static_cast<int>(torus.positions.size())});
  EXPECT_NE(fill_holes(fin).obstacle.find("more than two triangles"), std::string::npos);
}

TEST(CarryOver, ValuesAreThoseOfTheNearestPoint) {
  const TriangleMesh from = torus_shape(5, 2, 0.5, 96, 36).mesh, to = torus_shape(5, 2, 0.52, 50, 20).mesh;
  const auto value = [](const Vec3& p) { return static_cast<float>(0.5 + 0.1 * p.x() - 0.05 * p.z()); };
  MeshAttributes attributes;
  attributes.numbers.push_back({"height", {}});
  VertexBoneWeights weights;
  for (const Vec3& p : from.positions) {
    attributes.numbers[0].values.push_back(value(p));
    attributes.colours.values.emplace_back(value(p), 0.5f, 1.f, 1.f);
    weights.push_back({{1, value(p)}, {3, 1 - value(p)}});
  }
  const CarriedOver result = carry_over(from, build_triangle_tree(from), attributes, weights, to);
  for (std::size_t v = 0; v < to.positions.size(); ++v) {
    const float expected = value(to.positions[v]);
    EXPECT_NEAR(result.attributes.numbers.at(0).values[v], expected, 0.01);
    EXPECT_NEAR(result.attributes.colours.values[v][0], expected, 0.01);
    ASSERT_EQ(result.weights[v].size(), 2u);
    EXPECT_NEAR(result.weights[v][0].weight, expected, 0.01);
  }
  const VertexDistances distances = vertex_distances(to, from);
  EXPECT_NEAR(distances.mean, 0.02, 0.005);
  EXPECT_LT(distances.largest, 0.03);
}

TEST(CarryOver, NewTrianglesTakeTheValuesOfTheirNeighbours) {
  const TriangleMesh whole = torus_shape().mesh;
  const TriangleMesh open = with_hole(whole, 100);
  TriangleMesh mesh = open;
  MeshAttributes attributes;
  attributes.texture_coordinates.corners = open.triangles;
  for (const Vec3& p : open.positions) attributes.texture_coordinates.values.emplace_back(p.x(), p.y());
  attributes.triangle_materials.assign(open.triangles.size(), 2);
  const FillResult result = fill_holes(mesh);
  const MeshAttributes filled = with_triangles(attributes, open.triangles, mesh.triangles, result.origins);
  EXPECT_EQ(filled.texture_coordinates.corners, mesh.triangles);
  EXPECT_EQ(filled.triangle_materials, std::vector<int>(mesh.triangles.size(), 2));
}

}  // namespace
}  // namespace skeletex
