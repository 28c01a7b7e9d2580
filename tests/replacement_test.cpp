// SPDX-License-Identifier: MIT
#include "skeletex/skeletonize/replacement.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "skeletex/analysis/bone_margin.h"
#include "skeletex/analysis/findings.h"
#include "skeletex/analysis/validate_input.h"
#include "skeletex/skeletonize/limbs.h"
#include "skeletex/skeletonize/repair_skeleton.h"
#include "support/load_model.h"

namespace skeletex {
namespace {

/// A skeleton as rigs have it: the spine runs along the back, and short bones lead to hips and shoulders.
Skeleton rig_of_cow() {
  Skeleton rig;
  std::map<std::string, int> number;
  const auto add_node = [&](const std::string& name, const Vec3& position) {
    number[name] = static_cast<int>(rig.nodes.size());
    rig.nodes.push_back({name, position});
  };
  const auto add_chain = [&](const std::vector<std::string>& names) {
    for (std::size_t i = 1; i < names.size(); ++i)
      rig.bones.push_back({names[i - 1] + "_to_" + names[i], number.at(names[i - 1]), number.at(names[i]), {}});
  };
  add_node("pelvis", {-0.33, 0.18, 0});
  add_node("spine", {-0.15, 0.18, 0});
  add_node("withers", {0.02, 0.18, 0});
  add_node("chest", {0.12, 0.16, 0});
  add_node("neck", {0.2, 0.16, 0});
  add_node("head", {0.32, 0.2, 0});
  add_node("nose", {0.44, 0.16, 0});
  add_node("belly", {-0.1, -0.05, 0});
  add_chain({"pelvis", "spine", "withers", "chest", "neck", "head", "nose"});
  add_chain({"spine", "belly"});
  for (const std::string side : {"left_", "right_"}) {
    const bool is_left = side == "left_";
    const double z = is_left ? -1 : 1;
    add_node(side + "hip", is_left ? Vec3(-0.33, 0.15, -0.06) : Vec3(-0.33, 0.13, 0.06));
    add_node(side + "stifle", {-0.35, -0.13, 0.08 * z});
    add_node(side + "hock", {-0.38, -0.2, 0.09 * z});
    add_node(side + "foot", {-0.36, -0.27, 0.1 * z});
    add_node(side + "shoulder", is_left ? Vec3(0.1, 0.1, -0.04) : Vec3(0.1, 0.14, 0.05));
    add_node(side + "elbow", {0.1, -0.14, 0.08 * z});
    add_node(side + "knee", {0.1, -0.2, 0.08 * z});
    add_node(side + "hand", {0.12, -0.27, 0.09 * z});
    add_chain({"pelvis", side + "hip", side + "stifle", side + "hock", side + "foot"});
    add_chain({"chest", side + "shoulder", side + "elbow", side + "knee", side + "hand"});
  }
  return rig;
}

}  // namespace

TEST(Replacement, TheShareThatIsFollowedLacksALostLimb) {
  const TestModel cow = load_standard_model("cow");
  const TriangleTree tree = build_triangle_tree(cow.mesh);
  const Surface surface(cow.mesh, tree);
  EXPECT_DOUBLE_EQ(followed_share(surface, cow.skeleton, cow.skeleton), 1);
  Skeleton three_legged = cow.skeleton;
  std::set<int> gone;
  double lost = 0, all = 0;
  for (int b = 0; b < static_cast<int>(cow.skeleton.bones.size()); ++b) {
    const double length = bone_length(cow.skeleton, b);
    all += length;
    const std::string& name = cow.skeleton.bones[b].name;
    if (!name.starts_with("left_") || name.find("fore") == std::string::npos) continue;
    gone.insert(b);
    lost += length;
  }
  ASSERT_EQ(gone.size(), 3U);
  drop_bones(gone, three_legged);
  const double followed = followed_share(surface, cow.skeleton, three_legged);
  EXPECT_LT(followed, 1 - 0.3 * lost / all);  // the first part of the leg lies in the body
  EXPECT_GT(followed, 1 - lost / all);
  EXPECT_DOUBLE_EQ(followed_share(surface, three_legged, cow.skeleton), 1);
}

TEST(Replacement, ARigWhoseRepairWouldLoseLimbsKeepsThemAll) {
  ClContext context;
  TestModel cow = load_standard_model("cow");
  const TriangleTree tree = build_triangle_tree(cow.mesh);
  const Skeleton rig = rig_of_cow();
  const RepairResult repaired = repair_skeleton(context, cow.mesh, tree, rig);
  ASSERT_FALSE(repaired.changes.empty());
  EXPECT_NE(repaired.changes[0].find("limbs would be lost"), std::string::npos) << repaired.changes[0];
  for (const Finding& f : validate_input(context, cow.mesh, repaired.skeleton))
    EXPECT_NE(f.severity, Severity::kError) << f.message;
  EXPECT_GT(followed_share(Surface(cow.mesh, tree), rig, repaired.skeleton), 0.95);
  EXPECT_LE(find_limbs(repaired.skeleton).size(), find_limbs(rig).size() + 2);  // the horns, but not the ears
  EXPECT_LE(repaired.skeleton.bones.size(), rig.bones.size() + 7);              // no bends that the rig does not have
  std::map<std::string, Vec3> places;
  for (const Node& node : repaired.skeleton.nodes) places[node.name] = node.position;
  const double diagonal = bounding_box(cow.mesh).diagonal();
  for (const std::string name : {"nose", "left_foot", "right_foot", "left_hand", "right_hand"}) {
    ASSERT_TRUE(places.contains(name)) << name;
    const auto node = std::find_if(rig.nodes.begin(), rig.nodes.end(), [&](const Node& n) { return n.name == name; });
    EXPECT_LT((places[name] - node->position).norm(), 0.05 * diagonal) << name;
  }
  std::set<std::string> bones;
  for (const Bone& bone : repaired.skeleton.bones) EXPECT_TRUE(bones.insert(bone.name).second) << bone.name;
  for (const std::string name : {"left_hock_to_left_foot", "right_knee_to_right_hand"})
    EXPECT_TRUE(bones.contains(name));
}

TEST(Replacement, ALegThatTheRigLacksStays) {
  const TestModel cow = load_standard_model("cow");
  const TriangleTree tree = build_triangle_tree(cow.mesh);
  const Surface surface(cow.mesh, tree);
  Skeleton rig = cow.skeleton;
  std::set<int> leg;
  for (int b = 0; b < static_cast<int>(rig.bones.size()); ++b)
    if (rig.bones[b].name.starts_with("left_") && rig.bones[b].name.find("fore") == std::string::npos) leg.insert(b);
  drop_bones(leg, rig);
  const Skeleton kept = with_nodes_of(surface, cow.skeleton, rig, rig).skeleton();
  std::set<std::string> names;
  for (const Node& node : kept.nodes) names.insert(node.name);
  for (const Node& node : rig.nodes) EXPECT_TRUE(names.contains(node.name)) << node.name;
  EXPECT_EQ(find_limbs(kept).size(), find_limbs(cow.skeleton).size());
  EXPECT_DOUBLE_EQ(followed_share(surface, cow.skeleton, kept), 1);
}

TEST(Replacement, BonesHaveTheNamesAndDirectionsOfTheWantedOnes) {
  Skeleton wanted;
  wanted.nodes = {{"root", {0, 0, 0}}, {"middle", {1, 0, 0}}, {"end", {2, 0, 0}}};
  wanted.bones = {{"first", 0, 1, {}}, {"second", 1, 2, {}}};
  Skeleton skeleton;
  skeleton.nodes = {{"end", {2, 0.1, 0}}, {"bend", {1.6, 0, 0}}, {"middle", {1, 0, 0}}, {"root", {0, 0.1, 0}}};
  skeleton.bones = {{"", 0, 1, {}}, {"", 1, 2, {}}, {"", 2, 3, {}}};
  take_bone_names(wanted, skeleton);
  EXPECT_EQ(skeleton.bones[2].name, "first");
  EXPECT_EQ(skeleton.bones[0].name, "second");
  EXPECT_EQ(skeleton.bones[1].name, "second_part");
  const std::vector<std::pair<int, int>> expected{{1, 0}, {2, 1}, {3, 2}};
  for (std::size_t b = 0; b < 3; ++b)
    EXPECT_EQ((std::pair<int, int>(skeleton.bones[b].head, skeleton.bones[b].tail)), expected[b]);
}

TEST(Replacement, NodesComeAndGoWhereMarginsStayEnough) {
  const TestModel cow = load_standard_model("cow");
  const TriangleTree tree = build_triangle_tree(cow.mesh);
  const Surface surface(cow.mesh, tree);
  Repair repair(surface, cow.skeleton);
  const std::size_t bones = cow.skeleton.bones.size();
  const Vec3 middle =
      0.5 * (end_position(cow.skeleton, 0, BoneEnd::kHead) + end_position(cow.skeleton, 0, BoneEnd::kTail));
  ASSERT_TRUE(repair.split(0, middle, "new"));
  ASSERT_EQ(repair.skeleton().bones.size(), bones + 1);
  EXPECT_EQ(repair.skeleton().nodes.back().name, "new");
  for (const BoneMargin& margin : repair.margins()) EXPECT_GE(margin.margin, kEnoughMargin);
  const Vec3& pelvis = cow.skeleton.nodes[0].position;
  EXPECT_FALSE(repair.split(0, pelvis + 0.01 * (middle - pelvis), "too near"));
  EXPECT_FALSE(repair.straighten(0));  // a hub
  ASSERT_TRUE(repair.straighten(static_cast<int>(repair.skeleton().nodes.size()) - 1));
  EXPECT_EQ(repair.skeleton().bones.size(), bones);
  EXPECT_EQ(repair.skeleton().nodes.size(), cow.skeleton.nodes.size());
}

}  // namespace skeletex
