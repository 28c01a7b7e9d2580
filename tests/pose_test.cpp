// SPDX-License-Identifier: MIT
#include "skeletex/model/pose.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <numbers>
#include <random>

#include "skeletex/io/pose_file.h"
#include "skeletex/model/error.h"
#include "skeletex/model/posed_frame.h"
#include "support/synthetic_model.h"

namespace skeletex {
namespace {

constexpr double kPi = std::numbers::pi;

struct NamedSkeleton {
  const char* name;
  Skeleton skeleton;
  double radius;
};

std::vector<NamedSkeleton> all_skeletons() {
  return {{"lone bone", lone_bone(), 0.3},   {"chain of two", chain(2), 0.2},           {"chain of five", chain(5), 0.2}, {"Y", y_branch(), 0.25},
          {"cross of 4", cross(4), 0.3},     {"cross of 6", cross(6), 0.3},             {"cross of 11", cross(11), 0.3},  {"ring of 3", ring(3), 0.2},
          {"ring of 7", ring(7), 0.2},       {"ring with an arm", ring_with_arm(6), 0.2}, {"tree of 12", random_tree(12, 3), 0.15}};
}

bool is_tree(const Skeleton& skeleton) { return skeleton.nodes.size() == skeleton.bones.size() + 1; }

Eigen::Quaterniond random_rotation(std::mt19937& random, double largest) {
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> angle(0, largest);
  const Vec3 axis(normal(random), normal(random), normal(random));
  return Eigen::Quaterniond(Eigen::AngleAxisd(angle(random), axis.normalized()));
}

/// Every joint turned by up to `largest` radians; cyclic skeletons: nodes moved by up to a third of that, in bones.
Pose random_pose(const Skeleton& skeleton, double largest, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> unit(-1, 1);
  Pose pose;
  if (is_tree(skeleton)) {
    for (std::size_t i = 0; i < skeleton.bones.size(); ++i) pose.rotations.push_back(random_rotation(random, largest));
  } else {
    double shortest = 1e9;
    for (int i = 0; i < static_cast<int>(skeleton.bones.size()); ++i) shortest = std::min(shortest, bone_length(skeleton, i));
    for (const Node& node : skeleton.nodes) pose.nodes.push_back(node.position + largest / 3 * shortest * Vec3(unit(random), unit(random), unit(random)));
  }
  for (std::size_t i = 0; i < skeleton.bones.size(); ++i) pose.rolls.push_back(0.3 * unit(random));
  return pose;
}

SkeletexModel model_of(const SyntheticSurface& surface, int width = 24, int height = 9) {
  return surface.model(std::vector<std::pair<int, int>>(surface.skeleton().bones.size(), {width, height}));
}

Vec3 texel_of(const SkeletexModel& model, int bone, int row, int column) {
  const Rectangle& r = model.patches[bone].rectangle;
  const std::size_t at = static_cast<std::size_t>(r.y + row) * model.texture.width + r.x + column;
  return Vec3(model.texture.along[at], model.texture.around[at], model.texture.out[at]);
}

/// All points of a model in a pose: texels of every row, then samples, then corners.
std::vector<Vec3> all_points(const SkeletexModel& model, const Skeleton& posed, DistanceRule rule = DistanceRule::kFromBone) {
  const Walls bind(model.skeleton);
  const PosedWalls walls(model, posed);
  std::vector<Vec3> points;
  for (int bone = 0; bone < static_cast<int>(model.patches.size()); ++bone)
    for (int r = 0; r < model.patches[bone].rectangle.height; ++r)
      for (int j = 0; j < model.patches[bone].rectangle.width; ++j)
        points.push_back(posed_point(model, bind, walls, bone, model.patches[bone].row_u[r], static_cast<double>(j) / model.patches[bone].rectangle.width,
                                     texel_of(model, bone, r, j), rule));
  for (int a = 0; a < static_cast<int>(model.arcs.size()); ++a)
    for (int i = 0; i < static_cast<int>(model.arcs[a].samples.size()); ++i) points.push_back(walls.sample_point(a, i, rule));
  for (int c = 0; c < static_cast<int>(model.corners.size()); ++c) points.push_back(walls.corner_point(c, rule));
  return points;
}

double largest_difference(const std::vector<Vec3>& a, const std::vector<Vec3>& b) {
  double worst = a.size() == b.size() ? 0 : 1e9;
  for (std::size_t i = 0; i < std::min(a.size(), b.size()); ++i) worst = std::max(worst, (a[i] - b[i]).norm());
  return worst;
}

std::string message_of(const nlohmann::json& json, const Skeleton& skeleton) {
  try {
    animation_from_json(json, skeleton, "pose");
  } catch (const Error& error) {
    return error.what();
  }
  return "accepted";
}

}  // namespace

TEST(Pose, BindPoseLeavesEveryPointWhereItWas) {
  for (const NamedSkeleton& named : all_skeletons()) {
    const SyntheticSurface surface(named.skeleton, named.radius);
    const SkeletexModel model = model_of(surface);
    Pose pose;
    for (const Node& node : model.skeleton.nodes) pose.nodes.push_back(node.position);
    for (const Pose& bound : {Pose{}, pose}) {
      const Skeleton posed = apply_pose(model.skeleton, bound);
      for (const DistanceRule rule : {DistanceRule::kFromBone, DistanceRule::kFromFoot}) {
        const std::vector<Vec3> points = all_points(model, posed, rule);
        std::size_t next = 0;
        double worst = 0;
        for (int bone = 0; bone < static_cast<int>(model.patches.size()); ++bone)
          for (int r = 0; r < model.patches[bone].rectangle.height; ++r)
            for (int j = 0; j < model.patches[bone].rectangle.width; ++j)
              worst = std::max(worst, (points[next++] - surface.point(bone, model.patches[bone].row_u[r], static_cast<double>(j) / model.patches[bone].rectangle.width)).norm());
        for (const SeamArc& arc : model.arcs)
          for (const SeamSample& sample : arc.samples)
            worst = std::max(worst, (points[next++] - surface.walls().seam_point(arc.bones[0], model.skeleton.bones[arc.bones[0]].head == arc.node ? BoneEnd::kHead : BoneEnd::kTail,
                                                                                   sample.turn, sample.distance)).norm());
        for (const SeamCorner& corner : model.corners)
          worst = std::max(worst, (points[next++] - surface.walls().seam_point(corner.bones[0], model.skeleton.bones[corner.bones[0]].head == corner.node ? BoneEnd::kHead : BoneEnd::kTail,
                                                                                corner.sample.turn, corner.sample.distance)).norm());
        EXPECT_LT(worst, 1e-6 * model.diagonal) << named.name;
      }
    }
  }
}

TEST(Pose, ARigidMotionOfTheNodesMovesEveryPointWithThem) {
  for (const NamedSkeleton& named : all_skeletons()) {
    if (named.skeleton.bones.size() == 1) continue;  // nodes on a line do not say how it turned about itself
    const SyntheticSurface surface(named.skeleton, named.radius);
    const SkeletexModel model = model_of(surface, 12, 6);
    std::mt19937 random(7);
    for (int i = 0; i < 8; ++i) {
      const Eigen::Quaterniond rotation = random_rotation(random, kPi);
      const Vec3 shift(0.3 * i, -2, 1);
      for (const double bend : {0.0, 0.8}) {  // of the bind pose, and of a pose
        const Skeleton start = apply_pose(model.skeleton, bend > 0 ? random_pose(model.skeleton, bend, 50 + i) : Pose{});
        Pose pose, moved;
        for (const Node& node : start.nodes) {
          pose.nodes.push_back(node.position);
          moved.nodes.push_back(rotation * node.position + shift);
        }
        std::vector<Vec3> expected = all_points(model, apply_pose(model.skeleton, pose));
        for (Vec3& p : expected) p = rotation * p + shift;
        EXPECT_LT(largest_difference(all_points(model, apply_pose(model.skeleton, moved)), expected), 1e-9) << named.name << " " << i << " bend " << bend;
      }
    }
  }
}

TEST(Pose, ARotationOfAllBonesAtTheRootIsARigidMotion) {
  for (const NamedSkeleton& named : all_skeletons()) {
    if (!is_tree(named.skeleton)) continue;
    const SyntheticSurface surface(named.skeleton, named.radius);
    const SkeletexModel model = model_of(surface, 12, 6);
    std::mt19937 random(8);
    const int root = root_nodes(model.skeleton)[0];
    const Eigen::Quaterniond rotation = random_rotation(random, kPi);
    Pose pose;
    pose.rotations.assign(model.skeleton.bones.size(), Eigen::Quaterniond::Identity());
    const auto at = bones_at_nodes(model.skeleton);
    for (const BoneAtNode bone : at[root]) pose.rotations[bone.bone] = rotation;
    std::vector<Vec3> expected = all_points(model, apply_pose(model.skeleton, Pose{}));
    const Vec3 pivot = model.skeleton.nodes[root].position;
    for (Vec3& p : expected) p = pivot + rotation * (p - pivot);
    EXPECT_LT(largest_difference(all_points(model, apply_pose(model.skeleton, pose)), expected), 1e-9) << named.name;
  }
}

TEST(Pose, BothSidesOfEverySeamAgree) {
  for (const NamedSkeleton& named : all_skeletons()) {
    const SyntheticSurface surface(named.skeleton, named.radius);
    const SkeletexModel model = model_of(surface, 40, 5);
    double worst = 0, worst_row = 0, worst_corner = 0;
    for (unsigned seed = 0; seed < 200; ++seed) {
      const Skeleton posed = apply_pose(model.skeleton, random_pose(model.skeleton, kPi / 3, seed));
      const Walls bind(model.skeleton);
      const PosedWalls walls(model, posed);
      for (const DistanceRule rule : {DistanceRule::kFromBone, DistanceRule::kFromFoot}) {
        for (int a = 0; a < static_cast<int>(model.arcs.size()); ++a)
          for (int i = 0; i < static_cast<int>(model.arcs[a].samples.size()); ++i) {
            const Vec3 p = walls.sample_point(a, i, rule, 0);
            ASSERT_TRUE(p.allFinite()) << named.name << " seed " << seed;
            worst = std::max(worst, (p - walls.sample_point(a, i, rule, 1)).norm());
            // The texel that the bone itself would have there: the rows run into the seam.
            const SeamArc& arc = model.arcs[a];
            for (const int side : {0, 1}) {
              const int bone = arc.bones[side];
              const BoneEnd end = model.skeleton.bones[bone].head == arc.node ? BoneEnd::kHead : BoneEnd::kTail;
              const Vec3 bound = bind.seam_point(arc.bones[0], model.skeleton.bones[arc.bones[0]].head == arc.node ? BoneEnd::kHead : BoneEnd::kTail,
                                                 arc.samples[i].turn, arc.samples[i].distance);
              const double turn = bind.turn_of(bone, bound - model.skeleton.nodes[arc.node].position), u = end == BoneEnd::kHead ? 0 : 1;
              const Vec3 texel = encode_texel(tangent_frame(model.skeleton, bind, bone, u, turn), bound, end_position(model.skeleton, bone, BoneEnd::kHead),
                                              end_position(model.skeleton, bone, BoneEnd::kTail));
              worst_row = std::max(worst_row, (posed_point(model, bind, walls, bone, u, turn, texel, rule) - p).norm());
            }
          }
        // Along every arc the points run on to its corners.
        for (int c = 0; c < static_cast<int>(model.corners.size()); ++c) ASSERT_TRUE(walls.corner_point(c, rule).allFinite());
      }
    }
    EXPECT_LT(worst, 1e-9) << named.name;
    EXPECT_LT(worst_row, 1e-6) << named.name;
    (void)worst_corner;
  }
}

TEST(Pose, DistancesToTheBonesAreKept) {
  for (const NamedSkeleton& named : all_skeletons()) {
    const SyntheticSurface surface(named.skeleton, named.radius);
    const SkeletexModel model = model_of(surface, 16, 17);
    double worst = 0;
    int kept = 0, all = 0;
    for (unsigned seed = 0; seed < 40; ++seed) {
      const Skeleton posed = apply_pose(model.skeleton, random_pose(model.skeleton, kPi / 3, seed));
      const Walls bind(model.skeleton);
      const PosedWalls walls(model, posed);
      for (int bone = 0; bone < static_cast<int>(model.patches.size()); ++bone)
        for (int r = 0; r < 17; ++r)
          for (int j = 0; j < 16; ++j) {
            const double u = model.patches[bone].row_u[r];
            const Vec3 texel = texel_of(model, bone, r, j);
            const Vec3 p = posed_point(model, bind, walls, bone, u, j / 16.0, texel, DistanceRule::kFromBone);
            ASSERT_TRUE(p.allFinite());
            const double error = std::abs(distance_to_bone(p, end_position(posed, bone, BoneEnd::kHead), end_position(posed, bone, BoneEnd::kTail)) - texel.norm());
            const Station at = station_of(u, bind.is_free(bone, BoneEnd::kHead), bind.is_free(bone, BoneEnd::kTail));
            ++all;
            if ((at.station < 0.25 && !bind.is_free(bone, BoneEnd::kHead)) || (at.station > 0.75 && !bind.is_free(bone, BoneEnd::kTail))) continue;
            ++kept;
            worst = std::max(worst, error);
          }
    }
    EXPECT_LT(worst, 1e-6) << named.name << " " << kept << " of " << all;
  }
}

TEST(PoseFile, RejectsWhatItDoesNotKnowWithTheNearestName) {
  const Skeleton skeleton = y_branch();
  const auto has = [&](const char* text, const char* part) {
    const std::string message = message_of(nlohmann::json::parse(text), skeleton);
    EXPECT_NE(message.find(part), std::string::npos) << text << " -> " << message;
  };
  has(R"({"rotations":{"bone1":{"axis":[0,0,1],"degrees":30}}})", "accepted");
  has(R"({"rotation":{}})", "did you mean \"rotations\"");
  has(R"({"rotations":{"bon1":{"axis":[0,0,1],"degrees":30}}})", "did you mean \"bone1\"");
  has(R"({"nodes":{"center":[0,0,0]}})", "did you mean \"centre\"");
  has(R"({"roll":{"bne2":3}})", "did you mean \"bone2\"");
  has(R"({"rotations":{"bone1":{"axis":[0,0,1],"degree":30}}})", "did you mean \"degrees\"");
  has(R"({"rotations":{"bone1":{"axis":[0,0,0],"degrees":30}}})", "zero vector");
  has(R"({"rotations":{"bone1":{"axis":[0,0,1]}}})", "\"degrees\" is missing");
  has(R"({"rotations":{"bone1":{"quaternion":[0,0,0,0]}}})", "no length");
  has(R"({"rotations":{"bone1":{"quaternion":[0,0,0,1],"degrees":3}}})", "either");
  has(R"({"rotations":{},"nodes":{}})", "do not go together");
  has(R"({"nodes":{"centre":[0,0]}})", "three numbers");
  has(R"({"frames":[]})", "empty");
  has(R"({"frames":[{"time":0,"pose":{}},{"time":0,"pose":{}}]})", "times must grow");
  has(R"({"frames":[{"time":0,"pos":{}}]})", "did you mean \"pose\"");
  has(R"([])", "object");
}

}  // namespace skeletex
