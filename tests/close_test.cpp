// SPDX-License-Identifier: MIT
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>
#include <set>

#include "skeletex/analysis/manifold.h"
#include "skeletex/close/carry_over.h"
#include "skeletex/close/cut_handles.h"
#include "skeletex/close/fill_holes.h"
#include "skeletex/close/manifold_parts.h"
#include "skeletex/geometry/self_intersection.h"
#include "skeletex/geometry/triangle_tree.h"
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
    const FillResult result = fill_holes(mesh);
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

/// A cube without its lid, which has a fold in its boundary.
TriangleMesh open_cube() {
  TriangleMesh mesh;
  mesh.positions = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}, {0, 0, 1}, {1, 0, 1}, {1, 1, 1}, {0, 1, 1}};
  mesh.triangles = {{0, 2, 1}, {0, 3, 2}, {0, 1, 5}, {0, 5, 4}, {1, 2, 6},
                    {1, 6, 5}, {2, 3, 7}, {2, 7, 6}, {3, 0, 4}, {3, 4, 7}};
  return mesh;
}

/// Adds a mesh as a part of its own, moved.
void add_part(const TriangleMesh& part, const Vec3& offset, TriangleMesh& mesh) {
  const int first = static_cast<int>(mesh.positions.size());
  for (const Vec3& p : part.positions) mesh.positions.push_back(p + offset);
  for (const Triangle& t : part.triangles) mesh.triangles.push_back({t[0] + first, t[1] + first, t[2] + first});
}

TEST(FillHoles, AWideFlatHoleGetsItsOwnArea) {
  TriangleMesh mesh = open_cube();
  const FillResult result = fill_holes(mesh);
  EXPECT_EQ(result.obstacle, "");
  ASSERT_EQ(result.holes.size(), 1u);
  EXPECT_FALSE(result.holes[0].is_intersecting);
  EXPECT_NEAR(surface_area(mesh), 6, 1e-12);
  EXPECT_NEAR(signed_volume(mesh), 1, 1e-12);
}

TEST(FillHoles, AFillingThatIntersectsIsMarked) {
  // A second cube stands in the lid.
  TriangleMesh cube = open_cube();
  fill_holes(cube);
  for (Vec3& p : cube.positions) p *= 0.25;
  TriangleMesh mesh = open_cube();
  add_part(cube, Vec3(0.4, 0.4, 0.9), mesh);
  const FillResult result = fill_holes(mesh);
  ASSERT_EQ(result.holes.size(), 1u);
  EXPECT_TRUE(result.holes[0].is_intersecting);
  EXPECT_NE(result.obstacle.find("2 parts"), std::string::npos) << result.obstacle;
}

TEST(FillHoles, ASheetStaysOpen) {
  TriangleMesh sheet;
  const int side = 12;
  for (int i = 0; i <= side; ++i)
    for (int j = 0; j <= side; ++j) sheet.positions.emplace_back(i, j, 0.2 * std::sin(1.0 * i) * std::cos(0.7 * j));
  for (int i = 0; i < side; ++i)
    for (int j = 0; j < side; ++j) {
      const int a = i * (side + 1) + j, b = a + side + 1;
      sheet.triangles.push_back({a, b, b + 1});
      sheet.triangles.push_back({a, b + 1, a + 1});
    }
  const TriangleMesh before = sheet;
  const FillResult result = fill_holes(sheet);
  EXPECT_NE(result.obstacle.find("sheet"), std::string::npos) << result.obstacle;
  EXPECT_EQ(sheet.triangles, before.triangles);
}

TEST(FillHoles, NonManifoldEdgesAreTakenAwayAndFilled) {
  for (const NamedShape& shape : all_shapes()) {
    SCOPED_TRACE(shape.name);
    TriangleMesh mesh = shape.shape.mesh;
    const double volume = signed_volume(mesh);
    // A dangling triangle at an edge, and one that is turned over.
    const Triangle at = mesh.triangles[mesh.triangles.size() / 2];
    mesh.positions.push_back(1.1 * mesh.positions[at[0]]);
    mesh.triangles.push_back({at[0], at[1], static_cast<int>(mesh.positions.size()) - 1});
    std::swap(mesh.triangles[mesh.triangles.size() / 4][0], mesh.triangles[mesh.triangles.size() / 4][1]);
    const FillResult result = fill_holes(mesh);
    EXPECT_EQ(result.obstacle, "");
    EXPECT_GT(result.removed, 0);
    const ManifoldReport report = measure_manifold(mesh);
    EXPECT_TRUE(report.is_closed_manifold());
    EXPECT_EQ(report.genus, shape.genus);
    EXPECT_NEAR(signed_volume(mesh), volume, 0.01 * volume);
  }
}

TEST(FillHoles, TurnedTrianglesAreTurnedBack) {
  for (const NamedShape& shape : all_shapes())
    for (const int step : {3, 40}) {
      SCOPED_TRACE(shape.name);
      TriangleMesh mesh = shape.shape.mesh;
      long turned = 0;
      for (std::size_t t = 0; t < mesh.triangles.size(); t += step, ++turned)
        std::swap(mesh.triangles[t][1], mesh.triangles[t][2]);
      const FillResult result = fill_holes(mesh);
      EXPECT_EQ(result.obstacle, "");
      EXPECT_EQ(result.turned, turned);
      EXPECT_EQ(result.removed, 0);
      EXPECT_EQ(mesh.triangles, shape.shape.mesh.triangles);
    }
}

TEST(FillHoles, NonManifoldVerticesAreSplit) {
  // Two bodies that share one vertex, each the other's image in it.
  const TriangleMesh whole = y_shape().mesh;
  TriangleMesh mesh = whole;
  const int vertex = mesh.triangles[200][0];
  TriangleMesh other = whole;
  const Vec3 place = mesh.positions[vertex];
  for (Vec3& p : other.positions) p = 2 * place - p;
  for (Triangle& t : other.triangles) std::swap(t[1], t[2]);
  const int first = static_cast<int>(mesh.positions.size());
  add_part(other, Vec3::Zero(), mesh);
  for (Triangle& t : mesh.triangles)
    for (int& corner : t)
      if (corner == first + vertex) corner = vertex;
  ASSERT_EQ(measure_manifold(mesh).non_manifold_vertices, std::vector<int>{vertex});
  const FillResult result = fill_holes(mesh);
  EXPECT_EQ(result.copies, std::vector<int>{vertex});
  EXPECT_EQ(mesh.positions.back(), place);
  EXPECT_TRUE(measure_manifold(mesh).is_closed_manifold());
  EXPECT_NE(result.obstacle.find("2 parts"), std::string::npos) << result.obstacle;
}

TEST(KeepLargestComponent, KeepsAClosedBodyAlone) {
  const TriangleMesh torus = torus_shape().mesh;
  TriangleMesh mesh = y_shape().mesh;
  for (Vec3& p : mesh.positions) p *= 0.05;
  const std::size_t small = mesh.triangles.size();
  add_part(torus, Vec3(10, 0, 0), mesh);
  std::vector<int> origins(mesh.triangles.size());
  std::iota(origins.begin(), origins.end(), 0);
  TriangleMesh open = mesh;
  std::vector<int> open_origins = origins;
  open.triangles.pop_back();
  open_origins.pop_back();
  EXPECT_EQ(keep_largest_component(open, open_origins), 0);
  EXPECT_EQ(open.triangles.size(), mesh.triangles.size() - 1);
  const double area = surface_area(mesh), share = keep_largest_component(mesh, origins);
  EXPECT_NEAR(share * area, surface_area(torus), 1e-9 * area);
  EXPECT_EQ(mesh.triangles.size(), torus.triangles.size());
  EXPECT_EQ(origins.front(), static_cast<int>(small));
  EXPECT_EQ(measure_manifold(mesh).genus, 1);
}

TEST(FillHoles, WhatStandsInTheWayIsSaid) {
  const TriangleMesh torus = torus_shape().mesh;
  TriangleMesh two = torus;
  add_part(torus, Vec3(10, 0, 0), two);
  EXPECT_NE(fill_holes(two).obstacle.find("2 parts"), std::string::npos);
  TriangleMesh fins = torus;
  for (std::size_t t = 0; t < torus.triangles.size(); t += 10) {
    fins.positions.push_back(Vec3(0, 0, 3));
    fins.triangles.push_back(
        {torus.triangles[t][0], torus.triangles[t][1], static_cast<int>(fins.positions.size()) - 1});
  }
  EXPECT_NE(fill_holes(fins).obstacle.find("more than two triangles"), std::string::npos);
}

/// Pairs of triangles that intersect, of the mesh as a model has it: in planes that rounding has left, none would be
/// sure.
std::size_t intersecting_pairs(const TriangleMesh& mesh) {
  return find_self_intersections(in_unit_frame(mesh, unit_frame(mesh))).size();
}

TEST(CutHandles, ATorusIsCutAcrossItsTube) {
  constexpr double kCore = 2, kTube = 0.4, kAround = 2 * std::numbers::pi * kTube;
  const TriangleMesh torus = torus_shape(5, kCore, kTube).mesh;
  TriangleMesh mesh = torus;
  const HandleCuts none = cut_handles(mesh, 0.95 * kAround);
  EXPECT_TRUE(none.loops.empty());
  EXPECT_NEAR(none.shortest_left, kAround, 0.05 * kAround);
  EXPECT_EQ(mesh.positions, torus.positions);
  EXPECT_EQ(mesh.triangles, torus.triangles);
  const HandleCuts cuts = cut_handles(mesh, 1.1 * kAround);
  ASSERT_EQ(cuts.loops.size(), 1u);
  EXPECT_NEAR(cuts.loops[0].length, kAround, 0.05 * kAround);
  EXPECT_NEAR(cuts.loops[0].centre.norm(), kCore, 0.01 * kCore);
  EXPECT_EQ(cuts.shortest_left, 0);
  const ManifoldReport report = measure_manifold(mesh);
  EXPECT_TRUE(report.is_closed_manifold());
  EXPECT_EQ(report.genus, 0);
  EXPECT_EQ(report.components, 1);
  EXPECT_EQ(intersecting_pairs(mesh), 0u);
  EXPECT_NEAR(signed_volume(mesh), signed_volume(torus), 0.02 * signed_volume(torus));
  // What was there is there still, or a copy of it.
  ASSERT_EQ(cuts.origins.size(), mesh.triangles.size());
  ASSERT_EQ(cuts.copies.size(), mesh.positions.size() - torus.positions.size());
  const int first = static_cast<int>(torus.positions.size());
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t)
    for (int k = 0; k < 3 && cuts.origins[t] >= 0; ++k) {
      const int v = mesh.triangles[t][k];
      EXPECT_EQ(v < first ? v : cuts.copies[v - first], torus.triangles[cuts.origins[t]][k]);
    }
}

TEST(CutHandles, ANarrowTunnelIsPlugged) {
  constexpr double kCore = 1, kTube = 0.85, kAround = 2 * std::numbers::pi * (kCore - kTube);
  TriangleMesh mesh = torus_shape(5, kCore, kTube, 48, 48).mesh;
  const double volume = signed_volume(mesh);
  const HandleCuts cuts = cut_handles(mesh, 1.1 * kAround);
  ASSERT_EQ(cuts.loops.size(), 1u);
  EXPECT_NEAR(cuts.loops[0].length, kAround, 0.05 * kAround);
  EXPECT_LT(cuts.loops[0].centre.norm(), kCore - kTube);
  EXPECT_EQ(measure_manifold(mesh).genus, 0);
  EXPECT_EQ(intersecting_pairs(mesh), 0u);
  EXPECT_NEAR(signed_volume(mesh), volume, 0.01 * volume);
}

TEST(CutHandles, EveryHandleIsCut) {
  const TriangleMesh theta = theta_shape().mesh;
  TriangleMesh mesh = theta;
  const HandleCuts cuts = cut_handles(mesh, bounding_box(theta).diagonal());
  EXPECT_EQ(cuts.loops.size(), 2u);
  EXPECT_FALSE(cuts.is_stuck);
  const ManifoldReport report = measure_manifold(mesh);
  EXPECT_TRUE(report.is_closed_manifold());
  EXPECT_EQ(report.genus, 0);
  EXPECT_EQ(report.components, 1);
  EXPECT_NEAR(signed_volume(mesh), signed_volume(theta), 0.05 * signed_volume(theta));
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
  ASSERT_TRUE(result.attributes.original);
  ASSERT_EQ(result.attributes.original->weights.size(), weights.size());
  EXPECT_EQ(result.attributes.original->weights[7][0].weight, weights[7][0].weight);
  const VertexDistances distances = distances_of_vertices(to, from);
  EXPECT_NEAR(distances.mean, 0.02, 0.005);
  EXPECT_LT(distances.largest, 0.03);
}

TEST(CarryOver, PartsOfTheFileThatAreInsideOutAreTurned) {
  // A torus outwards; one inside out whose normals follow its triangles; one that is open and inside out, whose normals
  // look outwards. One normal per corner.
  const TriangleMesh torus = torus_shape().mesh;
  const int count = static_cast<int>(torus.positions.size());
  TriangleMesh outwards;
  MeshAttributes attributes;
  for (const int part : {0, 1, 2}) {
    for (const Vec3& p : torus.positions) outwards.positions.emplace_back(p + Vec3(part * 20, 0, 0));
    for (const Triangle& t : part == 2 ? with_hole(torus, 100).triangles : torus.triangles)
      outwards.triangles.push_back({t[0] + part * count, t[1] + part * count, t[2] + part * count});
  }
  TriangleMesh file = outwards;
  for (Triangle& t : file.triangles) {
    const int part = t[0] / count, first = static_cast<int>(attributes.normals.values.size());
    const Vec3 normal = area_vector(outwards, t).normalized();
    if (part > 0) std::swap(t[1], t[2]);
    attributes.normals.values.insert(attributes.normals.values.end(), 3, part == 1 ? Vec3(-normal) : normal);
    attributes.normals.corners.push_back({first, first + 1, first + 2});
  }
  const CarriedOver result = carry_over(file, build_triangle_tree(file), attributes, {}, torus);
  ASSERT_TRUE(result.attributes.original);
  EXPECT_EQ(result.attributes.original->mesh.triangles, outwards.triangles);
  const std::vector<Triangle>& corners = result.attributes.original->attributes.normals.corners;
  for (std::size_t t = 0; t < corners.size(); ++t)
    EXPECT_EQ(corners[t][1] > corners[t][2], outwards.triangles[t][0] >= count);
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

TEST(CarryOver, NormalsOfTurnedTrianglesLookOutwards) {
  for (const bool are_most_turned : {false, true})
    for (const bool follow_winding : {false, true}) {  // or look outwards from the beginning
      TriangleMesh mesh = torus_shape().mesh;
      CornerValues<Vec3> normals;  // one per triangle
      for (int t = 0; t < static_cast<int>(mesh.triangles.size()); ++t) {
        Triangle& triangle = mesh.triangles[t];
        const Vec3 outwards = area_vector(mesh, triangle).normalized();
        if ((t % 3 == 0) != are_most_turned) std::swap(triangle[0], triangle[1]);
        normals.values.push_back(follow_winding ? area_vector(mesh, triangle).normalized() : outwards);
        normals.corners.push_back({t, t, t});
      }
      const TriangleMesh before = mesh;
      const FillResult result = fill_holes(mesh);
      ASSERT_GT(result.turned, 0);
      flip_inward_normals(mesh, before.triangles, mesh.triangles, result.origins, normals);
      const double sign = are_most_turned ? -1 : 1;  // the mesh is inside out then
      for (std::size_t t = 0; t < mesh.triangles.size(); ++t)
        for (const int corner : normals.corners[t])
          EXPECT_GT(sign * normals.values[corner].dot(area_vector(mesh, mesh.triangles[t])), 0);
    }
}

}  // namespace
}  // namespace skeletex
