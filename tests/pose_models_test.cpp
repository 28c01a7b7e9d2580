// SPDX-License-Identifier: MIT
// Poses of real models, encoded here: trees and cyclic skeletons, both methods.
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <numbers>
#include <random>

#include "skeletex/analysis/manifold.h"
#include "skeletex/convert/encode_model.h"
#include "skeletex/reconstruct/pose/pose_mesh.h"
#include "skeletex/reconstruct/pose/posed_frame.h"
#include "skeletex/reconstruct/reconstruct_mesh.h"
#include "skeletex/skeleton/pose.h"
#include "support/load_model.h"

namespace skeletex {
namespace {

ClContext& device() {
  static ClContext context;
  return context;
}

bool is_tree(const Skeleton& skeleton) { return skeleton.nodes.size() == skeleton.bones.size() + 1; }

Vec3 random_axis(std::mt19937& random) {
  std::normal_distribution<double> normal;
  const double x = normal(random), y = normal(random), z = normal(random);
  return Vec3(x, y, z).normalized();
}

/// Every joint turned by up to 60 degrees; in cyclic skeletons every node moved by up to a third of the shortest bone.
Pose random_pose(const Skeleton& skeleton, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> unit(-1, 1);
  Pose pose;
  if (is_tree(skeleton)) {
    for (std::size_t i = 0; i < skeleton.bones.size(); ++i)
      pose.rotations.push_back(
          Eigen::Quaterniond(Eigen::AngleAxisd(std::abs(unit(random)) * std::numbers::pi / 3, random_axis(random))));
    return pose;
  }
  double shortest = 1e300;
  for (int i = 0; i < static_cast<int>(skeleton.bones.size()); ++i)
    shortest = std::min(shortest, bone_length(skeleton, i));
  for (const Node& node : skeleton.nodes)
    pose.nodes.push_back(node.position + shortest / 3 * Vec3(unit(random), unit(random), unit(random)));
  return pose;
}

double largest_difference(const std::vector<Vec3>& a, const std::vector<Vec3>& b) {
  double worst = 0;
  for (std::size_t i = 0; i < a.size(); ++i) worst = std::max(worst, (a[i] - b[i]).norm());
  return worst;
}

struct Case {
  const char* name;
  std::optional<Method> method;
};

class PoseModels : public ::testing::TestWithParam<Case> {
 protected:
  static SkeletexModel encoded() {
    const TestModel source = load_standard_model(GetParam().name);
    EncodeOptions options;
    options.width = options.height = 96;
    options.method = GetParam().method;
    return encode_model(device(), source.mesh, source.skeleton, options).model;
  }
};

TEST_P(PoseModels, StayWhatTheyAre) {
  const SkeletexModel model = encoded();
  const double diagonal = model.diagonal;
  const TriangleMesh bound = reconstruct_mesh(device(), model);
  for (const Deformation deformation : {Deformation::kSmooth, Deformation::kCoordinates, Deformation::kPaper}) {
    SCOPED_TRACE(to_string(deformation));
    const PoseRule rule{deformation};
    // The bind pose is exact.
    EXPECT_LT(largest_difference(reconstruct_mesh(device(), model, apply_pose(model.skeleton, Pose{}), rule).positions,
                                 bound.positions),
              1e-6 * diagonal);

    // A rigid motion of the skeleton is that motion of the mesh: as a rotation at the root, and as node positions.
    const Eigen::Quaterniond rotation(Eigen::AngleAxisd(2.1, Vec3(1, -2, 0.5).normalized()));
    if (is_tree(model.skeleton)) {
      const int root = root_nodes(model.skeleton)[0];
      Pose turned;
      turned.rotations.assign(model.skeleton.bones.size(), Eigen::Quaterniond::Identity());
      const auto at = bones_at_nodes(model.skeleton);
      for (const BoneAtNode bone : at[root]) turned.rotations[bone.bone] = rotation;
      const Vec3 pivot = model.skeleton.nodes[root].position;
      std::vector<Vec3> expected = bound.positions;
      for (Vec3& p : expected) p = pivot + rotation * (p - pivot);
      EXPECT_LT(largest_difference(
                    reconstruct_mesh(device(), model, apply_pose(model.skeleton, turned), rule).positions, expected),
                1e-6 * diagonal);
    }
    Pose moved;
    for (const Node& node : model.skeleton.nodes)
      moved.nodes.push_back(rotation * node.position + Vec3(3, 2, 1) * diagonal);
    std::vector<Vec3> expected = bound.positions;
    for (Vec3& p : expected) p = rotation * p + Vec3(3, 2, 1) * diagonal;
    EXPECT_LT(largest_difference(reconstruct_mesh(device(), model, apply_pose(model.skeleton, moved), rule).positions,
                                 expected),
              1e-6 * diagonal);
  }

  // Random poses.
  const SeparationPlanes bind(model.skeleton);
  double seam = 0, distance = 0;
  std::size_t kept = 0, all = 0;
  for (unsigned seed = 0; seed < 200; ++seed) {
    const Skeleton posed = apply_pose(model.skeleton, random_pose(model.skeleton, seed));
    const PosedPlanes separation(model, posed);
    for (int a = 0; a < static_cast<int>(model.arcs.size()); ++a)
      for (int i = 0; i < static_cast<int>(model.arcs[a].samples.size()); ++i) {
        const Vec3 p = separation.sample_point(a, i, DistanceRule::kFromBone, 0);
        ASSERT_TRUE(p.allFinite()) << "seed " << seed;
        seam = std::max(seam, (p - separation.sample_point(a, i, DistanceRule::kFromBone, 1)).norm());
      }
    if (seed % 10 != 0) continue;
    for (const Deformation deformation : {Deformation::kSmooth, Deformation::kCoordinates, Deformation::kPaper}) {
      const ManifoldReport report = measure_manifold(reconstruct_mesh(device(), model, posed, {deformation}));
      ASSERT_TRUE(report.is_closed_manifold() && report.components == 1 && report.genus == model.genus &&
                  report.non_finite_vertices.empty())
          << "seed " << seed << " " << to_string(deformation);
    }
    for (int bone = 0; bone < static_cast<int>(model.patches.size()); ++bone) {
      const Patch& patch = model.patches[bone];
      const auto [x, y, width, height] = patch.rectangle;
      for (int r = 1; r + 1 < height; ++r) {
        const PosedRow row =
            posed_row(model, separation, bone,
                      axial_of(patch.row_u[r], bind.is_free(bone, BoneEnd::kHead), bind.is_free(bone, BoneEnd::kTail)));
        all += static_cast<std::size_t>(width);
        if (row.extensions[0] > 0 || row.extensions[1] > 0) continue;  // the seam's rule is mixed in
        for (int j = 0; j < width; ++j, ++kept) {
          const std::size_t at = static_cast<std::size_t>(y + r) * model.texture.width + x + j;
          const Vec3 texel(model.texture.along[at], model.texture.around[at], model.texture.out[at]);
          const Vec3 p = posed_point(model, bind, separation, bone, patch.row_u[r], static_cast<double>(j) / width,
                                     texel, DistanceRule::kFromBone);
          distance = std::max(distance, std::abs(distance_to_bone(p, end_position(posed, bone, BoneEnd::kHead),
                                                                  end_position(posed, bone, BoneEnd::kTail)) -
                                                 texel.norm()));
        }
      }
    }
  }
  EXPECT_LT(seam, 1e-9 * diagonal);
  EXPECT_LT(distance, 1e-9 * diagonal);
  EXPECT_GT(static_cast<double>(kept), 0.7 * static_cast<double>(all));
}

INSTANTIATE_TEST_SUITE_P(Standard, PoseModels,
                         ::testing::Values(Case{"armadillo", Method::kVsm}, Case{"bear", Method::kSpd},
                                           Case{"eight", Method::kVsm}, Case{"knot1", Method::kSpd}),
                         [](const auto& test) {
                           return std::string(test.param.name) + (test.param.method == Method::kSpd ? "_spd" : "_vsm");
                         });

}  // namespace
}  // namespace skeletex
