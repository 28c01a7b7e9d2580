// SPDX-License-Identifier: MIT
#include "skeletex/convert/subdivide/loop_surface.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <array>
#include <cmath>

#include "skeletex/analysis/manifold.h"
#include "skeletex/analysis/metro.h"
#include "skeletex/convert/encode_model.h"
#include "skeletex/reconstruct/reconstruct_mesh.h"
#include "support/load_model.h"

namespace skeletex {
namespace {

TriangleMesh octahedron() {
  return {{{1, 0, 0}, {-1, 0, 0}, {0, 1, 0}, {0, -1, 0}, {0, 0, 1}, {0, 0, -1}},
          {{0, 2, 4}, {2, 1, 4}, {1, 3, 4}, {3, 0, 4}, {2, 0, 5}, {1, 2, 5}, {3, 1, 5}, {0, 3, 5}}};
}

TEST(LoopSurface, HasTheLimitOfEachVertexWhateverTheNumberOfRounds) {
  const TestModel model = load_standard_model("triceratops");
  const TriangleMesh once = loop_surface(model.mesh, {}, 1).mesh, twice = loop_surface(model.mesh, {}, 2).mesh;
  EXPECT_EQ(twice.triangles.size(), 16 * model.mesh.triangles.size());
  const double diagonal = bounding_box(once).diagonal();  // OpenMesh's weights are good to single precision
  for (std::size_t v = 0; v < once.positions.size(); ++v)
    EXPECT_LT((once.positions[v] - twice.positions[v]).norm(), 1e-6 * diagonal);
  EXPECT_TRUE(measure_manifold(twice).is_closed_manifold());
  EXPECT_EQ(measure_manifold(twice).genus, measure_manifold(model.mesh).genus);
}

TEST(LoopSurface, OfAnOctahedronIsAsSymmetricAsItAndConvergesInItsNormals) {
  const TriangleMesh surface = loop_surface(octahedron(), {}, 4).mesh;
  // Valence 4: the limit is (1 - 4 w) v + w (sum of neighbours), and these cancel.
  const double share = (40 - 9) / 64.0, weight = 1 / (3 * 4 / (8 * share) + 4);
  for (int v = 0; v < 6; ++v) EXPECT_NEAR(surface.positions[v].norm(), 1 - 4 * weight, 1e-12);
  EXPECT_GT(signed_volume(surface), 0);
  // Smooth: edges turn by no more than a sixteenth or so of the octahedron's 70 degrees.
  double least = 1;
  std::vector<Vec3> normals;
  for (const Triangle& t : surface.triangles) normals.push_back(area_vector(surface, t).normalized());
  for (std::size_t t = 0; t < normals.size(); t += 4)
    for (int k = 0; k < 3; ++k) least = std::min(least, normals[t + 3].dot(normals[t + k]));
  EXPECT_GT(least, std::cos(0.15));
}

TEST(LoopSurface, CarriesAttributesLinearly) {
  const TriangleMesh mesh = octahedron();
  MeshAttributes attributes;
  attributes.normals.values.assign(6, Vec3(0, 0, 1));
  attributes.numbers.push_back({"x", {}});
  for (const Vec3& p : mesh.positions) {
    attributes.numbers[0].values.push_back(static_cast<float>(p.x()));
    attributes.colours.values.push_back(Colour(static_cast<float>(p.y()), 0, 0, 1));
  }
  // Texture coordinates that are cut everywhere.
  for (int t = 0; t < 8; ++t) {
    for (int k = 0; k < 3; ++k)
      attributes.texture_coordinates.values.push_back({static_cast<float>(t), static_cast<float>(k)});
    attributes.texture_coordinates.corners.push_back({3 * t, 3 * t + 1, 3 * t + 2});
    attributes.triangle_materials.push_back(t);
  }
  const AttributedMesh fine = loop_surface(mesh, attributes, 2);
  EXPECT_TRUE(fine.attributes.normals.empty());
  ASSERT_EQ(fine.attributes.numbers[0].values.size(), fine.mesh.positions.size());
  ASSERT_EQ(fine.attributes.triangle_materials.size(), fine.mesh.triangles.size());
  const CornerValues<Colour>& colours = fine.attributes.colours;
  for (std::size_t t = 0; t < fine.mesh.triangles.size(); ++t) {
    EXPECT_EQ(fine.attributes.triangle_materials[t], static_cast<int>(t / 16));
    for (int k = 0; k < 3; ++k) {
      const int vertex = fine.mesh.triangles[t][k];
      // The sum over an edge of |x| + |y| + |z| is 1: what is linear in the corners stays so.
      EXPECT_LE(std::abs(fine.attributes.numbers[0].values[vertex]), 1.0f);
      EXPECT_LE(std::abs(colours.values[colours.of(fine.mesh, t)[k]].x()) +
                    std::abs(fine.attributes.numbers[0].values[vertex]),
                1.0f + 1e-6f);
      const auto& place = fine.attributes.texture_coordinates.values[fine.attributes.texture_coordinates.corners[t][k]];
      EXPECT_FLOAT_EQ(place.x(), static_cast<float>(t / 16));
    }
  }
}

TEST(LoopSurface, FacesWithoutTextureCoordinatesStaySo) {
  const TriangleMesh mesh = octahedron();
  MeshAttributes attributes;
  attributes.texture_coordinates.values.assign(3, {0.25f, 0.5f});
  attributes.texture_coordinates.corners.assign(8, {-1, -1, -1});
  attributes.texture_coordinates.corners[5] = {0, 1, 2};
  attributes.texture_coordinates.corners[6] = {0, -1, 1};
  const AttributedMesh fine = loop_surface(mesh, attributes, 1);
  const CornerValues<Eigen::Vector2f>& coordinates = fine.attributes.texture_coordinates;
  ASSERT_EQ(coordinates.corners.size(), 32u);
  for (int t = 0; t < 32; ++t)
    for (const int corner : coordinates.corners[t]) {
      if (t / 4 != 6) {
        EXPECT_EQ(corner >= 0, t / 4 == 5) << t;
      }
      EXPECT_LT(corner, static_cast<int>(coordinates.values.size()));
    }
  const std::array<int, 4> missing{1, 3, 1, 2};  // corners of the quarters of triangle 6
  for (int i = 0; i < 4; ++i)
    EXPECT_EQ(std::count(coordinates.corners[24 + i].begin(), coordinates.corners[24 + i].end(), -1), missing[i]) << i;
}

TEST(LoopSurface, ComesBackSmootherThanItsMeshWithMoreTexels) {
  ClContext context;
  const TestModel model = load_standard_model("triceratops");
  const TriangleMesh surface = loop_surface(model.mesh, {}, 2).mesh;
  double last = 1;
  for (const int size : {128, 256}) {
    EncodeOptions options;
    options.width = options.height = size;
    const TriangleMesh back = reconstruct_mesh(context, encode_model(context, surface, model.skeleton, options).model);
    EXPECT_TRUE(measure_manifold(back).is_closed_manifold());
    const double mean = symmetric_mean(measure_metro(context, surface, back));
    EXPECT_LT(mean, last / 2);
    last = mean;
  }
  EXPECT_LT(last, symmetric_mean(measure_metro(context, surface, model.mesh)) / 10);
}

}  // namespace
}  // namespace skeletex
