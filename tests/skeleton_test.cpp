// SPDX-License-Identifier: MIT
#include "skeletex/skeleton/skeleton.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <string>
#include <type_traits>

#include "skeletex/model/error.h"
#include "support/random_skeleton.h"

namespace skeletex {
namespace {

using test::random_tree;
using test::star_skeleton;

Skeleton single_bone(const Vec3& head, const Vec3& tail, std::optional<Vec3> s = {}) {
  return {{{"a", head}, {"b", tail}}, {{"bone", 0, 1, s}}};
}

Vec3 radial_of(const BoneBasis& basis, double turn) {
  return std::cos(2 * M_PI * turn) * basis.s + std::sin(2 * M_PI * turn) * basis.b;
}

}  // namespace

template <class One, class Other>
concept IsComparable = requires(One one, Other other) {
  one == other;
};

TEST(Skeleton, AnIndexOfOneKindIsNoneOfAnother) {
  static_assert(!std::is_convertible_v<BoneIndex, NodeIndex> && !std::is_constructible_v<NodeIndex, BoneIndex>);
  static_assert(!IsComparable<BoneIndex, NodeIndex> && IsComparable<BoneIndex, BoneIndex> &&
                IsComparable<BoneIndex, int>);
  static_assert(std::is_convertible_v<int, BoneIndex> && std::is_convertible_v<BoneIndex, int>);
  const nlohmann::json entry = {{"bone", BoneIndex(3)}, {"nodes", std::vector<NodeIndex>{1, NodeIndex()}}};
  EXPECT_EQ(entry.dump(), R"({"bone":3,"nodes":[1,-1]})");
}

TEST(Skeleton, BasesAreOrthonormalAndRightHanded) {
  std::mt19937 random(1);
  for (int trial = 0; trial < 50; ++trial) {
    const Skeleton skeleton = random_tree(20, random);
    const auto bases = bone_bases(skeleton);
    for (std::size_t i = 0; i < bases.size(); ++i) {
      const auto& [o, s, b] = bases[i];
      Eigen::Matrix3d m;
      m << o, s, b;
      EXPECT_LT((m.transpose() * m - Eigen::Matrix3d::Identity()).norm(), 1e-14);
      EXPECT_NEAR(m.determinant(), 1, 1e-14);
      EXPECT_LT((o - direction_from(skeleton, {static_cast<int>(i), BoneEnd::kHead})).norm(), 1e-15);
    }
  }
}

TEST(Skeleton, NothingTwistsAtANodeOfTwoBones) {
  // A point of the separation plane at v about the one bone lies at v about the other, or at -v where both have the
  // same end there.
  std::mt19937 random(2);
  for (int trial = 0; trial < 400; ++trial) {
    const Skeleton skeleton = star_skeleton(test::spread_directions(2, 0.2, random), random);
    const auto bases = bone_bases(skeleton);
    const auto at = bones_at_nodes(skeleton)[0];
    const Vec3 normal = direction_from(skeleton, at[0]) - direction_from(skeleton, at[1]);
    const double sigma = at[0].end == at[1].end ? -1 : 1;
    for (const double turn : {0.0, 0.1, 0.35, 0.77}) {
      const Vec3 radial = radial_of(bases[0], turn);
      const Vec3 f = radial - radial.dot(normal) / bases[0].o.dot(normal) * bases[0].o;
      const double other = std::atan2(f.dot(bases[1].b), f.dot(bases[1].s)) / (2 * M_PI);
      // Angles in the separation plane are conditioned by the separation plane's tilt, 1 / sin(half the angle between
      // the bones).
      EXPECT_LT(test::turn_distance(other, sigma * turn), 1e-13);
    }
  }
}

TEST(Skeleton, CarriesBasesOverStraightNodesUnchanged) {
  for (const bool turned : {false, true}) {
    Skeleton skeleton{{{"a", {0, 0, 0}}, {"b", {1, 2, 3}}, {"c", {2, 4, 6}}}, {{"ab", 0, 1, {}}, {"bc", 1, 2, {}}}};
    if (turned) std::swap(skeleton.bones[1].head, skeleton.bones[1].tail);
    const auto bases = bone_bases(skeleton);
    EXPECT_LT((bases[0].s - bases[1].s).norm(), 1e-15) << (turned ? "tail to tail" : "tail to head");
  }
}

TEST(Skeleton, StraightNodesAreNoSpecialCase) {
  // Almost straight and exactly straight give almost the same basis, whichever ends meet.
  for (const bool turned : {false, true})
    for (const Vec3& bend : {Vec3(1e-7, 0, 0), Vec3(0, 1e-7, 0), Vec3(-1e-7, 1e-7, 0)}) {
      Skeleton skeleton{{{"a", {0, 0, 0}}, {"b", {0, 0, 1}}, {"c", {0, 0, 2}}}, {{"ab", 0, 1, {}}, {"bc", 1, 2, {}}}};
      if (turned) std::swap(skeleton.bones[1].head, skeleton.bones[1].tail);
      const Vec3 straight = bone_bases(skeleton)[1].s;
      skeleton.nodes[2].position += bend;
      EXPECT_LT((bone_bases(skeleton)[1].s - straight).norm(), 1e-6);
    }
}

TEST(Skeleton, KeepsAGivenDirectionAndCarriesItOn) {
  Skeleton skeleton{{{"a", {0, 0, 0}}, {"b", {1, 0, 0}}, {"c", {1, 1, 0}}},
                    {{"ab", 0, 1, Vec3(5, 0, 2)}, {"bc", 1, 2, {}}}};
  auto bases = bone_bases(skeleton);
  EXPECT_LT((bases[0].s - Vec3(0, 0, 1)).norm(), 1e-15);
  EXPECT_LT((bases[1].s - Vec3(0, 0, 1)).norm(), 1e-15);
  skeleton.bones[0].s.reset();
  skeleton.bones[1].s = Vec3(-3, 0, 0);
  bases = bone_bases(skeleton);
  EXPECT_LT((bases[1].s - Vec3(-1, 0, 0)).norm(), 1e-15);
  EXPECT_LT((bases[0].s - Vec3(0, 1, 0)).norm(), 1e-15) << "carried against the bone's direction, from a later bone";
}

TEST(Skeleton, BasesFollowARotationWhenOneDirectionIsGiven) {
  std::mt19937 random(3);
  for (int trial = 0; trial < 50; ++trial) {
    Skeleton skeleton = random_tree(12, random);
    skeleton.bones[5].s = test::random_direction(random);
    const auto before = bone_bases(skeleton);
    const Eigen::Quaterniond q(Eigen::AngleAxisd(test::random_between(random, 0, 6), test::random_direction(random)));
    for (Node& node : skeleton.nodes) node.position = q * node.position + Vec3(1, -2, 3);
    skeleton.bones[5].s = q * *skeleton.bones[5].s;
    const auto after = bone_bases(skeleton);
    for (std::size_t i = 0; i < before.size(); ++i) EXPECT_LT((q * before[i].s - after[i].s).norm(), 1e-12);
  }
}

TEST(Skeleton, CyclesAndSeveralComponentsGetBases) {
  const Skeleton skeleton{{{"a", {0, 0, 0}}, {"b", {1, 0, 0}}, {"c", {0, 1, 0}}, {"d", {5, 5, 5}}, {"e", {5, 5, 6}}},
                          {{"ab", 0, 1, {}}, {"bc", 1, 2, {}}, {"ca", 2, 0, {}}, {"de", 3, 4, {}}}};
  for (const BoneBasis& basis : bone_bases(skeleton)) {
    EXPECT_NEAR(basis.s.norm(), 1, 1e-15);
    EXPECT_NEAR(basis.s.dot(basis.o), 0, 1e-15);
  }
}

TEST(Skeleton, NamesABoneWithoutLengthOrWithAParallelDirection) {
  const auto message = [](const Skeleton& skeleton) -> std::string {
    try {
      bone_bases(skeleton);
    } catch (const InputError& error) {
      return error.what();
    }
    return "";
  };
  EXPECT_NE(message(single_bone({1, 2, 3}, {1, 2, 3})).find("\"bone\" has no length"), std::string::npos);
  EXPECT_NE(message(single_bone({0, 0, 0}, {0, 0, 1}, Vec3(0, 0, -2))).find("\"bone\": its \"s\" is parallel"),
            std::string::npos);
  EXPECT_NE(message(single_bone({0, 0, 0}, {0, 0, 1}, Vec3(0, 0, 0))), "");
  EXPECT_NE(message(single_bone({0, 0, 0}, {0, 0, std::nan("")})), "");
}

TEST(Skeleton, MeasuresTheDistanceToABoneAsThatToItsNearestPoint) {
  std::mt19937 random(4);
  for (int trial = 0; trial < 200; ++trial) {
    const Vec3 head = test::random_direction(random), tail = 2 * test::random_direction(random),
               point = 3 * test::random_direction(random);
    double least = 1e9;
    for (int i = 0; i <= 2000; ++i) least = std::min(least, (head + i / 2000.0 * (tail - head) - point).norm());
    EXPECT_LE(distance_to_bone(point, head, tail), least + 1e-15);
    EXPECT_GE(distance_to_bone(point, head, tail), least - 1e-6);
  }
}

}  // namespace skeletex
