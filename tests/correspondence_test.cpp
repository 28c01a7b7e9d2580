// SPDX-License-Identifier: MIT
#include "skeletex/skeleton/correspondence.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <numeric>
#include <random>

#include "skeletex/io/skeleton_file.h"
#include "skeletex/model/error.h"

namespace skeletex {
namespace {

Skeleton standard(const std::string& name) {
  return read_skeleton(std::string(SKELETEX_SOURCE_DIR "/configs/skeletons/") + name + ".skeleton.json");
}

/// The same skeleton with other names, another order of nodes and bones, some bones reversed, rotated and scaled.
/// `bones[i]` is where bone i went.
Skeleton disguised(const Skeleton& skeleton, unsigned seed, std::vector<int>& bones, std::vector<bool>& reversed) {
  std::mt19937 random(seed);
  std::vector<int> nodes(skeleton.nodes.size());
  bones.resize(skeleton.bones.size());
  std::iota(nodes.begin(), nodes.end(), 0);
  std::iota(bones.begin(), bones.end(), 0);
  std::shuffle(nodes.begin(), nodes.end(), random);
  std::shuffle(bones.begin(), bones.end(), random);
  reversed.resize(bones.size());
  const Eigen::Quaterniond turn(Eigen::AngleAxisd(0.4, Vec3(1, 2, 3).normalized()));
  Skeleton result;
  result.nodes.resize(nodes.size());
  result.bones.resize(bones.size());
  for (std::size_t i = 0; i < nodes.size(); ++i)
    result.nodes[nodes[i]] = {"x" + std::to_string(nodes[i]), 3 * (turn * skeleton.nodes[i].position) + Vec3(1, 2, 3)};
  for (std::size_t i = 0; i < bones.size(); ++i) {
    reversed[i] = random() % 2;
    Bone bone{"y" + std::to_string(bones[i]), nodes[skeleton.bones[i].head], nodes[skeleton.bones[i].tail], {}};
    if (reversed[i]) std::swap(bone.head, bone.tail);
    result.bones[bones[i]] = bone;
  }
  return result;
}

void expect_isomorphism(const Skeleton& a, const Skeleton& b, const Correspondence& c) {
  std::vector<bool> taken(b.bones.size(), false);
  for (std::size_t i = 0; i < a.bones.size(); ++i) {
    ASSERT_GE(c.bones[i], 0);
    EXPECT_FALSE(taken[c.bones[i]]);
    taken[c.bones[i]] = true;
    const Bone& to = b.bones[c.bones[i]];
    EXPECT_EQ(c.nodes[a.bones[i].head], c.is_reversed[i] ? to.tail : to.head);
    EXPECT_EQ(c.nodes[a.bones[i].tail], c.is_reversed[i] ? to.head : to.tail);
  }
}

}  // namespace

TEST(Correspondence, FindsEveryStandardSkeletonBehindOtherNamesOrderAndDirections) {
  for (const char* name : {"armadillo", "bear", "bunny00_9", "camel", "cow", "triceratops_17", "knot1", "eight",
                           "eight_theta", "pinion_5"}) {
    const Skeleton skeleton = standard(name);
    std::vector<int> bones;
    std::vector<bool> reversed;
    const Skeleton other = disguised(skeleton, 11, bones, reversed);
    const Correspondence found = find_correspondence(skeleton, other);
    expect_isomorphism(skeleton, other, found);
    // A symmetric skeleton may fall onto itself in another way, at no higher cost; bones keep their lengths.
    for (std::size_t i = 0; i < bones.size(); ++i)
      EXPECT_NEAR(bone_length(other, found.bones[i]), 3 * bone_length(skeleton, static_cast<int>(i)),
                  0.03 * bone_length(other, found.bones[i]))
          << name;
  }
}

TEST(Correspondence, PairsTheModelsThatShareTheirNamesByName) {
  const std::pair<const char*, const char*> pairs[] = {
      {"bear", "bear_bis"},       {"man", "homer"},   {"bull", "camel"},  {"bull", "diplodocus"},
      {"bull", "triceratops_17"}, {"cow", "bull_16"}, {"cow", "camel_16"}};
  for (const auto& [first, second] : pairs) {
    const Skeleton a = standard(first), b = standard(second);
    const Correspondence found = find_correspondence(a, b);
    expect_isomorphism(a, b, found);
    for (std::size_t i = 0; i < a.bones.size(); ++i)
      EXPECT_EQ(a.bones[i].name, b.bones[found.bones[i]].name) << first << " " << second;
  }
}

TEST(Correspondence, PairsThemWithoutNamesToo) {
  for (const auto& [first, second] : {std::pair{"bear", "bear_bis"}, std::pair{"man", "homer"}}) {
    const Skeleton a = standard(first);
    Skeleton b = standard(second);
    std::vector<std::string> names;
    for (Bone& bone : b.bones) names.push_back(std::exchange(bone.name, "_" + bone.name));
    const Correspondence found = find_correspondence(a, b);
    for (std::size_t i = 0; i < a.bones.size(); ++i)
      EXPECT_EQ(a.bones[i].name, names[found.bones[i]]) << first << " " << second;
  }
}

TEST(Correspondence, OfAStarOfManyBonesIsFoundAmongAllPermutations) {
  constexpr int kBones = 14;
  Skeleton star;
  star.nodes.push_back({"hub", Vec3::Zero()});
  for (int i = 0; i < kBones; ++i) {  // spread over the sphere along a spiral
    const double z = 1 - (2 * i + 1.0) / kBones, angle = 2.4 * i, r = std::sqrt(1 - z * z);
    star.nodes.push_back(
        {"tip_" + std::to_string(i), (1 + 0.05 * i) * Vec3(r * std::cos(angle), r * std::sin(angle), z)});
    star.bones.push_back({"arm_" + std::to_string(i), 0, i + 1, {}});
  }
  std::vector<int> bones;
  std::vector<bool> reversed;
  const Skeleton other = disguised(star, 3, bones, reversed);
  const Correspondence found = find_correspondence(star, other);
  expect_isomorphism(star, other, found);
  EXPECT_EQ(found.bones, std::vector<BoneIndex>(bones.begin(), bones.end()));
}

TEST(Correspondence, ObeysTheUsersPairs) {
  const Skeleton eight = standard("eight");
  const Correspondence found = find_correspondence(eight, eight, {{{"left_outer", "right_outer"}}});
  expect_isomorphism(eight, eight, found);
  for (std::size_t i = 0; i < eight.bones.size(); ++i)
    if (eight.bones[i].name == "left_outer") {
      EXPECT_EQ(eight.bones[found.bones[i]].name, "right_outer");
    }
}

TEST(Correspondence, RefusesPairsThatCannotHold) {
  const Skeleton bear = standard("bear");
  const std::string leaf = bear.bones.back().name, inner = bear.bones.front().name;
  EXPECT_THROW(find_correspondence(bear, bear, {{{inner, leaf}}}), InputError);
  EXPECT_THROW(find_correspondence(bear, bear, {{{"no such bone", leaf}}}), InputError);
}

TEST(Correspondence, NamesTheNodeWhereTheBranchingDiffers) {
  const Skeleton a = standard("bear");
  Skeleton b = a;
  const int node = b.bones[0].tail;
  b.nodes.push_back({"extra", b.nodes[node].position + Vec3(0.1, 0.2, 0.3)});
  b.bones.push_back({"extra_bone", node, static_cast<int>(b.nodes.size()) - 1, {}});
  try {
    find_correspondence(a, b);
    FAIL();
  } catch (const InputError& error) {
    EXPECT_NE(std::string(error.what()).find(a.nodes[node].name), std::string::npos) << error.what();
  }
}

TEST(Correspondence, NeighbourIntervalsFillATurn) {
  for (const char* name : {"armadillo", "bear", "eight"}) {
    const Skeleton skeleton = standard(name);
    for (int bone = 0; bone < static_cast<int>(skeleton.bones.size()); ++bone)
      for (const BoneEnd end : {BoneEnd::kHead, BoneEnd::kTail}) {
        const auto order = neighbour_order(skeleton, {bone, end});
        double turns = 0;
        for (const NeighbourInterval& interval : order) turns += interval.turns;
        if (!order.empty()) {
          EXPECT_NEAR(turns, 1, 1e-12);
        }
      }
  }
}

}  // namespace skeletex
