// SPDX-License-Identifier: MIT
#include "support/shapes.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <numbers>

#include "skeletex/analysis/manifold.h"

namespace skeletex {
namespace {

TEST(Shapes, AreClosedOrientedManifoldsOfOneComponentAndOfTheGenusTheyName) {
  for (const NamedShape& named : all_shapes()) {
    SCOPED_TRACE(named.name);
    const ManifoldReport report = measure_manifold(named.shape.mesh);
    EXPECT_TRUE(report.is_closed_manifold());
    EXPECT_EQ(report.components, 1);
    EXPECT_EQ(report.genus, named.genus);
    EXPECT_TRUE(report.unreferenced_vertices.empty());
    EXPECT_GT(signed_volume(named.shape.mesh), 0);
    double smallest_angle = 4;
    for (const Triangle& t : named.shape.mesh.triangles)
      for (int i = 0; i < 3; ++i) {
        const Vec3& p = named.shape.mesh.positions[t[i]];
        const Vec3 a = named.shape.mesh.positions[t[(i + 1) % 3]] - p,
                   b = named.shape.mesh.positions[t[(i + 2) % 3]] - p;
        smallest_angle = std::min(smallest_angle, std::atan2(a.cross(b).norm(), a.dot(b)));
      }
    EXPECT_GT(smallest_angle, 0.02);
  }
}

TEST(Shapes, ThickenedSkeletonHasTheVolumeOfItsCapsule) {
  Skeleton skeleton{{{"a", Vec3::Zero()}, {"b", Vec3(0.3, 1, 1.7)}}, {{"bone", 0, 1, {}}}};
  const double length = bone_length(skeleton, 0), r = 0.6;
  const double expected = std::numbers::pi * r * r * length + 4.0 / 3 * std::numbers::pi * r * r * r;
  // An inscribed triangulation with edges of about h loses h^2 / (8 r) of radius at most.
  const double h = 0.1;
  const TriangleMesh mesh = thickened(skeleton, {r, r}, 0.1, h);
  EXPECT_NEAR(signed_volume(mesh), expected, expected * 3 * h * h / (8 * r * r));
  for (const Vec3& p : mesh.positions)
    EXPECT_NEAR(distance_to_bone(p, skeleton.nodes[0].position, skeleton.nodes[1].position), r, 1e-5);
}

TEST(Shapes, SimilaritiesScaleAreaAndVolumeAndRenumberingKeepsThem) {
  for (const std::uint64_t seed : {1u, 2u, 3u}) {
    SCOPED_TRACE(seed);
    const Shape shape = mushroom_shape(16);
    const Similarity map = random_similarity(seed);
    const double volume = signed_volume(shape.mesh), area = surface_area(shape.mesh);
    EXPECT_NEAR(map.rotation.determinant(), 1, 1e-12);
    const Shape moved = transformed(shape, map);
    EXPECT_NEAR(signed_volume(moved.mesh) / (std::pow(map.scale, 3) * volume), 1, 1e-12);
    EXPECT_NEAR(surface_area(moved.mesh) / (map.scale * map.scale * area), 1, 1e-12);
    EXPECT_NEAR(bone_length(moved.skeleton, 1) / (map.scale * bone_length(shape.skeleton, 1)), 1, 1e-12);
    const TriangleMesh renumbered = with_triangles_renumbered(
        with_vertices_renumbered(shape.mesh, random_permutation(static_cast<int>(shape.mesh.positions.size()), seed)),
        random_permutation(static_cast<int>(shape.mesh.triangles.size()), seed));
    EXPECT_NEAR(signed_volume(renumbered) / volume, 1, 1e-12);
    EXPECT_NEAR(signed_volume(inside_out(renumbered)) / volume, -1, 1e-12);
    const Skeleton bones = with_nodes_renumbered(with_bones_renumbered(shape.skeleton, {2, 0, 1}), {3, 1, 0, 2});
    EXPECT_EQ(bones.bones[2].name, "foot");
    EXPECT_EQ(end_position(bones, 2, BoneEnd::kTail), end_position(shape.skeleton, 0, BoneEnd::kTail));
  }
}

}  // namespace
}  // namespace skeletex
