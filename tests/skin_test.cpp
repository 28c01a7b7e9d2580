// SPDX-License-Identifier: MIT
#include "skeletex/reconstruct/pose/skin.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <random>

#include "skeletex/analysis/manifold.h"
#include "skeletex/convert/resample/resample.h"
#include "skeletex/reconstruct/pose/pose_mesh.h"
#include "skeletex/reconstruct/pose/weight_walk.h"
#include "skeletex/reconstruct/reconstruct_mesh.h"
#include "skeletex/skeleton/pose.h"
#include "skeletex/skeleton/separation_planes.h"
#include "support/synthetic_model.h"

namespace skeletex {
namespace {

SkeletexModel model_of(const NamedSkeleton& named) {
  const SyntheticSurface surface(named.skeleton, named.radius);
  return surface.model(std::vector<std::pair<int, int>>(named.skeleton.bones.size(), {24, 11}));
}

ClContext& device() {
  static ClContext context;
  return context;
}

std::map<int, double> by_bone(const std::vector<BoneWeight>& weights) {
  std::map<int, double> map;
  for (const auto& [bone, weight] : weights) {
    EXPECT_EQ(map.count(bone), 0u) << "bone " << bone << " twice";
    map[bone] = weight;
  }
  return map;
}

double largest_difference(const std::vector<BoneWeight>& a, const std::vector<BoneWeight>& b) {
  std::map<int, double> difference = by_bone(a);
  for (const auto& [bone, weight] : by_bone(b)) difference[bone] -= weight;
  double largest = 0;
  for (const auto& [bone, value] : difference) largest = std::max(largest, std::abs(value));
  return largest;
}

/// Nodes moved by up to 0.3: bones turn, get longer and shorter.
Skeleton moved(const Skeleton& skeleton, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> unit(-0.3, 0.3);
  Pose pose;
  for (const Node& node : skeleton.nodes)
    pose.nodes.push_back(node.position + Vec3(unit(random), unit(random), unit(random)));
  return apply_pose(skeleton, pose);
}

TEST(Skin, WeightsAgreeOnBothSidesOfEverySeam) {
  for (const NamedSkeleton& named : all_skeletons()) {
    SCOPED_TRACE(named.name);
    const SkeletexModel model = model_of(named);
    const SeparationPlanes separation(model.skeleton);
    const WeightWalks walks = make_weight_walks(model, SeparationPlanes(model.skeleton));
    const auto check = [&](int node, const auto& bones, const SeamSample& sample) {
      const BoneEnd end = end_at(model.skeleton, bones[0], node);
      const Vec3 point = separation.seam_point(bones[0], end, sample.turn, sample.distance) - model.origin;
      const auto weights = bone_weights(walks, bones[0], point);
      for (const int other : bones) EXPECT_LT(largest_difference(weights, bone_weights(walks, other, point)), 1e-5);
    };
    for (const SeamArc& arc : model.arcs)
      for (const SeamSample& sample : arc.samples) check(arc.node, arc.bones, sample);
    for (const SeamCorner& corner : model.corners) check(corner.node, corner.bones, corner.sample);
  }
}

TEST(Skin, WeightsOfAStraightJointAreALogisticFunctionOfTheHeight) {
  // Two bones along x with a joint at (1, 0, 0): (P - N).(d_i - d_j) is twice the height.
  Skeleton skeleton;
  skeleton.nodes = {{"a", Vec3(0, 0, 0)}, {"b", Vec3(1, 0, 0)}, {"c", Vec3(2, 0, 0)}};
  skeleton.bones = {{"left", 0, 1, Vec3::UnitZ()}, {"right", 1, 2, Vec3::UnitZ()}};
  const double radius = 0.2;
  const SkeletexModel model = SyntheticSurface(skeleton, radius).model({{24, 11}, {24, 11}});
  const WeightWalks walks = make_weight_walks(model, SeparationPlanes(model.skeleton));
  // By length: half of the seam is nearer to the bones than the girth.
  const std::vector<SeamSample>& samples = model.arcs[0].samples;
  std::vector<std::array<double, 3>> pieces;  // distances of the ends, and length
  double length = 0, nearest = radius;
  const auto point_of = [&](const SeamSample& s) {
    return SeparationPlanes(model.skeleton).seam_point(0, BoneEnd::kTail, s.turn, s.distance);
  };
  for (std::size_t i = 0; i < samples.size(); ++i) {
    const SeamSample &one = samples[i], &other = samples[(i + 1) % samples.size()];
    pieces.push_back({one.distance, other.distance, (point_of(one) - point_of(other)).norm()});
    length += pieces.back()[2];
    nearest = std::min(nearest, one.distance);
  }
  double girth = 0, below = 0;
  for (; below < length / 2; girth += 1e-6 * radius) {
    below = 0;
    for (const auto& [first, last, piece] : pieces)
      below += piece * std::clamp((girth - std::min(first, last)) / std::abs(last - first), 0.0, 1.0);
  }
  for (const double height : {0.0, 0.03, 0.1}) {
    const Vec3 point = Vec3(1 + height, 0, 0.9 * nearest) - model.origin;  // within the seam's reach
    const auto weights = by_bone(bone_weights(walks, 1, point));
    const double share = std::exp(-0.8 * 2 * height / girth) - 0.002, own = 1 - 0.002;
    EXPECT_NEAR(weights.at(0), share / (share + own), 1e-5) << height;
    EXPECT_NEAR(weights.at(0) + weights.at(1), 1, 1e-12);
  }
  // Far along the bone nothing of the other one is left.
  EXPECT_EQ(by_bone(bone_weights(walks, 1, Vec3(2, 0, 0.1) - model.origin)).count(0), 0u);
}

/// A pose must not depend on how densely which part of a seam is sampled, as textures of other sizes do it.
TEST(Skin, WeightsDoNotDependOnWhereSeamsAreSampled) {
  for (const NamedSkeleton& named : all_skeletons()) {
    SCOPED_TRACE(named.name);
    SkeletexModel model = SyntheticSurface(named.skeleton, named.radius)
                              .model(std::vector<std::pair<int, int>>(named.skeleton.bones.size(), {192, 11}));
    const WeightWalks walks = make_weight_walks(model, SeparationPlanes(model.skeleton));
    for (SeamArc& arc : model.arcs) {
      std::vector<SeamSample> fewer;  // every third one of the first half, and all of the second
      for (std::size_t i = 0; i < arc.samples.size(); ++i)
        if (2 * i >= arc.samples.size() || i % 3 == 0) fewer.push_back(arc.samples[i]);
      arc.samples = fewer;
    }
    const WeightWalks fewer = make_weight_walks(model, SeparationPlanes(model.skeleton));
    ASSERT_EQ(walks.steps.size(), fewer.steps.size());
    for (std::size_t i = 0; i < walks.steps.size(); ++i)
      EXPECT_NEAR(fewer.steps[i].girth_inverse, walks.steps[i].girth_inverse, 0.002 * walks.steps[i].girth_inverse);
  }
}

TEST(Skin, KernelsMoveVerticesAsTheHostDoesInDoublePrecision) {
  for (const NamedSkeleton& named : all_skeletons()) {
    SCOPED_TRACE(named.name);
    const SkeletexModel model = model_of(named);
    const TriangleMesh bind = reconstruct_mesh(device(), model);
    const WeightWalks walks = make_weight_walks(model, SeparationPlanes(model.skeleton));
    const Lattice lattice = number_lattice(model);
    const Skeleton posed = moved(model.skeleton, 7);
    const std::vector<BoneMotion> motions = bone_motions(model.skeleton, posed);
    ASSERT_TRUE(is_stretched(motions));
    const TriangleMesh mesh = reconstruct_mesh(device(), model, posed);
    EXPECT_EQ(mesh.triangles, bind.triangles);
    for (int bone = 0; bone < static_cast<int>(model.patches.size()); ++bone) {
      const Rectangle& rectangle = model.patches[bone].rectangle;
      for (int i = lattice.first_inner[bone]; i < lattice.first_inner[bone] + rectangle.width * (rectangle.height - 2);
           ++i) {
        const Vec3 expected =
            blend_motions(motions, bone_weights(walks, bone, bind.positions[i] - model.origin), bind.positions[i]);
        ASSERT_LT((mesh.positions[i] - expected).norm(), 1e-5 * model.diagonal) << "vertex " << i;
      }
    }
  }
}

TEST(Skin, BindPoseAndRigidMotionsAreExactAndEveryPoseIsClosed) {
  for (const NamedSkeleton& named : all_skeletons()) {
    SCOPED_TRACE(named.name);
    const SkeletexModel model = model_of(named);
    const TriangleMesh bind = reconstruct_mesh(device(), model);
    const Eigen::Quaterniond rotation(Eigen::AngleAxisd(2.1, Vec3(1, -2, 0.5).normalized()));
    Pose rigid;
    for (const Node& node : model.skeleton.nodes) rigid.nodes.push_back(rotation * node.position + Vec3(3, 2, 1));
    const TriangleMesh same = reconstruct_mesh(device(), model, apply_pose(model.skeleton, Pose{})),
                       turned = reconstruct_mesh(device(), model, apply_pose(model.skeleton, rigid));
    for (std::size_t i = 0; i < bind.positions.size(); ++i) {
      ASSERT_LT((same.positions[i] - bind.positions[i]).norm(), 1e-6 * model.diagonal);
      // The nodes of a lone bone leave its turn about itself open.
      const double error = (turned.positions[i] - (rotation * bind.positions[i] + Vec3(3, 2, 1))).norm();
      ASSERT_TRUE(model.skeleton.bones.size() == 1 || error < 1e-6 * model.diagonal) << error;
    }
    for (unsigned seed = 0; seed < 5; ++seed) {
      const ManifoldReport report = measure_manifold(reconstruct_mesh(device(), model, moved(model.skeleton, seed)));
      EXPECT_TRUE(report.is_closed_manifold() && report.genus == model.genus && report.non_finite_vertices.empty())
          << seed;
    }
  }
}

double largest_distance(const TriangleMesh& a, const TriangleMesh& b) {
  double largest = 0;
  for (std::size_t i = 0; i < a.positions.size(); ++i)
    largest = std::max(largest, (a.positions[i] - b.positions[i]).norm());
  return largest;
}

TEST(Skin, AModelsOwnWeightsTakeThePlaceOfTheClosedForm) {
  const SkeletexModel model = model_of({"Y", y_branch(), 0.25});
  const Skeleton posed = moved(model.skeleton, 3);
  const TriangleMesh expected = reconstruct_mesh(device(), model, posed);
  SkeletexModel painted = model;
  painted.bone_weights = weight_planes(device(), model);
  // Rows next to seams lie on them, so only what is linear between columns there differs.
  EXPECT_LT(largest_distance(reconstruct_mesh(device(), painted, posed), expected), 5e-3 * model.diagonal);
  // Their sum does not matter.
  for (auto& plane : painted.bone_weights)
    for (float& weight : plane) weight *= 3;
  EXPECT_LT(largest_distance(reconstruct_mesh(device(), painted, posed), expected), 5e-3 * model.diagonal);
  // All to the first bone: its motion alone, everywhere. Where nothing is painted each bone moves its own.
  for (std::size_t bone = 0; bone < painted.bone_weights.size(); ++bone)
    std::fill(painted.bone_weights[bone].begin(), painted.bone_weights[bone].end(), bone == 0 ? 1.f : 0.f);
  const TriangleMesh bind = reconstruct_mesh(device(), model), rigid = reconstruct_mesh(device(), painted, posed);
  const std::vector<BoneMotion> motions = bone_motions(model.skeleton, posed);
  for (std::size_t i = 0; i < bind.positions.size(); ++i) {
    const std::vector<BoneWeight> first{{0, 1}};
    ASSERT_LT((rigid.positions[i] - blend_motions(motions, first, bind.positions[i])).norm(), 1e-5 * model.diagonal);
  }
  for (auto& plane : painted.bone_weights) std::fill(plane.begin(), plane.end(), 0.f);
  const TriangleMesh own = reconstruct_mesh(device(), painted, posed);
  const Lattice lattice = number_lattice(model);
  for (int bone = 0; bone < static_cast<int>(model.patches.size()); ++bone) {
    const std::vector<BoneWeight> alone{{bone, 1}};
    const int i = lattice.first_inner[bone];
    EXPECT_LT((own.positions[i] - blend_motions(motions, alone, bind.positions[i])).norm(), 1e-5 * model.diagonal);
  }
}

TEST(Skin, PaintedWeightsFollowToOtherSizes) {
  const SkeletexModel model = model_of({"tree of 12", random_tree(12, 3), 0.15});
  SkeletexModel painted = model;
  painted.bone_weights = weight_planes(device(), model);
  const int size = 2 * std::max(model.texture.width, model.texture.height);
  const SkeletexModel large = resample_model(device(), painted, size);
  SkeletexModel plain = large;
  plain.bone_weights.clear();
  const Skeleton posed = moved(model.skeleton, 5);
  EXPECT_LT(largest_distance(reconstruct_mesh(device(), large, posed), reconstruct_mesh(device(), plain, posed)),
            0.02 * model.diagonal);
}

TEST(Skin, ABoneThatGetsLongerTakesItsSurfaceAlong) {
  Skeleton skeleton;
  skeleton.nodes = {{"a", Vec3(0, 0, 0)}, {"b", Vec3(1, 0, 0)}, {"c", Vec3(2, 0, 0)}};
  skeleton.bones = {{"left", 0, 1, Vec3::UnitZ()}, {"right", 1, 2, Vec3::UnitZ()}};
  Skeleton posed = skeleton;
  posed.nodes[1].position.x() = 1.5;
  posed.nodes[2].position.x() = 2.5;
  const std::vector<BoneMotion> motions = bone_motions(skeleton, posed);
  const std::vector<BoneWeight> left{{0, 1.0}}, right{{1, 1.0}};
  EXPECT_LT((blend_motions(motions, left, Vec3(0.5, 0.2, 0)) - Vec3(0.75, 0.2, 0)).norm(), 1e-12);
  EXPECT_LT((blend_motions(motions, left, Vec3(-0.1, 0.2, 0)) - Vec3(-0.1, 0.2, 0)).norm(), 1e-12);
  // At the joint the two bones agree.
  EXPECT_LT((blend_motions(motions, left, Vec3(1, 0.2, 0)) - blend_motions(motions, right, Vec3(1, 0.2, 0))).norm(),
            1e-12);
}

TEST(Skin, HalfWeightsHalveTheTurnAndSignsFollowTheSkeleton) {
  // Each of five bones turns by 80 degrees more than the one before: the last by more than a turn.
  const Skeleton skeleton = chain(6);
  Pose pose;
  for (std::size_t i = 0; i < skeleton.bones.size(); ++i)
    pose.rotations.push_back(
        Eigen::Quaterniond(Eigen::AngleAxisd(i == 0 ? 0 : 80 * std::numbers::pi / 180, Vec3::UnitZ())));
  const std::vector<BoneMotion> motions = bone_motions(skeleton, apply_pose(skeleton, pose));
  for (std::size_t i = 0; i + 1 < motions.size(); ++i)
    EXPECT_GT(motions[i].rotation.dot(motions[i + 1].rotation), 0.7) << i;
  const Vec3 joint = skeleton.nodes[skeleton.bones[0].tail].position;
  const std::vector<BoneWeight> half{{0, 0.5}, {1, 0.5}};
  const Vec3 expected = joint + Eigen::AngleAxisd(40 * std::numbers::pi / 180, Vec3::UnitZ()) * Vec3(0.1, 0.2, 0.3);
  EXPECT_LT((blend_motions(motions, half, joint + Vec3(0.1, 0.2, 0.3)) - expected).norm(), 1e-12);
}

}  // namespace
}  // namespace skeletex
