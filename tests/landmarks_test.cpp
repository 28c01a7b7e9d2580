// SPDX-License-Identifier: MIT
#include "skeletex/edit/morph/landmarks.h"

#include <gtest/gtest.h>

#include <random>

#include "skeletex/analysis/manifold.h"
#include "skeletex/analysis/metro.h"
#include "skeletex/convert/encode_model.h"
#include "skeletex/edit/morph/morph.h"
#include "skeletex/edit/morph/patch_warp.h"
#include "skeletex/model/error.h"
#include "skeletex/reconstruct/reconstruct_mesh.h"
#include "support/load_model.h"

namespace skeletex {
namespace {

ClContext& device() {
  static ClContext context;
  return context;
}

const SkeletexModel& bear() {
  static const SkeletexModel model = [] {
    const TestModel source = load_standard_model("bear");
    EncodeOptions options;
    options.width = options.height = 128;
    options.method = Method::kVsm;
    return encode_model(device(), source.mesh, source.skeleton, options).model;
  }();
  return model;
}

/// A vertex of the reconstruction, at a share of the rows and columns of a bone's patch.
Vec3 surface_point(const std::string& bone_name, double row_share, double column_share) {
  const PreparedModel prepared(bear());
  static const TriangleMesh mesh = reconstruct_mesh(device(), bear());
  for (std::size_t bone = 0; bone < bear().patches.size(); ++bone) {
    if (bear().skeleton.bones[bone].name != bone_name) continue;
    const Rectangle& r = bear().patches[bone].rectangle;
    const int row = static_cast<int>(row_share * (r.height - 3)), column = static_cast<int>(column_share * r.width);
    return mesh.positions[prepared.lattice.first_inner[bone] + row * r.width + column];
  }
  throw InputError("no bone " + bone_name);
}

TEST(PatchWarp, MovesLandmarksToTheirGoalsAndKeepsTheEnds) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> row(8, 52), column(0, 80), step(-6, 6);
  for (int trial = 0; trial < 20; ++trial) {
    std::vector<PlaceMove> moves;
    for (int i = 0; i < 4; ++i) {
      const Eigen::Vector2d from(column(random), row(random));
      moves.push_back({from, from + Eigen::Vector2d(step(random), step(random))});
    }
    const PatchWarp warp(80, 61, moves);
    for (const PlaceMove& move : moves)
      EXPECT_LT((move.from + warp.move(move.from) - move.to).norm(), 1e-6) << "trial " << trial;
    for (double c = 0; c < 80; c += 7) {
      EXPECT_EQ(warp.move({c, 0}).norm(), 0);
      EXPECT_EQ(warp.move({c, 60}).norm(), 0);
      EXPECT_LT((warp.move({c, 30}) - warp.move({c + 80, 30})).norm(), 1e-9) << "columns are periodic";
    }
  }
}

TEST(PatchWarp, IsOneToOne) {
  // Far moves, two of them past each other.
  const std::vector<PlaceMove> moves{{{10, 20}, {26, 22}}, {{26, 32}, {10, 30}}, {{60, 40}, {76, 24}}};
  const PatchWarp warp(80, 61, moves);
  const auto image = [&](double c, double r) { return Eigen::Vector2d(Eigen::Vector2d(c, r) + warp.move({c, r})); };
  for (double c = 0; c < 80; c += 0.5)
    for (double r = 0; r < 60; r += 0.5) {
      const Eigen::Vector2d right = image(c + 0.5, r) - image(c, r), up = image(c, r + 0.5) - image(c, r);
      EXPECT_GT(right.x() * up.y() - right.y() * up.x(), 0) << c << ", " << r;
    }
}

TEST(Landmarks, MeetAndLeaveTheSurface) {
  const std::vector<Landmark> landmarks{
      {"belly", surface_point("left_leg", 0.4, 0.3), surface_point("left_leg", 0.5, 0.4)},
      {"side", surface_point("left_leg", 0.5, 0.8), surface_point("left_leg", 0.4, 0.7)},
      {"ear", surface_point("left_ear", 0.6, 0.2), surface_point("left_ear", 0.5, 0.3)}};
  const Correspondence same = identity_correspondence(bear().skeleton);
  const SkeletexModel aligned = align_landmarks(device(), bear(), bear(), same, landmarks);
  const std::vector<double> before = landmark_distances(device(), bear(), bear(), same, landmarks),
                            after = landmark_distances(device(), bear(), aligned, same, landmarks);
  for (std::size_t i = 0; i < landmarks.size(); ++i) {
    EXPECT_GT(before[i], 0.01) << landmarks[i].name;
    EXPECT_LT(after[i], 0.1 * before[i]) << landmarks[i].name;
  }
  const TriangleMesh own = reconstruct_mesh(device(), bear()), moved = reconstruct_mesh(device(), aligned);
  EXPECT_TRUE(measure_manifold(moved).is_closed_manifold());
  const MetroReport report = measure_metro(device(), own, moved);
  EXPECT_LT(symmetric_mean(report), 1e-4);

  // Half-way the surface is the same again: the mean of two maps of one surface leaves it by its curvature only.
  const Correspondence from_first[] = {same};
  const TriangleMesh half =
      reconstruct_mesh(device(), Morph(device(), {bear(), aligned}, from_first).at(std::vector<double>{0.5, 0.5}));
  EXPECT_LT(symmetric_mean(measure_metro(device(), own, half)), 2e-3);
}

TEST(Landmarks, SayWhyTheyCannotMeet) {
  const Correspondence same = identity_correspondence(bear().skeleton);
  const auto message = [&](const std::vector<Landmark>& landmarks) -> std::string {
    try {
      align_landmarks(device(), bear(), bear(), same, landmarks);
    } catch (const InputError& error) {
      return error.what();
    }
    return "";
  };
  const Vec3 leg = surface_point("left_leg", 0.5, 0.3), ear = surface_point("left_ear", 0.5, 0.3);
  const std::string other_bone = message({{"tip", leg, ear}});
  EXPECT_NE(other_bone.find("\"tip\""), std::string::npos) << other_bone;
  EXPECT_NE(other_bone.find("\"left_leg\""), std::string::npos) << other_bone;
  EXPECT_NE(other_bone.find("\"left_ear\""), std::string::npos) << other_bone;
  const std::string twice = message({{"a", leg, leg}, {"b", leg, leg}});
  EXPECT_NE(twice.find("\"b\" lies at the place of another"), std::string::npos) << twice;
}

}  // namespace
}  // namespace skeletex
