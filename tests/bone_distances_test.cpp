// SPDX-License-Identifier: MIT
#include "skeletex/convert/measure/bone_distances.h"

#include <gtest/gtest.h>

#include "skeletex/analysis/metro.h"
#include "skeletex/convert/encode_model.h"
#include "skeletex/reconstruct/reconstruct_mesh.h"
#include "support/load_model.h"

namespace skeletex {
namespace {

ClContext& device() {
  static ClContext context;
  return context;
}

TEST(BoneDistances, AreTheHeightsOfPointsOverAPlane) {
  const TriangleMesh plane{{{-9, -9, 0}, {9, -9, 0}, {0, 9, 0}}, {{0, 1, 2}}};
  Chart flat, tent;
  flat.positions = {{0, 0, 0.5}, {1, 0, 0.5}, {0, 1, 0.5}}, flat.triangles = {{0, 1, 2}};
  // Two triangles of equal area; the middle of the first is at height 0, that of the second at 1.
  tent.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 3}}, tent.triangles = {{0, 2, 1}, {0, 1, 3}};
  tent.positions[2] = {0, 3, 0};
  const std::vector<Chart> charts{flat, tent};
  const std::vector<BoneDistance> distances =
      distances_from_bones(device(), charts, plane, build_triangle_tree(plane), 0);
  EXPECT_NEAR(distances[0].mean, 0.5, 1e-6);
  EXPECT_NEAR(distances[0].furthest, 0.5, 1e-6);
  EXPECT_NEAR(distances[1].mean, 0.5, 1e-6);
  EXPECT_NEAR(distances[1].furthest, 3, 1e-6);
  EXPECT_EQ(distances[1].place, Vec3(0, 0, 3));
}

TEST(VertexDistances, AreExactWhateverTheQuadsAndWithoutThem) {
  // Two quads in the plane z = 0: x from -2 to 0, and from 0 to 2.
  const TriangleMesh plane{{{-2, -1, 0}, {0, -1, 0}, {2, -1, 0}, {-2, 1, 0}, {0, 1, 0}, {2, 1, 0}},
                           {{0, 1, 4}, {0, 4, 3}, {1, 2, 5}, {1, 5, 4}}};
  Chart chart;
  chart.positions = {{-1, 0, 0.25}, {-1, 0.5, 0}, {1, 0, 0.5}, {1, 0, 7}};
  chart.kinds = {ChartVertex::kInner, ChartVertex::kInner, ChartVertex::kInner, ChartVertex::kHeadPole};
  const std::vector<Chart> charts{chart, chart, chart};
  const std::vector<std::vector<int>> quads{{0, 0, 1}, {1, 1, 0}, {}};  // right, wrong, none
  const auto distances = vertex_distances(charts, plane, build_triangle_tree(plane), quads, 1e-6);
  ASSERT_EQ(distances.size(), 3u);
  for (const BoneDistance& distance : distances) {
    EXPECT_NEAR(distance.mean, 0.25, 1e-6);
    EXPECT_NEAR(distance.median, 0.25, 1e-6);
    EXPECT_NEAR(distance.furthest, 0.5, 1e-6);
    EXPECT_EQ(distance.place, Vec3(1, 0, 0.5));
  }
}

TEST(SqueezedParts, AreToldOfByBoneAndPlaceAndKeptByFurtherReweighting) {
  const TestModel model = load_standard_model("bull_16");  // its tail has no bone: it belongs to a thigh
  EncodeOptions options;
  options.width = options.height = 128;
  const auto mean_of = [&](const SkeletexModel& encoded) {
    return measure_metro(device(), model.mesh, reconstruct_mesh(device(), encoded)).forward.mean;
  };
  options.reweights_squeezed = false;
  const EncodeResult lost = encode_model(device(), model.mesh, model.skeleton, options);
  const BoneReport* thigh = nullptr;
  for (const BoneReport& bone : lost.report.bones) {
    EXPECT_EQ(bone.map.iterations, options.vsm.iterations);
    if (bone.name == "left_thigh") thigh = &bone;
  }
  ASSERT_TRUE(thigh && lacks_part(*thigh, lost.report.diagonal));
  const std::vector<float> distances =
      closest_distances(device(), reconstruct_mesh(device(), lost.model), std::vector<Vec3>{thigh->distance.place});
  EXPECT_NEAR(static_cast<double>(distances[0]), thigh->distance.furthest, 1e-5 * lost.report.diagonal);

  options.reweights_squeezed = true;
  const EncodeResult kept = encode_model(device(), model.mesh, model.skeleton, options);
  int reweighted = 0;
  for (const BoneReport& bone : kept.report.bones) reweighted += bone.map.iterations > options.vsm.iterations;
  EXPECT_GE(reweighted, 1);
  EXPECT_LE(reweighted, 4);  // the others are left as they are
  EXPECT_LT(mean_of(kept.model), 0.3 * mean_of(lost.model));
}

TEST(SqueezedParts, AreNotFoundInABear) {
  const TestModel model = load_standard_model("bear");
  EncodeOptions options;
  options.width = options.height = 128;
  const EncodeResult encoded = encode_model(device(), model.mesh, model.skeleton, options);
  for (const BoneReport& bone : encoded.report.bones) {
    EXPECT_EQ(bone.map.iterations, options.vsm.iterations) << bone.name;
    EXPECT_FALSE(lacks_part(bone, encoded.report.diagonal)) << bone.name;
  }
}

}  // namespace
}  // namespace skeletex
