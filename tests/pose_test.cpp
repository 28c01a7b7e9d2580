// SPDX-License-Identifier: MIT
#include "skeletex/skeleton/pose.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <filesystem>
#include <numbers>
#include <numeric>
#include <random>

#include "skeletex/io/pose_file.h"
#include "skeletex/io/skeleton_file.h"
#include "skeletex/model/error.h"
#include "skeletex/reconstruct/lattice.h"
#include "skeletex/reconstruct/pose/pose_mesh.h"
#include "skeletex/reconstruct/pose/posed_frame.h"
#include "skeletex/reconstruct/reconstruct_mesh.h"
#include "support/mesh_topology.h"
#include "support/synthetic_model.h"

namespace skeletex {
namespace {

constexpr double kPi = std::numbers::pi;

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
    for (int i = 0; i < static_cast<int>(skeleton.bones.size()); ++i)
      shortest = std::min(shortest, bone_length(skeleton, i));
    for (const Node& node : skeleton.nodes)
      pose.nodes.push_back(node.position + largest / 3 * shortest * Vec3(unit(random), unit(random), unit(random)));
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
std::vector<Vec3> all_points(const SkeletexModel& model, const Skeleton& posed,
                             DistanceRule rule = DistanceRule::kFromBone) {
  const SeparationPlanes bind(model.skeleton);
  const PosedPlanes separation(model, posed);
  std::vector<Vec3> points;
  for (int bone = 0; bone < static_cast<int>(model.patches.size()); ++bone)
    for (int r = 0; r < model.patches[bone].rectangle.height; ++r)
      for (int j = 0; j < model.patches[bone].rectangle.width; ++j)
        points.push_back(posed_point(model, bind, separation, bone, model.patches[bone].row_u[r],
                                     static_cast<double>(j) / model.patches[bone].rectangle.width,
                                     texel_of(model, bone, r, j), rule));
  for (int a = 0; a < static_cast<int>(model.arcs.size()); ++a)
    for (int i = 0; i < static_cast<int>(model.arcs[a].samples.size()); ++i)
      points.push_back(separation.sample_point(a, i, rule));
  for (int c = 0; c < static_cast<int>(model.corners.size()); ++c) points.push_back(separation.corner_point(c, rule));
  return points;
}

double largest_difference(const std::vector<Vec3>& a, const std::vector<Vec3>& b) {
  double worst = a.size() == b.size() ? 0 : 1e9;
  for (std::size_t i = 0; i < std::min(a.size(), b.size()); ++i) worst = std::max(worst, (a[i] - b[i]).norm());
  return worst;
}

/// The model with one bone's head and tail exchanged, s kept: angles run the other way.
SkeletexModel with_bone_reversed(SkeletexModel model, int bone) {
  std::swap(model.skeleton.bones[bone].head, model.skeleton.bones[bone].tail);
  Patch& patch = model.patches[bone];
  const auto [x, y, width, height] = patch.rectangle;
  std::reverse(patch.row_u.begin(), patch.row_u.end());
  for (double& u : patch.row_u) u = 1 - u;
  const DisplacementTexture old = model.texture;
  for (int r = 0; r < height; ++r)
    for (int j = 0; j < width; ++j) {
      const std::size_t to = static_cast<std::size_t>(y + r) * old.width + x + j;
      const std::size_t from = static_cast<std::size_t>(y + height - 1 - r) * old.width + x + (width - j) % width;
      model.texture.along[to] = -old.along[from];
      model.texture.around[to] = -old.around[from];
      model.texture.out[to] = old.out[from];
    }
  const auto mirrored = [](double turn) { return turn > 0 ? 1 - turn : 0; };
  std::vector<bool> is_turned(model.arcs.size(), false);
  for (std::size_t a = 0; a < model.arcs.size(); ++a) {
    SeamArc& arc = model.arcs[a];
    if (arc.bones[0] != bone) continue;
    is_turned[a] = true;
    for (SeamSample& sample : arc.samples) sample.turn = mirrored(sample.turn);
    std::reverse(arc.samples.begin(), arc.samples.end());
    std::swap(arc.corners[0], arc.corners[1]);
  }
  for (SeamCorner& corner : model.corners)
    if (corner.bones[0] == bone) corner.sample.turn = mirrored(corner.sample.turn);
  std::swap(model.ends[bone][0], model.ends[bone][1]);
  for (PatchEnd& end : model.ends[bone]) {
    std::reverse(end.arcs.begin(), end.arcs.end());
    for (ArcUse& use : end.arcs) use.is_reversed = !use.is_reversed;
  }
  for (auto& ends : model.ends)
    for (PatchEnd& end : ends)
      for (ArcUse& use : end.arcs) use.is_reversed = use.is_reversed != is_turned[use.arc];
  return model;
}

/// Bone i becomes bone place[i], and takes another name; samples are told by another of the bones that meet.
SkeletexModel with_bones_reordered(const SkeletexModel& model, const std::vector<int>& place) {
  SkeletexModel result = model;
  for (std::size_t i = 0; i < place.size(); ++i) {
    result.skeleton.bones[place[i]] = model.skeleton.bones[i];
    result.skeleton.bones[place[i]].name = "renamed" + std::to_string(place[i]);
    result.patches[place[i]] = model.patches[i];
    result.ends[place[i]] = model.ends[i];
  }
  for (SeamArc& arc : result.arcs)
    for (BoneIndex& bone : arc.bones) bone = place[bone];
  for (SeamCorner& corner : result.corners)
    for (BoneIndex& bone : corner.bones) bone = place[bone];
  return result;
}

/// The largest distance from a point of one set to the nearest of the other.
double farthest_from(const std::vector<Vec3>& points, const std::vector<Vec3>& others) {
  double worst = 0;
  for (const Vec3& p : points) {
    double nearest = 1e9;
    for (const Vec3& q : others) nearest = std::min(nearest, (p - q).squaredNorm());
    worst = std::max(worst, std::sqrt(nearest));
  }
  return worst;
}

ClContext& device() {
  static ClContext context;
  return context;
}

std::string message_of(const nlohmann::json& json, const Skeleton& skeleton) {
  try {
    animation_from_json(json, skeleton, "pose");
  } catch (const Error& error) {
    return error.what();
  }
  return "accepted";
}

TEST(Pose, RandomPosesAreWhatTheirSeedSays) {
  const Skeleton skeleton = random_tree(12, 3);
  const double largest = 0.7;
  const Pose pose = make_random_pose(skeleton, largest, 5), same = make_random_pose(skeleton, largest, 5),
             other = make_random_pose(skeleton, largest, 6);
  const int root = root_nodes(skeleton)[0];
  bool is_other = false;
  for (std::size_t i = 0; i < skeleton.bones.size(); ++i) {
    EXPECT_EQ(pose.rotations[i].coeffs(), same.rotations[i].coeffs());
    is_other = is_other || pose.rotations[i].coeffs() != other.rotations[i].coeffs();
    const double angle = pose.rotations[i].angularDistance(Eigen::Quaterniond::Identity());
    EXPECT_LE(angle, largest + 1e-12);
    EXPECT_EQ(angle == 0, skeleton.bones[i].head == root || skeleton.bones[i].tail == root) << i;
  }
  EXPECT_TRUE(is_other);
  EXPECT_THROW(make_random_pose(ring(5), largest, 1), InputError);
}

TEST(Pose, BonesInCyclesAreThoseWithoutWhichTheirEndsStillHangTogether) {
  for (unsigned seed = 0; seed < 20; ++seed) {
    Skeleton skeleton = random_tree(14, seed);
    std::mt19937 random(seed);
    for (unsigned more = 0; more < seed % 4; ++more) {
      const int a = static_cast<int>(random() % 15), b = static_cast<int>(random() % 15);
      if (a != b) skeleton.bones.push_back({"more" + std::to_string(more), a, b, {}});
    }
    const std::vector<bool> found = bones_in_cycles(skeleton);
    for (std::size_t i = 0; i < skeleton.bones.size(); ++i) {
      std::vector<int> label(skeleton.nodes.size());
      std::iota(label.begin(), label.end(), 0);
      for (std::size_t k = 0; k < skeleton.bones.size(); ++k)
        if (k != i)
          std::replace(label.begin(), label.end(), int{label[skeleton.bones[k].head]},
                       int{label[skeleton.bones[k].tail]});
      EXPECT_EQ(found[i], label[skeleton.bones[i].head] == label[skeleton.bones[i].tail]) << seed << " " << i;
    }
  }
}

TEST(Pose, BonesBesideCyclesTurnAndCyclesFollowAsOne) {
  // A stalk from the root, a ring at its end, and an arm on the ring's other side.
  Skeleton skeleton;
  for (const Vec3& p : {Vec3(0, 0, 0), Vec3(1, 0, 0), Vec3(2, 1, 0.1), Vec3(2, -1, 0), Vec3(3, 0, 0), Vec3(4, 0.2, 0)})
    skeleton.nodes.push_back({"n" + std::to_string(skeleton.nodes.size()), p});
  for (const auto& [head, tail] : {std::pair{0, 1}, {1, 2}, {1, 3}, {2, 4}, {3, 4}, {4, 5}})
    skeleton.bones.push_back({"b" + std::to_string(skeleton.bones.size()), head, tail, {}});
  for (std::size_t i = 0; i < skeleton.bones.size(); ++i) skeleton.bones[i].s = bone_bases(skeleton)[i].s;
  ASSERT_EQ(root_nodes(skeleton), std::vector<int>{0});
  const Eigen::Quaterniond stalk(Eigen::AngleAxisd(0.8, Vec3(1, 2, -1).normalized())),
      arm(Eigen::AngleAxisd(-1.1, Vec3(0, 1, 3).normalized()));
  Pose pose;
  pose.rotations.assign(6, Eigen::Quaterniond::Identity());
  pose.rotations[0] = stalk;
  pose.rotations[5] = arm;
  const Skeleton posed = apply_pose(skeleton, pose);
  for (int n = 0; n < 5; ++n)
    EXPECT_LT((posed.nodes[n].position - stalk * skeleton.nodes[n].position).norm(), 1e-14) << n;
  for (int b = 0; b < 5; ++b) EXPECT_LT((*posed.bones[b].s - stalk * *skeleton.bones[b].s).norm(), 1e-14) << b;
  const Vec3 reach = skeleton.nodes[5].position - skeleton.nodes[4].position;
  EXPECT_LT((posed.nodes[5].position - posed.nodes[4].position - stalk * (arm * reach)).norm(), 1e-14);

  const Pose random = make_random_pose(skeleton, 0.7, 1);
  for (int b = 0; b < 6; ++b)
    EXPECT_EQ(random.rotations[b].angularDistance(Eigen::Quaterniond::Identity()) > 0, b == 5) << b;
}

TEST(Pose, EveryPoseOfTheProjectFitsItsSkeleton) {
  const std::filesystem::path configs = std::filesystem::path(SKELETEX_SOURCE_DIR) / "configs";
  int count = 0;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(configs / "poses")) {
    if (entry.path().extension() != ".json") continue;
    // bear_bis_walk belongs to bear_bis, evaluation/man to man: the longest name of a skeleton that the file's begins
    // with.
    const std::string stem = entry.path().stem().string();
    std::string model;
    for (const auto& file : std::filesystem::directory_iterator(configs / "skeletons")) {
      const std::string name = file.path().stem().stem().string();
      if (stem.starts_with(name) && name.size() > model.size()) model = name;
    }
    const Skeleton skeleton = read_skeleton(configs / "skeletons" / (model + ".skeleton.json"));
    const PoseAnimation animation = read_animation(entry.path(), skeleton);
    for (const PoseFrame& frame : animation.frames)
      EXPECT_EQ(apply_pose(skeleton, frame.pose).nodes.size(), skeleton.nodes.size());
    ++count;
  }
  EXPECT_GE(count, 40);
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
              worst = std::max(
                  worst, (points[next++] - surface.point(bone, model.patches[bone].row_u[r],
                                                         static_cast<double>(j) / model.patches[bone].rectangle.width))
                             .norm());
        for (const SeamArc& arc : model.arcs)
          for (const SeamSample& sample : arc.samples)
            worst = std::max(worst,
                             (points[next++] -
                              surface.separation().seam_point(
                                  arc.bones[0],
                                  model.skeleton.bones[arc.bones[0]].head == arc.node ? BoneEnd::kHead : BoneEnd::kTail,
                                  sample.turn, sample.distance))
                                 .norm());
        for (const SeamCorner& corner : model.corners)
          worst = std::max(
              worst, (points[next++] -
                      surface.separation().seam_point(
                          corner.bones[0],
                          model.skeleton.bones[corner.bones[0]].head == corner.node ? BoneEnd::kHead : BoneEnd::kTail,
                          corner.sample.turn, corner.sample.distance))
                         .norm());
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
        const Skeleton start =
            apply_pose(model.skeleton, bend > 0 ? random_pose(model.skeleton, bend, 50 + i) : Pose{});
        Pose pose, moved;
        for (const Node& node : start.nodes) {
          pose.nodes.push_back(node.position);
          moved.nodes.push_back(rotation * node.position + shift);
        }
        std::vector<Vec3> expected = all_points(model, apply_pose(model.skeleton, pose));
        for (Vec3& p : expected) p = rotation * p + shift;
        EXPECT_LT(largest_difference(all_points(model, apply_pose(model.skeleton, moved)), expected), 1e-9)
            << named.name << " " << i << " bend " << bend;
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
    double worst = 0, worst_row = 0;
    for (unsigned seed = 0; seed < 200; ++seed) {
      const Skeleton posed = apply_pose(model.skeleton, random_pose(model.skeleton, kPi / 3, seed));
      const SeparationPlanes bind(model.skeleton);
      const PosedPlanes separation(model, posed);
      for (const DistanceRule rule : {DistanceRule::kFromBone, DistanceRule::kFromFoot}) {
        for (int a = 0; a < static_cast<int>(model.arcs.size()); ++a)
          for (int i = 0; i < static_cast<int>(model.arcs[a].samples.size()); ++i) {
            const Vec3 p = separation.sample_point(a, i, rule, 0);
            ASSERT_TRUE(p.allFinite()) << named.name << " seed " << seed;
            worst = std::max(worst, (p - separation.sample_point(a, i, rule, 1)).norm());
            // The texel that the bone itself would have there: the rows run into the seam.
            const SeamArc& arc = model.arcs[a];
            for (const int side : {0, 1}) {
              const int bone = arc.bones[side];
              const BoneEnd end = model.skeleton.bones[bone].head == arc.node ? BoneEnd::kHead : BoneEnd::kTail;
              const Vec3 bound = bind.seam_point(
                  arc.bones[0], model.skeleton.bones[arc.bones[0]].head == arc.node ? BoneEnd::kHead : BoneEnd::kTail,
                  arc.samples[i].turn, arc.samples[i].distance);
              const double turn = bind.turn_of(bone, bound - model.skeleton.nodes[arc.node].position),
                           u = end == BoneEnd::kHead ? 0 : 1;
              const Vec3 texel = encode_texel(tangent_frame(model.skeleton, bind, bone, u, turn), bound,
                                              end_position(model.skeleton, bone, BoneEnd::kHead),
                                              end_position(model.skeleton, bone, BoneEnd::kTail));
              worst_row =
                  std::max(worst_row, (posed_point(model, bind, separation, bone, u, turn, texel, rule) - p).norm());
            }
          }
        for (int c = 0; c < static_cast<int>(model.corners.size()); ++c)
          ASSERT_TRUE(separation.corner_point(c, rule).allFinite());
      }
    }
    EXPECT_LT(worst, 1e-9) << named.name;
    EXPECT_LT(worst_row, 1e-6) << named.name;
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
      const SeparationPlanes bind(model.skeleton);
      const PosedPlanes separation(model, posed);
      for (int bone = 0; bone < static_cast<int>(model.patches.size()); ++bone)
        for (int r = 0; r < 17; ++r)
          for (int j = 0; j < 16; ++j) {
            const double u = model.patches[bone].row_u[r];
            const Vec3 texel = texel_of(model, bone, r, j);
            const Vec3 p = posed_point(model, bind, separation, bone, u, j / 16.0, texel, DistanceRule::kFromBone);
            ASSERT_TRUE(p.allFinite());
            const double error = std::abs(distance_to_bone(p, end_position(posed, bone, BoneEnd::kHead),
                                                           end_position(posed, bone, BoneEnd::kTail)) -
                                          texel.norm());
            const Axial at = axial_of(u, bind.is_free(bone, BoneEnd::kHead), bind.is_free(bone, BoneEnd::kTail));
            ++all;
            if ((at.axial < 0.25 && !bind.is_free(bone, BoneEnd::kHead)) ||
                (at.axial > 0.75 && !bind.is_free(bone, BoneEnd::kTail)))
              continue;
            ++kept;
            worst = std::max(worst, error);
          }
    }
    EXPECT_LT(worst, 1e-6) << named.name << " " << kept << " of " << all;
  }
}

TEST(Pose, ReversingABoneChangesNothing) {
  for (const NamedSkeleton& named : all_skeletons()) {
    if (named.skeleton.bones.size() == 1) continue;
    const SyntheticSurface surface(named.skeleton, named.radius);
    const SkeletexModel model = model_of(surface, 7, 5);
    for (int bone = 0; bone < std::min(5, static_cast<int>(model.patches.size())); ++bone) {
      const SkeletexModel reversed = with_bone_reversed(model, bone);
      Pose pose;
      for (const Node& node : apply_pose(model.skeleton, random_pose(model.skeleton, 0.9, 20 + bone)).nodes)
        pose.nodes.push_back(node.position);
      pose.rolls.assign(model.skeleton.bones.size(), 0);
      pose.rolls[bone] = 0.3;
      Pose mirrored = pose;
      mirrored.rolls[bone] = -0.3;
      EXPECT_LT(farthest_from(all_points(model, apply_pose(model.skeleton, pose)),
                              all_points(reversed, apply_pose(reversed.skeleton, mirrored))),
                1e-6)
          << named.name << " bone " << bone;
    }
  }
}

TEST(Pose, RenamingAndReorderingBonesChangesNothing) {
  for (const NamedSkeleton& named : all_skeletons()) {
    const SyntheticSurface surface(named.skeleton, named.radius);
    const SkeletexModel model = model_of(surface, 7, 5);
    std::vector<int> place(model.patches.size());
    std::iota(place.begin(), place.end(), 0);
    std::mt19937 random(4);
    for (unsigned seed = 0; seed < 4; ++seed) {
      std::shuffle(place.begin(), place.end(), random);
      const SkeletexModel reordered = with_bones_reordered(model, place);
      const Pose pose = random_pose(model.skeleton, 0.9, seed);
      Pose other = pose;
      for (std::size_t i = 0; i < place.size(); ++i) {
        if (!pose.rotations.empty()) other.rotations[place[i]] = pose.rotations[i];
        other.rolls[place[i]] = pose.rolls[i];
      }
      EXPECT_LT(farthest_from(all_points(model, apply_pose(model.skeleton, pose)),
                              all_points(reordered, apply_pose(reordered.skeleton, other))),
                1e-6)
          << named.name << " seed " << seed;
    }
  }
}

TEST(Pose, MeshesAreClosedInRandomPosesAndTheKernelsAgreeWithTheirTwin) {
  for (const NamedSkeleton& named : all_skeletons()) {
    const SyntheticSurface surface(named.skeleton, named.radius);
    const SkeletexModel model = model_of(surface, 13, 9);
    const Lattice lattice = number_lattice(model);
    const SeparationPlanes bind(model.skeleton);
    for (unsigned seed = 0; seed < 50; ++seed) {
      const Skeleton posed = apply_pose(model.skeleton, random_pose(model.skeleton, kPi / 3, 1000 + seed));
      const PosedPlanes separation(model, posed);
      const DistanceRule rule = seed % 4 == 3 ? DistanceRule::kFromFoot : DistanceRule::kFromBone;
      const TriangleMesh mesh = reconstruct_mesh(device(), model, posed, {Deformation::kPaper, rule});
      for (const Vec3& p : mesh.positions) ASSERT_TRUE(p.allFinite()) << named.name << " seed " << seed;
      if (seed % 20 > 1) continue;  // all poses share their triangles
      ASSERT_EQ(broken_rule(mesh, surface.genus()), "") << named.name << " seed " << seed;
      double worst = 0, largest = model.diagonal;
      for (int bone = 0; bone < static_cast<int>(model.patches.size()); ++bone)
        for (int r = 1; r + 1 < 9; ++r)
          for (int j = 0; j < 13; ++j) {
            const Vec3 expected = posed_point(model, bind, separation, bone, model.patches[bone].row_u[r], j / 13.0,
                                              texel_of(model, bone, r, j), rule);
            largest = std::max(largest, (expected - posed.nodes[0].position).norm());
            worst = std::max(worst, (mesh.positions[lattice.first_inner[bone] + (r - 1) * 13 + j] - expected).norm());
          }
      // Single precision; a separation plane between bones that nearly lie on each other is steep, which takes some
      // digits.
      EXPECT_LT(worst, 2e-5 * largest) << named.name << " seed " << seed;
    }
  }
}

TEST(Pose, TheKernelsLeaveTheBindPoseAlone) {
  for (const NamedSkeleton& named : all_skeletons()) {
    const SyntheticSurface surface(named.skeleton, named.radius);
    const SkeletexModel model = model_of(surface, 33, 17);
    const TriangleMesh bound = reconstruct_mesh(device(), model);
    for (const DistanceRule rule : {DistanceRule::kFromBone, DistanceRule::kFromFoot})
      EXPECT_LT(largest_difference(
                    reconstruct_mesh(device(), model, apply_pose(model.skeleton, Pose{}), {Deformation::kPaper, rule})
                        .positions,
                    bound.positions),
                1e-6 * model.diagonal)
          << named.name;
  }
}

TEST(Pose, APlaneOfConstantOffsetLiesAtThatDistanceFromItsBones) {
  for (const NamedSkeleton& named : all_skeletons()) {
    const SyntheticSurface surface(named.skeleton, named.radius);
    const SkeletexModel model = model_of(surface, 20, 40);
    const double offset = 0.7 * named.radius;
    const Skeleton posed = apply_pose(model.skeleton, random_pose(model.skeleton, 0.7, 3));
    const std::vector<int> bones{0};
    const TriangleMesh mesh = constant_offset_mesh(device(), model, posed, bones, offset);
    ASSERT_EQ(mesh.positions.size(), 800u);
    EXPECT_EQ(mesh.triangles.size(), 2u * 20 * 39);
    int inner = 0;
    for (std::size_t i = 0; i < mesh.positions.size(); ++i) {
      const Axial at =
          axial_of(model.patches[0].row_u[i / 20], model.ends[0][0].arcs.empty(), model.ends[0][1].arcs.empty());
      if (at.axial < 0.25 || at.axial > 0.75) continue;
      ++inner;
      EXPECT_NEAR(distance_to_bone(mesh.positions[i], end_position(posed, 0, BoneEnd::kHead),
                                   end_position(posed, 0, BoneEnd::kTail)),
                  offset, 1e-6)
          << named.name;
    }
    EXPECT_GT(inner, 100);
  }
  EXPECT_THROW(constant_offset_mesh(device(), model_of(SyntheticSurface(y_branch(), 0.2)), y_branch(), {}, 0),
               InputError);
}

TEST(Pose, WhatChangesAtOneEndOfABoneIsFeltAtTheOtherOnlyToSecondOrder) {
  const SkeletexModel model = model_of(SyntheticSurface(chain(3), 0.2));
  Pose pose;
  pose.rotations.assign(3, Eigen::Quaterniond::Identity());
  pose.rotations[2] = Eigen::AngleAxisd(0.9, Vec3(1, 2, 3).normalized());
  const Skeleton posed = apply_pose(model.skeleton, pose);
  const SeparationPlanes bind(model.skeleton);
  const PosedPlanes separation(model, posed), still(model, model.skeleton);
  for (const double turn : {0.05, 0.3, 0.55, 0.8}) {
    const auto moved = [&](double u) {
      const Vec3 texel(0.02, -0.03, 0.15);
      return (posed_point(model, bind, separation, 1, u, turn, texel, DistanceRule::kFromBone) -
              posed_point(model, bind, still, 1, u, turn, texel, DistanceRule::kFromBone))
          .norm();
    };
    EXPECT_LT(moved(0), 1e-12);
    EXPECT_LT(moved(0.01), 0.3 * moved(0.02)) << turn;
  }
}

TEST(Pose, ATwistIsSharedByTheTwoBonesOfAJoint) {
  Skeleton skeleton;
  for (int i = 0; i < 3; ++i) skeleton.nodes.push_back({"n" + std::to_string(i), Vec3(0, 0, i)});
  for (int i = 0; i < 2; ++i) skeleton.bones.push_back({"b" + std::to_string(i), i, i + 1, Vec3(1, 0, 0)});
  const SyntheticSurface surface(skeleton, 0.2, 0);
  const SkeletexModel model = model_of(surface);
  Pose pose;
  pose.rotations = {Eigen::Quaterniond::Identity(), Eigen::Quaterniond(Eigen::AngleAxisd(0.5, Vec3(0, 0, 1)))};
  for (const double roll : {0.0, 0.2}) {
    pose.rolls = {0, roll};
    const Skeleton posed = apply_pose(model.skeleton, pose);
    const PosedPlanes separation(model, posed);
    EXPECT_NEAR(separation.radial(0, BoneEnd::kTail, 0.3).roll * 2 * kPi, (0.5 + roll) / 2, 1e-12);
    EXPECT_NEAR(separation.radial(1, BoneEnd::kHead, 0.3).roll * 2 * kPi, -(0.5 + roll) / 2, 1e-12);
    EXPECT_EQ(separation.radial(0, BoneEnd::kHead, 0.3).roll, 0);
  }
}

TEST(Pose, ArcsAroundANodeOfThreeBonesAreHalfATurnInEveryPose) {
  const SyntheticSurface surface(y_branch(), 0.25);
  const SkeletexModel model = model_of(surface);
  for (unsigned seed = 0; seed < 50; ++seed) {
    const Skeleton posed = apply_pose(model.skeleton, random_pose(model.skeleton, 1.5, seed));
    const PosedPlanes separation(model, posed);
    for (int bone = 0; bone < 3; ++bone) {
      const BoneEnd end = model.ends[bone][0].arcs.empty() ? BoneEnd::kTail : BoneEnd::kHead;
      const double first = separation.radial(bone, end, 0).roll;
      for (int j = 1; j < 12; ++j)
        EXPECT_NEAR(std::remainder(separation.radial(bone, end, j / 12.0).roll - first, 1.0), 0, 1e-9);
    }
  }
}

TEST(Pose, AnimationsInterpolateBoneByBoneAndNodeByNode) {
  const Skeleton skeleton = y_branch();
  const auto json =
      nlohmann::json::parse(R"({"frames":[{"time":1,"pose":{"rotations":{"bone1":{"axis":[0,0,2],"degrees":40}}}},
    {"time":3,"pose":{"roll":{"bone2":20}}},{"time":4,"pose":{"nodes":{"end0":[0,0,-2]}}}]})");
  const PoseAnimation animation = animation_from_json(json, skeleton, "animation");
  EXPECT_NEAR(pose_at(skeleton, animation, 2)
                  .rotations[1]
                  .angularDistance(Eigen::Quaterniond(Eigen::AngleAxisd(kPi / 9, Vec3(0, 0, 1)))),
              0, 1e-12);
  EXPECT_NEAR(pose_at(skeleton, animation, 2).rolls[2], kPi / 18, 1e-12);
  EXPECT_NEAR(
      (pose_at(skeleton, animation, 3.25).nodes[1] - (0.75 * skeleton.nodes[1].position + 0.25 * Vec3(0, 0, -2)))
          .norm(),
      0, 1e-12);
  EXPECT_NEAR(pose_at(skeleton, animation, 0)
                  .rotations[1]
                  .angularDistance(Eigen::Quaterniond(Eigen::AngleAxisd(kPi * 2 / 9, Vec3(0, 0, 1)))),
              0, 1e-12);
  EXPECT_EQ(pose_at(skeleton, animation, 9).nodes.size(), skeleton.nodes.size());
  const PoseAnimation mixed{{animation.frames[0], {2, animation.frames[2].pose}}};
  EXPECT_THROW(pose_at(skeleton, mixed, 1.5), InputError);
}

TEST(Pose, IsRefusedWithTheReasonWhereItCannotBe) {
  const auto message = [](const Skeleton& skeleton, const Pose& pose) -> std::string {
    try {
      apply_pose(skeleton, pose);
    } catch (const InputError& error) {
      return error.what();
    }
    return "accepted";
  };
  Pose turned;
  turned.rotations.assign(7, Eigen::Quaterniond::Identity());
  EXPECT_EQ(message(ring(7), turned), "accepted");
  turned.rotations[3] = Eigen::AngleAxisd(0.1, Vec3(0, 0, 1));
  EXPECT_NE(message(ring(7), turned).find("in a cycle of bones"), std::string::npos) << message(ring(7), turned);
  EXPECT_NE(message(ring(6), turned).find("another skeleton"), std::string::npos);
  Pose flat;
  for (const Node& node : y_branch().nodes) flat.nodes.push_back(node.position);
  flat.nodes[2] = flat.nodes[0];
  EXPECT_NE(message(y_branch(), flat).find("\"bone1\" has no length"), std::string::npos) << message(y_branch(), flat);
  flat.rotations.assign(3, Eigen::Quaterniond::Identity());
  EXPECT_NE(message(y_branch(), flat).find("not both"), std::string::npos);
}

TEST(Pose, RootIsTheNodeThatBonesPointAwayFrom) {
  Skeleton skeleton;
  for (int i = 0; i < 5; ++i) skeleton.nodes.push_back({"n" + std::to_string(i), Vec3(i, i * i, 0)});
  skeleton.bones = {{"a", 2, 1, {}}, {"b", 1, 0, {}}, {"c", 2, 3, {}}, {"d", 4, 3, {}}};  // d is reversed
  EXPECT_EQ(root_nodes(skeleton), std::vector<int>{2});
}

TEST(PoseFile, RejectsWhatItDoesNotKnowWithTheNearestName) {
  const Skeleton skeleton = y_branch();
  const auto has = [&](const char* text, const char* part) {
    const std::string message = message_of(nlohmann::json::parse(text), skeleton);
    EXPECT_NE(message.find(part), std::string::npos) << text << " -> " << message;
  };
  has(R"({"rotations":{"bone1":{"axis":[0,0,1],"degrees":30}}})", "accepted");
  has(R"({"rotation":{}})", "did you mean rotations?");
  has(R"({"rotations":{"bon1":{"axis":[0,0,1],"degrees":30}}})", "did you mean bone1?");
  has(R"({"nodes":{"center":[0,0,0]}})", "did you mean centre?");
  has(R"({"roll":{"bne2":3}})", "did you mean bone2?");
  has(R"({"rotations":{"bone1":{"axis":[0,0,1],"degree":30}}})", "did you mean degrees?");
  has(R"({"rotations":{"bone1":{"axis":[0,0,0],"degrees":30}}})", "zero vector");
  has(R"({"rotations":{"bone1":{"axis":[0,0,1]}}})", "\"degrees\" is missing");
  has(R"({"rotations":{"bone1":{"quaternion":[0,0,0,0]}}})", "no length");
  has(R"({"rotations":{"bone1":{"quaternion":[0,0,0,1],"degrees":3}}})", "either");
  has(R"({"rotations":{},"nodes":{}})", "do not go together");
  has(R"({"nodes":{"centre":[0,0]}})", "three numbers");
  has(R"({"frames":[]})", "empty");
  has(R"({"frames":[{"time":0,"pose":{}},{"time":0,"pose":{}}]})", "times must grow");
  has(R"({"frames":[{"time":0,"pos":{}}]})", "did you mean pose?");
  has(R"([])", "object");
  has(R"({"rotations":{"bone1":{"axis":[1e300,0,0],"degrees":30}}})", "out of range");
  has(R"({"rotations":{"bone1":{"axis":[1,0,0],"degrees":1e200}}})", "out of range");
  has(R"({"nodes":{"end0":[0,-1e30,0]}})", "out of range");
  has(R"({"roll":{"bone1":1e16}})", "out of range");
}

}  // namespace skeletex
