// SPDX-License-Identifier: MIT
// Posing by each point's own coordinates: synthetic models in closed form, and real ones.
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <map>
#include <numbers>
#include <random>
#include <set>

#include "skeletex/convert/encode_model.h"
#include "skeletex/reconstruct/pose/pose_by_coordinates.h"
#include "skeletex/reconstruct/pose/pose_mesh.h"
#include "skeletex/reconstruct/reconstruct_mesh.h"
#include "skeletex/skeleton/pose.h"
#include "support/load_model.h"
#include "support/mesh_topology.h"
#include "support/synthetic_model.h"

namespace skeletex {
namespace {

constexpr double kPi = std::numbers::pi;
constexpr std::array kRules{DistanceRule::kFromBone, DistanceRule::kFromFoot};
constexpr int kWidth = 20, kHeight = 11;

bool is_tree(const Skeleton& skeleton) { return skeleton.nodes.size() == skeleton.bones.size() + 1; }

Eigen::Quaterniond random_rotation(std::mt19937& random, double largest) {
  std::normal_distribution<double> normal;
  const double x = normal(random), y = normal(random), z = normal(random);
  return Eigen::Quaterniond(
      Eigen::AngleAxisd(std::uniform_real_distribution<double>(0, largest)(random), Vec3(x, y, z).normalized()));
}

/// Every joint turned by up to 60 degrees, and every third bone longer; cyclic skeletons: nodes moved by up to a third
/// of the shortest bone.
Skeleton random_pose(const Skeleton& bind, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> unit(-1, 1);
  Pose pose;
  if (is_tree(bind)) {
    for (std::size_t i = 0; i < bind.bones.size(); ++i) pose.rotations.push_back(random_rotation(random, kPi / 3));
  } else {
    double shortest = 1e300;
    for (int i = 0; i < static_cast<int>(bind.bones.size()); ++i) shortest = std::min(shortest, bone_length(bind, i));
    for (const Node& node : bind.nodes)
      pose.nodes.push_back(node.position + shortest / 3 * Vec3(unit(random), unit(random), unit(random)));
  }
  for (std::size_t i = 0; i < bind.bones.size(); ++i) pose.rolls.push_back(0.3 * unit(random));
  return apply_pose(bind, pose);
}

/// The nodes of a tree moved so that bones change their lengths too.
Skeleton stretched(const Skeleton& bind, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> unit(-0.15, 0.15);
  Pose pose;
  for (const Node& node : bind.nodes)
    pose.nodes.push_back(node.position + Vec3(unit(random), unit(random), unit(random)));
  return apply_pose(bind, pose);
}

SkeletexModel model_of(const SyntheticSurface& surface) {
  return surface.model(std::vector<std::pair<int, int>>(surface.skeleton().bones.size(), {kWidth, kHeight}));
}

ClContext& device() {
  static ClContext context;
  return context;
}

TriangleMesh posed_mesh(const SkeletexModel& model, const Skeleton& posed,
                        DistanceRule rule = DistanceRule::kFromBone) {
  return reconstruct_mesh(device(), model, posed, {Deformation::kCoordinates, rule});
}

double largest_difference(const std::vector<Vec3>& a, const std::vector<Vec3>& b) {
  double worst = a.size() == b.size() ? 0 : 1e300;
  for (std::size_t i = 0; i < std::min(a.size(), b.size()); ++i) worst = std::max(worst, (a[i] - b[i]).norm());
  return worst;
}

std::size_t texel_at(const SkeletexModel& model, int bone, int row, int column) {
  const Rectangle& r = model.patches[bone].rectangle;
  return static_cast<std::size_t>(r.y + row) * model.texture.width + r.x + column;
}

/// The texel at (u, turn) of a bone that has the given point.
void store_texel(SkeletexModel& model, int bone, std::size_t at, double u, double turn, const Vec3& point) {
  const Vec3 texel = encode_texel(tangent_frame(model.skeleton, SeparationPlanes(model.skeleton), bone, u, turn), point,
                                  end_position(model.skeleton, bone, BoneEnd::kHead),
                                  end_position(model.skeleton, bone, BoneEnd::kTail));
  model.texture.along[at] = static_cast<float>(texel[0]);
  model.texture.around[at] = static_cast<float>(texel[1]);
  model.texture.out[at] = static_cast<float>(texel[2]);
}

/// Calls with the bone and the vertex of every inner vertex.
template <class Use>
void for_each_inner(const SkeletexModel& model, const Lattice& lattice, const Use& use) {
  for (int bone = 0; bone < static_cast<int>(model.patches.size()); ++bone) {
    const Rectangle& r = model.patches[bone].rectangle;
    for (int i = 0; i < r.width * (r.height - 2); ++i) use(bone, lattice.first_inner[bone] + i);
  }
}

/// The largest distance of a posed inner vertex or pole from where posed_by_coordinates has it.
double largest_error(const SkeletexModel& model, const Skeleton& posed, const TriangleMesh& bound, DistanceRule rule) {
  const Lattice lattice = number_lattice(model);
  const PreparedModel prepared(model);
  const PosedPlanes separation(model, posed);
  const TriangleMesh mesh = posed_mesh(model, posed, rule);
  double worst = 0;
  const auto compare = [&](int bone, int vertex) {
    const double error =
        (mesh.positions[vertex] - posed_by_coordinates(prepared, separation, bone, bound.positions[vertex], rule))
            .norm();
    worst = error <= worst ? worst : error;  // NaN counts
  };
  for_each_inner(model, lattice, compare);
  for_each_pole(model, lattice, [&](int vertex, int bone, int, std::size_t) { compare(bone, vertex); });
  return worst;
}

/// The edges over which a mesh turns by more than 90 degrees.
std::set<std::pair<int, int>> folds(const TriangleMesh& mesh) {
  std::map<std::pair<int, int>, Vec3> normals;
  std::set<std::pair<int, int>> edges;
  for (const Triangle& t : mesh.triangles)
    for (int i = 0; i < 3; ++i)
      normals[{t[i], t[(i + 1) % 3]}] =
          (mesh.positions[t[1]] - mesh.positions[t[0]]).cross(mesh.positions[t[2]] - mesh.positions[t[0]]);
  for (const auto& [edge, normal] : normals)
    if (edge.first < edge.second && normal.dot(normals.at({edge.second, edge.first})) < 0) edges.insert(edge);
  return edges;
}

std::size_t new_folds(const TriangleMesh& bound, const TriangleMesh& posed) {
  std::set<std::pair<int, int>> found = folds(posed);
  for (const auto& edge : folds(bound)) found.erase(edge);
  return found.size();
}

}  // namespace

TEST(Coordinates, AreTheInverseOfTheSpdRayAndPosesAreThoseOfItsTexel) {
  for (const NamedSkeleton& named : all_skeletons()) {
    const SyntheticSurface surface(named.skeleton, named.radius);
    const SkeletexModel model = model_of(surface);
    const SeparationPlanes& bind = surface.separation();
    const PreparedModel prepared(model);
    std::mt19937 random(1);
    std::uniform_real_distribution<double> unit(0, 1);
    int compared = 0, in_caps = 0;
    for (unsigned seed = 0; seed < 20; ++seed) {
      const Skeleton posed = seed % 3 == 2 && is_tree(model.skeleton) ? stretched(model.skeleton, seed)
                                                                      : random_pose(model.skeleton, seed);
      const PosedPlanes separation(model, posed);
      for (int bone = 0; bone < static_cast<int>(model.patches.size()); ++bone)
        for (int i = 0; i < 50; ++i) {
          const double u = unit(random), turn = unit(random);
          const Vec3 texel(0, 0, named.radius * (0.1 + 1.4 * unit(random)));
          const Vec3 head = end_position(model.skeleton, bone, BoneEnd::kHead),
                     tail = end_position(model.skeleton, bone, BoneEnd::kTail);
          const Vec3 point = decode_texel(tangent_frame(model.skeleton, bind, bone, u, turn), texel, head, tail);
          // In front of both planes, where the map has an inverse.
          const double across = (point - head).cross(bind.bases()[bone].o).norm(), length = (tail - head).norm();
          if (length + across * (bind.slope(bone, BoneEnd::kTail, turn) - bind.slope(bone, BoneEnd::kHead, turn)) <
              0.05 * length)
            continue;
          const BoneCoordinates found = bone_coordinates(model.skeleton, bind, bone, point);
          ASSERT_NEAR(found.u, u, 1e-9) << named.name;
          ASSERT_NEAR(std::remainder(found.turn - turn, 1.0), 0, 1e-9) << named.name;
          ++compared;
          if (axial_of(u, bind.is_free(bone, BoneEnd::kHead), bind.is_free(bone, BoneEnd::kTail)).latitude != 0)
            ++in_caps;
          for (const DistanceRule rule : kRules)
            ASSERT_LT((posed_by_coordinates(prepared, separation, bone, point, rule) -
                       posed_point(model, bind, separation, bone, u, turn, texel, rule))
                          .norm(),
                      1e-8)
                << named.name << " bone " << bone << " seed " << seed;
        }
    }
    EXPECT_GT(compared, 400) << named.name;
    EXPECT_TRUE(in_caps > 50 || !is_tree(model.skeleton)) << named.name << " " << in_caps;
  }
}

TEST(Coordinates, GrowAlongTheBoneWhereThePlanesHaveCrossedToo) {
  const Skeleton skeleton = ring(3);  // the planes at both ends of a side meet in the middle of the ring
  const SeparationPlanes separation(skeleton);
  const Vec3 head = end_position(skeleton, 0, BoneEnd::kHead), tail = end_position(skeleton, 0, BoneEnd::kTail);
  Vec3 middle = Vec3::Zero();
  for (const Node& node : skeleton.nodes) middle += node.position / 3;
  double before = -1;
  for (int i = 0; i <= 40; ++i) {
    const Vec3 point = head + (i / 40.0) * (tail - head) + 1.3 * (middle - (head + tail) / 2);
    const double u = bone_coordinates(skeleton, separation, 0, point).u;
    EXPECT_GE(u, before);
    EXPECT_TRUE(u >= 0 && u <= 1) << u;
    before = u;
  }
  EXPECT_EQ(before, 1);
}

TEST(Coordinates, BothSidesOfEverySeamAgreeWithThePosedSeam) {
  for (const NamedSkeleton& named : all_skeletons()) {
    const SyntheticSurface surface(named.skeleton, named.radius);
    const SkeletexModel model = model_of(surface);
    const SeparationPlanes& bind = surface.separation();
    const PreparedModel prepared(model);
    double worst = 0;
    for (unsigned seed = 0; seed < 40; ++seed) {
      const Skeleton posed = random_pose(model.skeleton, seed);
      const PosedPlanes separation(model, posed);
      for (const DistanceRule rule : kRules)
        for (int a = 0; a < static_cast<int>(model.arcs.size()); ++a)
          for (int i = 0; i < static_cast<int>(model.arcs[a].samples.size()); ++i) {
            const SeamArc& arc = model.arcs[a];
            const BoneEnd end = model.skeleton.bones[arc.bones[0]].head == arc.node ? BoneEnd::kHead : BoneEnd::kTail;
            const Vec3 point = bind.seam_point(arc.bones[0], end, arc.samples[i].turn, arc.samples[i].distance);
            for (const int bone : arc.bones)
              worst = std::max(worst, (posed_by_coordinates(prepared, separation, bone, point, rule) -
                                       separation.sample_point(a, i, rule))
                                          .norm());
          }
    }
    EXPECT_LT(worst, 1e-6) << named.name;
  }
}

TEST(Coordinates, TheBindPoseAndRigidMotionsAreExact) {
  for (const NamedSkeleton& named : all_skeletons()) {
    const SkeletexModel model = model_of(SyntheticSurface(named.skeleton, named.radius));
    const TriangleMesh bound = reconstruct_mesh(device(), model);
    std::mt19937 random(3);
    for (const DistanceRule rule : kRules) {
      EXPECT_LT(largest_difference(posed_mesh(model, apply_pose(model.skeleton, {}), rule).positions, bound.positions),
                1e-6 * model.diagonal)
          << named.name;
      if (model.skeleton.bones.size() == 1) continue;  // nodes on a line do not say how it turned about itself
      const Eigen::Quaterniond rotation = random_rotation(random, kPi);
      Pose moved;
      for (const Node& node : model.skeleton.nodes) moved.nodes.push_back(rotation * node.position + Vec3(3, -2, 1));
      std::vector<Vec3> expected = bound.positions;
      for (Vec3& p : expected) p = rotation * p + Vec3(3, -2, 1);
      EXPECT_LT(largest_difference(posed_mesh(model, apply_pose(model.skeleton, moved), rule).positions, expected),
                1e-6 * model.diagonal)
          << named.name;
    }
  }
}

TEST(Coordinates, MeshesAreClosedInRandomPosesAndTheKernelAgreesWithItsTwin) {
  for (const NamedSkeleton& named : all_skeletons()) {
    const SyntheticSurface surface(named.skeleton, named.radius);
    const SkeletexModel model = model_of(surface);
    const TriangleMesh bound = reconstruct_mesh(device(), model);
    for (unsigned seed = 0; seed < 12; ++seed) {
      const Skeleton posed = seed % 3 == 2 && is_tree(model.skeleton) ? stretched(model.skeleton, seed)
                                                                      : random_pose(model.skeleton, 100 + seed);
      const TriangleMesh mesh = posed_mesh(model, posed);
      for (const Vec3& p : mesh.positions) ASSERT_TRUE(p.allFinite()) << named.name << " seed " << seed;
      EXPECT_EQ(broken_rule(mesh, surface.genus()), "") << named.name << " seed " << seed;
      // Single precision; a separation plane between bones that nearly lie on each other is steep, which takes some
      // digits.
      for (const DistanceRule rule : kRules)
        EXPECT_LT(largest_error(model, posed, bound, rule), 1e-5 * model.diagonal) << named.name << " seed " << seed;
    }
  }
}

TEST(Coordinates, TheKernelAgreesWithItsTwinFarFromTheSurfaceToo) {
  // Points anywhere: past the ends of short bones, beyond one separation plane, and beyond two that have crossed.
  std::vector<NamedSkeleton> skeletons = all_skeletons();
  skeletons.push_back({"ring of 3", ring(3), 0.2});
  Skeleton uneven = chain(3);  // a short bone between two long ones
  uneven.nodes[1].position = 0.8 * uneven.nodes[2].position + 0.2 * uneven.nodes[1].position;
  skeletons.push_back({"short bone", uneven, 0.1});
  for (const NamedSkeleton& named : skeletons) {
    const SkeletexModel model = model_of(SyntheticSurface(named.skeleton, named.radius));
    const Lattice lattice = number_lattice(model);
    const PreparedModel prepared(model);
    const Skeleton posed = random_pose(model.skeleton, 11);
    const PosedPlanes separation(model, posed);
    std::mt19937 random(12);
    std::normal_distribution<double> normal;
    std::array<std::vector<float>, 3> planes;
    std::vector<int> bones(lattice.inner_count);
    for_each_inner(model, lattice, [&](int bone, int vertex) {
      bones[vertex] = bone;
      const Vec3 middle =
          (end_position(model.skeleton, bone, BoneEnd::kHead) + end_position(model.skeleton, bone, BoneEnd::kTail)) /
              2 -
          model.origin;
      for (int axis = 0; axis < 3; ++axis)
        planes[axis].push_back(
            static_cast<float>(middle[axis] + 0.7 * bone_length(model.skeleton, bone) * normal(random)));
    });
    DevicePlanes points = upload_planes(device(), planes[0], planes[1], planes[2]);
    const DeviceCoordinates coordinates = make_coordinates(device(), model, points);
    for (const DistanceRule rule : kRules) {
      pose_by_coordinates(device(), model, coordinates, separation, rule, Vec3::Zero(), points);
      const auto [x, y, z] = download_planes(device(), points);
      int compared = 0;
      for (std::size_t i = 0; i < bones.size(); ++i) {
        const Vec3 point = model.origin + Vec3(planes[0][i], planes[1][i], planes[2][i]);
        const auto twin = [&](const Vec3& p) { return posed_by_coordinates(prepared, separation, bones[i], p, rule); };
        // Where two crossed planes meet, neighbouring points part.
        double parting = 0;
        for (const Vec3& step : {Vec3(1e-4, 0, 0), Vec3(0, 1e-4, 0), Vec3(0, 0, 1e-4)})
          parting = std::max(parting, (twin(point + step) - twin(point)).norm());
        if (parting > 2e-3) continue;
        ++compared;
        ASSERT_LT((Vec3(x[i], y[i], z[i]) - twin(point)).norm(), 5e-5 * model.diagonal) << named.name << " " << i;
      }
      EXPECT_GT(compared, 0.9 * static_cast<double>(bones.size())) << named.name;
    }
  }
}

TEST(Coordinates, TheMapDoesNotMatter) {
  for (const NamedSkeleton& named : all_skeletons()) {
    const SkeletexModel model = model_of(SyntheticSurface(named.skeleton, named.radius));
    const Lattice lattice = number_lattice(model);
    const TriangleMesh bound = reconstruct_mesh(device(), model);
    // The same points, told by texels at rows elsewhere along the bones.
    SkeletexModel shifted = model;
    for (int bone = 0; bone < static_cast<int>(model.patches.size()); ++bone)
      for (int row = 1; row + 1 < kHeight; ++row) {
        double& u = shifted.patches[bone].row_u[row];
        u += 0.1 * std::sin(kPi * u);
        for (int j = 0; j < kWidth; ++j)
          store_texel(shifted, bone, texel_at(model, bone, row, j), u, static_cast<double>(j) / kWidth,
                      bound.positions[lattice.first_inner[bone] + (row - 1) * kWidth + j]);
      }
    ASSERT_LT(largest_difference(reconstruct_mesh(device(), shifted).positions, bound.positions), 1e-6 * model.diagonal)
        << named.name;
    double paper = 0;
    for (unsigned seed = 0; seed < 4; ++seed) {
      const Skeleton posed = random_pose(model.skeleton, seed);
      EXPECT_LT(largest_difference(posed_mesh(model, posed).positions, posed_mesh(shifted, posed).positions),
                1e-5 * model.diagonal)
          << named.name;
      paper = std::max(paper,
                       largest_difference(reconstruct_mesh(device(), model, posed, {Deformation::kPaper}).positions,
                                          reconstruct_mesh(device(), shifted, posed, {Deformation::kPaper}).positions));
    }
    // By their own (u, v) texels do move. A lone bone has no separation planes.
    EXPECT_TRUE(paper > 1e-3 * model.diagonal || model.skeleton.bones.size() == 1) << named.name << " " << paper;
  }
}

TEST(Coordinates, APoleGoesWhereAVertexInItsPlaceGoes) {
  SkeletexModel model = model_of(SyntheticSurface(chain(2), 0.2));
  const Lattice lattice = number_lattice(model);
  const TriangleMesh bound = reconstruct_mesh(device(), model);
  const BoneEnd free_end = lattice.poles[0][0] >= 0 ? BoneEnd::kHead : BoneEnd::kTail;
  const int end = static_cast<int>(free_end);
  const int vertex = lattice.first_inner[0] + (end == 0 ? kHeight - 4 : 1) * kWidth + 7;  // beside the seam
  store_texel(model, 0, texel_at(model, 0, end == 0 ? 0 : kHeight - 1, 0), end, 0, bound.positions[vertex]);
  const Skeleton posed = random_pose(model.skeleton, 5);
  const std::vector<Vec3> positions = posed_mesh(model, posed).positions;
  EXPECT_GT((positions[vertex] - bound.positions[vertex]).norm(), 1e-2);
  EXPECT_LT((positions[lattice.poles[0][end]] - positions[vertex]).norm(), 1e-5);
}

TEST(Coordinates, HoldOnRealModels) {
  for (const char* name : {"man", "bear"}) {
    const TestModel source = load_standard_model(name);
    EncodeOptions options;
    options.width = options.height = 128;
    const SkeletexModel model = encode_model(device(), source.mesh, source.skeleton, options).model;
    const TriangleMesh bound = reconstruct_mesh(device(), model);
    EXPECT_LT(largest_difference(posed_mesh(model, apply_pose(model.skeleton, {})).positions, bound.positions),
              1e-6 * model.diagonal)
        << name;
    Pose moved;
    const Eigen::Quaterniond rotation(Eigen::AngleAxisd(2.1, Vec3(1, -2, 0.5).normalized()));
    for (const Node& node : model.skeleton.nodes) moved.nodes.push_back(rotation * node.position);
    std::vector<Vec3> expected = bound.positions;
    for (Vec3& p : expected) p = rotation * p;
    EXPECT_LT(largest_difference(posed_mesh(model, apply_pose(model.skeleton, moved)).positions, expected),
              1e-6 * model.diagonal)
        << name;
    for (unsigned seed = 0; seed < 5; ++seed) {
      const Skeleton posed = random_pose(model.skeleton, seed);
      const TriangleMesh mesh = posed_mesh(model, posed);
      EXPECT_EQ(broken_rule(mesh, model.genus), "") << name;
      // An arc that is thin in the bind pose and opens in this one magnifies the rounding of angles.
      EXPECT_LT(largest_error(model, posed, bound, DistanceRule::kFromBone), 5e-5 * model.diagonal)
          << name << " seed " << seed;
    }
  }
}

TEST(Coordinates, AKneeBendsAlmostWithoutNewFolds) {
  const TestModel source = load_standard_model("man");
  EncodeOptions options;
  options.width = options.height = 256;
  const SkeletexModel model = encode_model(device(), source.mesh, source.skeleton, options).model;
  Pose pose;
  pose.rotations.assign(model.skeleton.bones.size(), Eigen::Quaterniond::Identity());
  const auto shin = std::find_if(model.skeleton.bones.begin(), model.skeleton.bones.end(),
                                 [](const Bone& bone) { return bone.name == "left_shin"; });
  ASSERT_NE(shin, model.skeleton.bones.end());
  pose.rotations[shin - model.skeleton.bones.begin()] = Eigen::AngleAxisd(kPi / 2, Vec3(1, 0, 0));
  const Skeleton posed = apply_pose(model.skeleton, pose);
  const TriangleMesh bound = reconstruct_mesh(device(), model);
  EXPECT_LE(new_folds(bound, posed_mesh(model, posed)), 3u);  // at slivers of the snapped texels
  EXPECT_GT(new_folds(bound, reconstruct_mesh(device(), model, posed, {Deformation::kPaper})),
            500u);  // by the texels' own (u, v)
}

}  // namespace skeletex
