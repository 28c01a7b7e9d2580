// SPDX-License-Identifier: MIT
#include "skeletex/convert/subdivide/split_edges.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "skeletex/analysis/manifold.h"
#include "skeletex/analysis/metro.h"
#include "skeletex/convert/encode_model.h"
#include "skeletex/reconstruct/reconstruct_mesh.h"
#include "support/load_model.h"

namespace skeletex {
namespace {

double longest_edge(const TriangleMesh& mesh) {
  double longest = 0;
  for (const Triangle& t : mesh.triangles)
    for (int k = 0; k < 3; ++k)
      longest = std::max(longest, (mesh.positions[t[k]] - mesh.positions[t[(k + 1) % 3]]).norm());
  return longest;
}

TEST(SplitLongEdges, LeavesTheSurfaceAsItIsAndNoEdgeLong) {
  const TriangleMesh mesh = load_standard_model("pinion").mesh;
  const double before = longest_edge(mesh);
  for (const double share : {0.9, 0.5, 0.1, 0.03}) {
    const auto split = split_long_edges(mesh, share * before, 0);
    ASSERT_TRUE(split);
    EXPECT_LE(longest_edge(*split), share * before);
    const ManifoldReport report = measure_manifold(*split);
    EXPECT_TRUE(report.is_closed_manifold());
    EXPECT_EQ(report.genus, measure_manifold(mesh).genus);
    EXPECT_NEAR(surface_area(*split), surface_area(mesh), 1e-12 * surface_area(mesh));
    EXPECT_NEAR(signed_volume(*split), signed_volume(mesh), 1e-12 * signed_volume(mesh));
    EXPECT_TRUE(std::equal(mesh.positions.begin(), mesh.positions.end(), split->positions.begin()));
  }
}

TEST(SplitLongEdges, KeepsOrientationWhicheverEdgesOfATriangleAreLong) {
  std::mt19937 random(5);
  std::uniform_real_distribution<double> at(0, 1);
  for (int i = 0; i < 500; ++i) {
    TriangleMesh mesh{{{at(random), at(random), 0}, {at(random), at(random), 0}, {at(random), at(random), 0}},
                      {{0, 1, 2}}};
    if (area_vector(mesh, mesh.triangles[0]).z() < 0) std::swap(mesh.triangles[0][0], mesh.triangles[0][1]);
    const auto split = split_long_edges(mesh, 0.3, 0);
    if (!split) continue;
    double area = 0;
    for (const Triangle& t : split->triangles) {
      EXPECT_GE(area_vector(*split, t).z(), 0);
      area += area_vector(*split, t).z();
    }
    EXPECT_NEAR(area, area_vector(mesh, mesh.triangles[0]).z(), 1e-14);
  }
}

TEST(SplitLongEdges, DoesNothingToShortEdgesAndSmallTriangles) {
  const TriangleMesh mesh = load_standard_model("eight").mesh;
  EXPECT_FALSE(split_long_edges(mesh, longest_edge(mesh), 0));
  EXPECT_FALSE(split_long_edges(mesh, 1e-6 * longest_edge(mesh), surface_area(mesh)));
  const double least_area = 0.2 * surface_area(mesh) / static_cast<double>(mesh.triangles.size());
  const auto split = split_long_edges(mesh, 1e-6 * longest_edge(mesh), least_area);
  ASSERT_TRUE(split);
  for (const Triangle& t : split->triangles) EXPECT_LT(area_vector(*split, t).norm(), least_area);
}

TEST(SplitLongEdges, SaysWhatShareOfTheSurfaceItSplits) {
  // A triangle of area 2, one of area 1/2.
  const TriangleMesh mesh{{{0, 0, 0}, {2, 0, 0}, {0, 2, 0}, {0, 0, 1}, {1, 0, 1}, {0, 1, 1}}, {{0, 1, 2}, {3, 4, 5}}};
  EXPECT_DOUBLE_EQ(share_to_split(mesh, 1, 1), 0.8);
  EXPECT_DOUBLE_EQ(share_to_split(mesh, 1, 0.1), 1);
  EXPECT_DOUBLE_EQ(share_to_split(mesh, 2, 0.1), 0.8);
  EXPECT_DOUBLE_EQ(share_to_split(mesh, 3, 0.1), 0);
  EXPECT_DOUBLE_EQ(share_to_split(mesh, 1, 3), 0);
}

// Denser vertices around a few large triangles would move the map of the rest.
TEST(SplitLongEdges, LeavesAMeshOfWhichFewTrianglesAreLarge) {
  const TestModel model = load_standard_model("bull");  // 38 % of the surface lie in large triangles at 512
  ClContext context;
  EXPECT_EQ(encode_model(context, model.mesh, model.skeleton, {}).report.split_triangles, 0);
}

// The map of a few large triangles cannot be even: without splits the mean distance is 9e-7 of the diagonal.
TEST(SplitLongEdges, BringTheModelOfASparseMeshNearer) {
  const TestModel sparse = load_standard_model("eight");
  ClContext context;
  EncodeOptions options;
  options.layers.has_normals = false;
  const EncodeResult result = encode_model(context, sparse.mesh, sparse.skeleton, options);
  EXPECT_EQ(result.report.triangles, static_cast<int>(sparse.mesh.triangles.size()));
  EXPECT_GT(result.report.split_triangles, 2 * result.report.triangles);
  const TriangleMesh back = reconstruct_mesh(context, result.model);
  const SymmetricDistance distance = SymmetricMetro(context, sparse.mesh, 100'000).measure(back);
  EXPECT_LT(distance.mean, 3e-7);
}

}  // namespace
}  // namespace skeletex
