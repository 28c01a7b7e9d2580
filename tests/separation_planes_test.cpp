// SPDX-License-Identifier: MIT
#include "skeletex/skeleton/separation_planes.h"

#include <gtest/gtest.h>

#include "support/random_skeleton.h"

namespace skeletex {
namespace {

using test::random_between;
using test::star_skeleton;
using test::turn_distance;

constexpr int kTrials = 60;
// Least angle between bones in these tests. Slopes are up to 1 / tan(half of it), which multiplies rounding errors.
constexpr double kLeastAngle = 0.35;

/// The bone whose direction from node 0 is nearest to a direction: its spherical Voronoi cell holds it.
int nearest_bone(const Skeleton& skeleton, const Vec3& direction) {
  const auto at = bones_at_nodes(skeleton)[0];
  int best = 0;
  for (int i = 1; i < static_cast<int>(at.size()); ++i)
    if (direction.dot(direction_from(skeleton, at[i])) > direction.dot(direction_from(skeleton, at[best]))) best = i;
  return best;
}

/// Which end of a star's bone lies at its centre.
BoneEnd end_at_centre(const Skeleton& skeleton, int bone) {
  return skeleton.bones[bone].head == 0 ? BoneEnd::kHead : BoneEnd::kTail;
}
/// Direction of the seam at an angle.
Vec3 seam_direction(const SeparationPlanes& separation, int bone, BoneEnd end, double turn) {
  return (separation.radial(bone, turn) + separation.slope(bone, end, turn) * separation.bases()[bone].o).normalized();
}

}  // namespace

TEST(SeparationPlanes, BoundTheVoronoiCellsOfTheBoneDirections) {
  std::mt19937 random(1);
  for (int trial = 0; trial < kTrials; ++trial) {
    const int count = 2 + trial % 6;
    const Skeleton skeleton = star_skeleton(test::spread_directions(count, kLeastAngle, random), random);
    const SeparationPlanes separation(skeleton);
    for (int bone = 0; bone < count; ++bone) {
      const BoneEnd end = end_at_centre(skeleton, bone);
      const double inwards = end == BoneEnd::kHead ? 1 : -1;
      for (int sample = 0; sample < 50; ++sample) {
        const double turn = random_between(random, 0, 1);
        const Vec3 radial = separation.radial(bone, turn), o = separation.bases()[bone].o;
        const double k = separation.slope(bone, end, turn);
        EXPECT_EQ(nearest_bone(skeleton, radial + (k + 1e-9 * inwards) * o), bone);
        EXPECT_EQ(nearest_bone(skeleton, radial + (k - 1e-9 * inwards) * o), separation.neighbour(bone, end, turn));
      }
    }
  }
}

TEST(SeparationPlanes, GiveEveryBoneTheSameSeamPoint) {
  std::mt19937 random(2);
  for (int trial = 0; trial < kTrials; ++trial) {
    const int count = 2 + trial % 6;
    const Skeleton skeleton = star_skeleton(test::spread_directions(count, kLeastAngle, random), random);
    const SeparationPlanes separation(skeleton);
    for (int bone = 0; bone < count; ++bone) {
      const BoneEnd end = end_at_centre(skeleton, bone);
      for (int sample = 0; sample < 50; ++sample) {
        const double turn = random_between(random, 0, 1), distance = random_between(random, 0.01, 3);
        const Vec3 point = separation.seam_point(bone, end, turn, distance);
        const Vec3 offset = point - skeleton.nodes[0].position;
        EXPECT_LT(turn_distance(separation.turn_of(bone, offset), turn), 1e-13);
        EXPECT_NEAR(separation.half_line_distance(bone, end, point), distance, 1e-13 * (1 + offset.norm()));

        const int other = separation.neighbour(bone, end, turn);
        const BoneEnd other_end = end_at_centre(skeleton, other);
        const double other_distance = separation.half_line_distance(other, other_end, point);
        EXPECT_NEAR(other_distance, distance, 1e-12 * (1 + offset.norm()));
        const double other_turn = separation.turn_of(other, offset);
        EXPECT_LT((separation.seam_point(other, other_end, other_turn, other_distance) - point).norm(),
                  1e-12 * (1 + offset.norm()));
        // Both sides' frames point from the node straight at the seam's points.
        EXPECT_LT((seam_direction(separation, other, other_end, other_turn) - offset.normalized()).norm(), 1e-12);
      }
    }
  }
}

TEST(SeparationPlanes, GiveACornerToAllThreeBones) {
  std::mt19937 random(3);
  for (int trial = 0; trial < kTrials; ++trial) {
    const Skeleton skeleton = star_skeleton(test::spread_directions(3, kLeastAngle, random), random);
    const SeparationPlanes separation(skeleton);
    const auto at = bones_at_nodes(skeleton)[0];
    std::array<Vec3, 3> d;
    for (int i = 0; i < 3; ++i) d[i] = direction_from(skeleton, at[i]);
    // Three bones: the two corners are opposite to each other, along the common normal of the separation planes.
    const Vec3 axis = (d[0] - d[1]).cross(d[1] - d[2]).normalized();
    for (const Vec3& corner : {axis, Vec3(-axis)}) {
      const double distance = 0.7;
      const Vec3 point = separation.seam_point(0, at[0].end, separation.turn_of(0, corner), distance);
      for (int i = 0; i < 3; ++i) {
        // Three nearly coplanar separation planes: the corner is conditioned by how far their normals are from
        // parallel.
        const double tolerance = 1e-13 / (d[0] - d[1]).cross(d[1] - d[2]).norm();
        const Vec3 same = separation.seam_point(i, at[i].end, separation.turn_of(i, corner), distance);
        EXPECT_LT((same - point).norm(),
                  std::max(tolerance, 1e-12) * (1 + (point - skeleton.nodes[0].position).norm()));
      }
    }
  }
}

TEST(SeparationPlanes, MirrorAnglesBetweenNeighbours) {
  // v_j = sigma v_i + c along a whole arc: sigma = -1 where both bones have the same end at the node.
  std::mt19937 random(4);
  for (int trial = 0; trial < kTrials; ++trial) {
    const int count = 2 + trial % 6;
    const Skeleton skeleton = star_skeleton(test::spread_directions(count, kLeastAngle, random), random);
    const SeparationPlanes separation(skeleton);
    for (int bone = 0; bone < count; ++bone) {
      const BoneEnd end = end_at_centre(skeleton, bone);
      const int samples = 200;
      for (int j = 0; j < samples; ++j) {
        const double a = static_cast<double>(j) / samples, b = static_cast<double>(j + 1) / samples;
        const int other = separation.neighbour(bone, end, a);
        if (separation.neighbour(bone, end, b) != other || separation.neighbour(bone, end, (a + b) / 2) != other)
          continue;
        const double sigma = end_at_centre(skeleton, other) == end ? -1 : 1;
        const double a_seen = separation.turn_of(other, seam_direction(separation, bone, end, a));
        const double b_seen = separation.turn_of(other, seam_direction(separation, bone, end, b));
        EXPECT_LT(turn_distance(b_seen - a_seen, sigma * (b - a)), 1e-13);
      }
    }
  }
}

TEST(SeparationPlanes, AreFlatAtFreeEnds) {
  std::mt19937 random(5);
  const Skeleton skeleton = star_skeleton(test::spread_directions(4, kLeastAngle, random), random);
  const SeparationPlanes separation(skeleton);
  for (int bone = 0; bone < 4; ++bone) {
    const BoneEnd end = opposite(end_at_centre(skeleton, bone));
    EXPECT_TRUE(separation.is_free(bone, end));
    EXPECT_FALSE(separation.is_free(bone, opposite(end)));
    EXPECT_EQ(separation.slope(bone, end, 0.3), 0);
    EXPECT_EQ(separation.neighbour(bone, end, 0.3), -1);
  }
}

TEST(SeparationPlanes, FollowCoplanarAndCocircularDirections) {
  // Eight bones of a cross and a plane of four: every slope is finite, every cell's neighbour a bone of the star.
  std::mt19937 random(6);
  const std::vector<std::vector<Vec3>> stars{{{1, 0, 0}, {-1, 0, 0}, {0, 1, 0}, {0, -1, 0}, {0, 0, 1}, {0, 0, -1}},
                                             {{1, 0, 0}, {-1, 0, 0}, {0, 1, 0}, {0, -1, 0}},
                                             {{1, 0, 0}, {-1, 0, 0}}};
  for (const auto& directions : stars) {
    const Skeleton skeleton = star_skeleton(directions, random);
    const SeparationPlanes separation(skeleton);
    for (int bone = 0; bone < static_cast<int>(directions.size()); ++bone)
      for (int j = 0; j < 64; ++j) {
        const BoneEnd end = end_at_centre(skeleton, bone);
        const double k = separation.slope(bone, end, j / 64.0);
        EXPECT_LE(std::abs(k), std::sqrt(2.0) * (1 + 1e-9));
        EXPECT_NE(separation.neighbour(bone, end, j / 64.0), bone);
        const Vec3 point = separation.seam_point(bone, end, j / 64.0, 0.5);
        EXPECT_NEAR(separation.half_line_distance(bone, end, point), 0.5, 1e-13);
      }
  }
}

TEST(SeparationPlanes, WrapAnglesIntoOneTurn) {
  const Skeleton skeleton{{{"a", {0, 0, 0}}, {"b", {0, 0, 1}}}, {{"ab", 0, 1, Vec3(1, 0, 0)}}};
  const SeparationPlanes separation(skeleton);
  EXPECT_EQ(separation.turn_of(0, {1, 0, 0.3}), 0);
  EXPECT_EQ(separation.turn_of(0, {1, -1e-300, 0}), 0);
  EXPECT_EQ(separation.turn_of(0, {0, 1, 0}), 0.25);
  EXPECT_EQ(separation.turn_of(0, {0, -1, 0}), 0.75);
  EXPECT_EQ(separation.turn_of(0, {0, 0, 1}), 0);
  for (int i = -10; i < 20; ++i)
    EXPECT_LT(turn_distance(separation.turn_of(0, separation.radial(0, 0.1 * i)), 0.1 * i), 1e-15);
}

}  // namespace skeletex
