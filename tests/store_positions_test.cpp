// SPDX-License-Identifier: MIT
#include "skeletex/reconstruct/store_positions.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <random>

#include "skeletex/model/error.h"
#include "skeletex/reconstruct/reconstruct_mesh.h"
#include "skeletex/skeleton/separation_planes.h"
#include "support/mesh_topology.h"
#include "support/synthetic_model.h"

namespace skeletex {
namespace {

ClContext& device() {
  static ClContext context;
  return context;
}

std::vector<Skeleton> skeletons() {
  return {lone_bone(), chain(3), y_branch(), cross(6), ring(4), ring_with_arm(5), random_tree(12, 4)};
}

SkeletexModel model_of(const Skeleton& skeleton) {
  return SyntheticSurface(skeleton, 0.25).model(random_sizes(static_cast<int>(skeleton.bones.size()), 8, 40, 5));
}

double largest_distance(const std::vector<Vec3>& a, const std::vector<Vec3>& b) {
  double largest = 0;
  for (std::size_t i = 0; i < a.size(); ++i) largest = std::max(largest, (a[i] - b[i]).norm());
  return largest;
}

}  // namespace

TEST(StorePositions, OfWhereTheVerticesAreChangesNoBit) {
  for (const Skeleton& skeleton : skeletons()) {
    const SkeletexModel model = model_of(skeleton);
    const SkeletexModel same = store_positions(device(), model, lattice_positions(device(), model));
    EXPECT_EQ(same.texture.along, model.texture.along);
    EXPECT_EQ(same.texture.around, model.texture.around);
    EXPECT_EQ(same.texture.out, model.texture.out);
    for (std::size_t a = 0; a < model.arcs.size(); ++a)
      for (std::size_t i = 0; i < model.arcs[a].samples.size(); ++i) {
        EXPECT_EQ(same.arcs[a].samples[i].turn, model.arcs[a].samples[i].turn);
        EXPECT_EQ(same.arcs[a].samples[i].distance, model.arcs[a].samples[i].distance);
      }
  }
}

TEST(StorePositions, BringsBackEveryVertexThatMayLieWhereItIsPut) {
  const unsigned seed = 11;
  SCOPED_TRACE(seed);
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> any(-0.02, 0.02);
  for (const Skeleton& skeleton : skeletons()) {
    const SkeletexModel model = model_of(skeleton);
    const Lattice lattice = number_lattice(model);
    const std::vector<Vec3> old = lattice_positions(device(), model);
    std::vector<Vec3> moved = old;
    // Texels and poles go anywhere, seam samples and corners along the rays from their nodes.
    for (int i = 0; i < lattice.vertex_count; ++i) moved[i] += Vec3(any(random), any(random), any(random));
    for (std::size_t a = 0; a < model.arcs.size(); ++a) {
      const Vec3& node = model.skeleton.nodes[model.arcs[a].node].position;
      for (std::size_t i = 0; i < model.arcs[a].samples.size(); ++i) {
        const std::size_t at = lattice.first_sample[a] + i;
        moved[at] = node + (1 + any(random)) * (old[at] - node);
      }
    }
    for (std::size_t i = 0; i < model.corners.size(); ++i) {
      const Vec3& node = model.skeleton.nodes[model.corners[i].node].position;
      const std::size_t at = lattice.first_corner + i;
      moved[at] = node + (1 + any(random)) * (old[at] - node);
    }
    const SkeletexModel stored = store_positions(device(), model, moved);
    EXPECT_LT(largest_distance(lattice_positions(device(), stored), moved), 1e-6 * model.diagonal)
        << skeleton.bones.size() << " bones";
    EXPECT_EQ(broken_rule(reconstruct_mesh(device(), stored), model.genus), "");
  }
}

TEST(StorePositions, ChangesNoTexelThatHasNotMoved) {
  const SkeletexModel model = model_of(y_branch());
  const Lattice lattice = number_lattice(model);
  std::vector<Vec3> moved = lattice_positions(device(), model);
  const Rectangle& r = model.patches[1].rectangle;
  moved[lattice.first_inner[1] + r.width + 3] += Vec3(0.01, 0, 0);  // row 2, column 3
  const SkeletexModel stored = store_positions(device(), model, moved);
  int changed = 0;
  for (std::size_t i = 0; i < model.texture.out.size(); ++i)
    changed += stored.texture.out[i] != model.texture.out[i] || stored.texture.along[i] != model.texture.along[i] ||
               stored.texture.around[i] != model.texture.around[i];
  EXPECT_EQ(changed, 1);
}

TEST(StorePositions, LetsEndRowsFollowSeamsAndPoles) {
  // Everything nearer to the seam's node, which keeps the seam in its separation plane.
  const SkeletexModel model = model_of(chain(2));
  const Lattice lattice = number_lattice(model);
  const SeparationPlanes separation(model.skeleton);
  const Vec3 node = model.skeleton.nodes[model.arcs[0].node].position;
  std::vector<Vec3> moved = lattice_positions(device(), model);
  for (Vec3& p : moved) p = node + 0.9 * (p - node);
  const SkeletexModel stored = store_positions(device(), model, moved);
  const std::vector<Vec3> now = lattice_positions(device(), stored);
  for (int bone = 0; bone < 2; ++bone)
    for (const BoneEnd end : {BoneEnd::kHead, BoneEnd::kTail}) {
      const Rectangle& r = model.patches[bone].rectangle;
      const bool is_head = end == BoneEnd::kHead;
      const std::vector<int> loop = separation.is_free(bone, end)
                                        ? std::vector<int>{lattice.poles[bone][is_head ? 0 : 1]}
                                        : end_loop(model, lattice, bone, end);
      for (int j = 0; j < r.width; ++j) {
        const std::size_t at =
            static_cast<std::size_t>(r.y + (is_head ? 0 : r.height - 1)) * model.texture.width + r.x + j;
        const Vec3 texel(stored.texture.along[at], stored.texture.around[at], stored.texture.out[at]);
        const Vec3 point = decode_texel(
            tangent_frame(model.skeleton, separation, bone, is_head ? 0 : 1, static_cast<double>(j) / r.width), texel,
            end_position(model.skeleton, bone, BoneEnd::kHead), end_position(model.skeleton, bone, BoneEnd::kTail));
        double distance = (point - now[loop[0]]).norm();
        for (std::size_t i = 0; loop.size() > 1 && i < loop.size(); ++i)
          distance = std::min(distance, distance_to_bone(point, now[loop[i]], now[loop[(i + 1) % loop.size()]]));
        EXPECT_LT(distance, 1e-6 * model.diagonal);
      }
    }
}

TEST(StorePositions, SlidesSeamsIntoTheirSeparationPlanesAlongTheSurface) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> any(-0.01, 0.01);
  for (const Skeleton& skeleton : {chain(3), y_branch(), cross(6), ring(4)}) {
    const SkeletexModel model = model_of(skeleton);
    const Lattice lattice = number_lattice(model);
    const std::vector<Vec3> before = lattice_positions(device(), model);
    std::vector<Vec3> moved = before;
    for (Vec3& p : moved) p += Vec3(any(random), any(random), any(random));
    std::vector<Vec3> slid = moved;
    const std::vector<Vec3> normals(moved.size(), Vec3(0.2, 0.9, 0.3).normalized());
    slide_to_separation(model, normals, slid);
    for (int i = 0; i < lattice.inner_count; ++i) EXPECT_EQ(slid[i], moved[i]);
    for (std::size_t a = 0; a < model.arcs.size(); ++a) {
      const Vec3& node = model.skeleton.nodes[model.arcs[a].node].position;
      Vec3 separation_plane = Vec3::Zero();
      for (const int side : {0, 1}) {
        const int bone = model.arcs[a].bones[side];
        separation_plane +=
            (side == 0 ? 1 : -1) *
            direction_from(skeleton,
                           {bone, skeleton.bones[bone].head == model.arcs[a].node ? BoneEnd::kHead : BoneEnd::kTail});
      }
      for (std::size_t i = 0; i < model.arcs[a].samples.size(); ++i) {
        const std::size_t v = lattice.first_sample[a] + i;
        EXPECT_NEAR(separation_plane.normalized().dot(slid[v] - node), 0, 1e-12);
        if (std::abs(separation_plane.normalized().dot(normals[v])) < 0.9) {
          EXPECT_NEAR(normals[v].dot(slid[v] - moved[v]), 0, 1e-12);
        }
        EXPECT_LT((slid[v] - moved[v]).norm(), 4 * (moved[v] - before[v]).norm());
      }
    }
    for (std::size_t c = 0; c < model.corners.size(); ++c) {
      const Vec3& node = model.skeleton.nodes[model.corners[c].node].position;
      const std::size_t v = lattice.first_corner + c;
      EXPECT_LT((slid[v] - node).cross(before[v] - node).norm(), 1e-12);
      if (std::abs((before[v] - node).normalized().dot(normals[v])) > 0.4) {
        EXPECT_NEAR(normals[v].dot(slid[v] - moved[v]), 0, 1e-12);
      }
    }
  }
}

TEST(StorePositions, RefusesWhatDoesNotFit) {
  const SkeletexModel model = model_of(chain(2));
  std::vector<Vec3> positions = lattice_positions(device(), model);
  positions[3][1] = std::nan("");
  EXPECT_THROW(store_positions(device(), model, positions), InputError);
  positions.pop_back();
  EXPECT_THROW(store_positions(device(), model, positions), InputError);
}

}  // namespace skeletex
