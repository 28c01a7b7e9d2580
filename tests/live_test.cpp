// SPDX-License-Identifier: MIT
#include "skeletex/edit/live.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cstring>
#include <functional>
#include <limits>
#include <random>

#include "skeletex/analysis/manifold.h"
#include "skeletex/convert/encode_model.h"
#include "skeletex/convert/resample/resample.h"
#include "skeletex/edit/morph/blend.h"
#include "skeletex/edit/transfer/transfer.h"
#include "skeletex/model/error.h"
#include "skeletex/reconstruct/pose/pose_mesh.h"
#include "skeletex/reconstruct/reconstruct_mesh.h"
#include "skeletex/skeleton/pose.h"
#include "support/load_model.h"

namespace skeletex {
namespace {

ClContext& device() {
  static ClContext context;
  return context;
}

SkeletexModel encoded(const std::string& name, int size) {
  const TestModel source = load_standard_model(name);
  EncodeOptions options;
  options.width = options.height = size;
  options.has_snap = options.has_fit = false;
  return encode_model(device(), source.mesh, source.skeleton, options).model;
}

Morph morph_of(const SkeletexModel& a, const SkeletexModel& b) {
  MorphOptions options;
  options.layout = 0;
  return Morph(device(), {a, b}, std::vector{find_correspondence(a.skeleton, b.skeleton)}, options);
}

using Queue = std::function<SkeletexModel(DevicePlanes&)>;

SkeletexModel with_texels(const Queue& queue) {
  DevicePlanes texels;
  SkeletexModel model = queue(texels);
  download_texels(device(), texels, model.texture);
  return model;
}

bool same_bits(const std::vector<float>& a, const std::vector<float>& b) {
  return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size() * sizeof(float)) == 0;
}

void expect_same_texels(const SkeletexModel& a, const SkeletexModel& b, const std::string& what) {
  EXPECT_TRUE(same_bits(a.texture.along, b.texture.along)) << what;
  EXPECT_TRUE(same_bits(a.texture.around, b.texture.around)) << what;
  EXPECT_TRUE(same_bits(a.texture.out, b.texture.out)) << what;
}

void expect_closed(const TriangleMesh& mesh, const std::string& what) {
  const ManifoldReport report = measure_manifold(mesh);
  EXPECT_TRUE(report.is_closed_manifold()) << what;
  EXPECT_EQ(report.genus, 0) << what;
  EXPECT_TRUE(report.non_finite_vertices.empty()) << what;
}

}  // namespace

TEST(LiveMorph, IsTheMorphAtItsKeysBitByBitAndNearItInBetween) {
  for (const auto& [first, second] : {std::pair{"bear", "bear_bis"}, {"man", "homer"}, {"bull", "camel"}}) {
    const SkeletexModel a = encoded(first, 96), b = encoded(second, 96);
    const Morph morph = morph_of(a, b);
    const LiveMorph live(device(), morph, {{1, 0}, {0, 1}});
    for (const double t : {0.0, 0.25, 0.5, 0.8125, 1.0}) {
      const std::string what = std::string(first) + " " + std::to_string(t);
      const SkeletexModel exact = with_texels([&](DevicePlanes& texels) {
        return morph.queue(std::vector{1 - t, t}, texels);
      });
      const SkeletexModel between = with_texels([&](DevicePlanes& texels) { return live.queue(t, texels); });
      if (t != 0.8125) expect_same_texels(exact, between, what);
      if (t == 0) expect_same_texels(a, between, what);
      const TriangleMesh mesh = reconstruct_mesh(device(), exact), live_mesh = reconstruct_mesh(device(), between);
      expect_closed(live_mesh, what);
      ASSERT_EQ(mesh.positions.size(), live_mesh.positions.size()) << what;
      double sum = 0;
      for (std::size_t i = 0; i < mesh.positions.size(); ++i)
        sum += (mesh.positions[i] - live_mesh.positions[i]).norm();
      EXPECT_LT(sum / static_cast<double>(mesh.positions.size()), (t == 0.8125 ? 1.2e-3 : 1e-15) * exact.diagonal)
          << what;
    }
  }
}

TEST(LiveMorph, ComesNearerTheMorphTheMoreKeysThereAre) {
  for (const auto& [first, second] : {std::pair{"bear", "bear_bis"}, {"man", "homer"}, {"bull", "camel"}}) {
    const Morph morph = morph_of(encoded(first, 96), encoded(second, 96));
    std::vector<double> errors;
    std::string figures;
    for (const int steps : {2, 4, 8, 16, 32}) {
      const LiveMorph live(device(), morph, {{1, 0}, {0, 1}}, steps);
      double worst = 0;
      for (const double place : {0.2, 0.5, 0.8}) {
        const double t = (std::floor(place * steps) + 0.5) / steps;  // half-way between keys
        const SkeletexModel exact = with_texels([&](DevicePlanes& texels) {
          return morph.queue(std::vector{1 - t, t}, texels);
        });
        const SkeletexModel between = with_texels([&](DevicePlanes& texels) { return live.queue(t, texels); });
        const std::vector<Vec3> wanted = lattice_positions(device(), exact),
                                found = lattice_positions(device(), between);
        double sum = 0;
        for (std::size_t i = 0; i < wanted.size(); ++i) sum += (wanted[i] - found[i]).norm();
        worst = std::max(worst, sum / static_cast<double>(wanted.size()) / exact.diagonal);
      }
      errors.push_back(worst);
      figures += std::to_string(1e6 * worst) + " ";
    }
    RecordProperty(first, figures);
    EXPECT_LT(errors[2], 2e-3) << first << ": " << figures;
    EXPECT_LT(errors[4], 0.05 * errors[0]) << first << ": " << figures;
  }
}

TEST(LiveMorph, GoesAlongAPathAndStopsAtItsEnds) {
  const SkeletexModel a = encoded("bear", 48);
  SkeletexModel b = a, c = a;
  for (float& w : b.texture.out) w *= 1.25f;
  for (float& w : c.texture.out) w *= 0.75f;
  const Correspondence same = identity_correspondence(a.skeleton);
  MorphOptions options;
  options.layout = 1;
  const Morph morph(device(), {a, b, c}, std::vector{same, same}, options);
  const LiveMorph live(device(), morph, {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}, 2);
  EXPECT_EQ(live.weights(1.25), (std::vector{0.0, 0.75, 0.25}));
  for (const auto& [t, model] : {std::pair{-1.0, &a}, {0.0, &a}, {1.0, &b}, {2.0, &c}, {7.0, &c}})
    expect_same_texels(*model, with_texels([&, t = t](DevicePlanes& texels) { return live.queue(t, texels); }),
                       std::to_string(t));
}

TEST(LiveMorph, FramesArePosedLikeAnyModel) {
  const Morph morph = morph_of(encoded("bear", 48), encoded("bear_bis", 48));
  const LiveMorph live(device(), morph, {{1, 0}, {0, 1}}, 2);
  const SkeletexModel frame = with_texels([&](DevicePlanes& texels) { return live.queue(0.3, texels); });
  Pose pose;
  for (const Node& node : frame.skeleton.nodes)
    pose.nodes.push_back(Eigen::AngleAxisd(0.3 * node.position.y() / frame.diagonal, Vec3::UnitX()) * node.position);
  expect_closed(reconstruct_mesh(device(), frame, apply_pose(frame.skeleton, pose)), "posed");
}

TEST(LiveMorph, NeedsALayoutAndAPath) {
  const SkeletexModel a = encoded("bear", 48);
  const Morph any(device(), {a, a}, std::vector{identity_correspondence(a.skeleton)}), one = morph_of(a, a);
  EXPECT_THROW(LiveMorph(device(), any, {{1, 0}, {0, 1}}), InputError);
  EXPECT_THROW(LiveMorph(device(), one, {{1, 0}}), InputError);
  EXPECT_THROW(LiveMorph(device(), one, {{1, 0}, {0, 1}}, 0), InputError);
  EXPECT_THROW(LiveMorph(device(), one, {{1, 0}, {0.5, 1}}), InputError);
  EXPECT_THROW(LiveMorph(device(), one, {{1, 0}, {1}}), InputError);
}

TEST(LiveBlend, GoesFromATransfersTargetToItsResult) {
  const SkeletexModel source = encoded("bear", 96), target = encoded("bear_bis", 96);
  for (const bool has_limbs : {false, true}) {
    TransferOptions options;
    options.has_limbs = has_limbs;
    const SkeletexModel result =
        transfer(device(), source, target,
                 {{has_limbs ? "left_shoulder" : "left_leg", has_limbs ? "left_shoulder" : "left_leg"}}, options);
    const LiveBlend live(device(), target, result);
    for (const double share : {0.0, 0.35, 1.0}) {
      const SkeletexModel frame = live.at(share);
      expect_closed(reconstruct_mesh(device(), frame), std::to_string(share));
      if (share == 0.35) continue;
      const SkeletexModel& end = share == 0 ? target : result;
      expect_same_texels(end, frame, std::to_string(share));
      for (std::size_t p = 0; p < end.patches.size(); ++p) EXPECT_EQ(end.patches[p].row_u, frame.patches[p].row_u);
      for (std::size_t a = 0; a < end.arcs.size(); ++a)
        for (std::size_t i = 0; i < end.arcs[a].samples.size(); ++i)
          EXPECT_EQ(end.arcs[a].samples[i].distance, frame.arcs[a].samples[i].distance);
    }
  }
}

TEST(LiveBlend, RefusesModelsThatDifferInMoreThanTheirSurface) {
  const SkeletexModel model = encoded("bear", 48);
  SkeletexModel other = model;
  other.skeleton.nodes[0].position.x() += 1;
  EXPECT_THROW(LiveBlend(device(), model, other), InputError);
  EXPECT_THROW(LiveBlend(device(), model, resample_model(device(), model, 64)), InputError);
  other = model;
  other.arcs[0].samples.pop_back();
  EXPECT_THROW(LiveBlend(device(), model, other), InputError);
}

TEST(Mix, KernelAndTwinAgreeOnRandomAndUglyTexels) {
  std::mt19937 random(5);
  std::uniform_real_distribution<float> unit(-1, 1);
  const float ugly[] = {
      0.0f, -0.0f, 1e-40f, 1e30f, std::numeric_limits<float>::infinity(), std::numeric_limits<float>::quiet_NaN()};
  for (const auto& [width, height] : {std::pair{1, 1}, {7, 3}, {257, 9}}) {
    std::array<std::vector<float>, 6> planes;
    for (auto& plane : planes)
      for (int i = 0; i < width * height; ++i) plane.push_back(random() % 5 == 0 ? ugly[random() % 6] : unit(random));
    const DevicePlanes first = upload_planes(device(), planes[0], planes[1], planes[2]);
    const DevicePlanes second = upload_planes(device(), planes[3], planes[4], planes[5]);
    for (const float share : {0.0f, 0.3f, 1.0f}) {
      DevicePlanes mixed;
      mix_texels(device(), first, second, share, width, mixed);
      const auto out = download_planes(device(), mixed);
      for (int c = 0; c < 3; ++c) {
        if (share == 0 || share == 1) {
          EXPECT_TRUE(same_bits(out[c], planes[share == 0 ? c : c + 3]));
          continue;
        }
        for (std::size_t i = 0; i < out[c].size(); ++i) {
          const double expected = (1 - share) * planes[c][i] + share * planes[c + 3][i];
          if (std::isfinite(expected))
            ASSERT_NEAR(out[c][i], expected, 1e-6 * std::max(1.0, std::abs(expected)));
          else
            ASSERT_FALSE(std::isfinite(out[c][i]));
        }
      }
    }
  }
}

}  // namespace skeletex
