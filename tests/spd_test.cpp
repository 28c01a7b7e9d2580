// SPDX-License-Identifier: MIT
#include "skeletex/convert/parameterize/spd.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>
#include <string>

#include "skeletex/convert/encode_model.h"
#include "skeletex/convert/segment/segment_mesh.h"
#include "support/load_model.h"
#include "support/random_skeleton.h"
#include "support/segments.h"
#include "support/spd_twin.h"

namespace skeletex {
namespace {

using test::random_between;
using test::random_direction;
using testing::MadeSegment;
using testing::ProfilePoint;
using testing::revolve;

constexpr double kPi = std::numbers::pi;

ClContext& context() {
  static ClContext shared;
  return shared;
}

Patch patch_of(int width, int height) {
  Patch patch;
  patch.rectangle = {0, 0, width, height};
  for (int r = 0; r < height; ++r) patch.row_u.push_back(static_cast<double>(r) / (height - 1));
  return patch;
}

SpdHits cast(const Skeleton& skeleton, const Chart& chart, const Patch& patch, SpdHit which) {
  return cast_spd_rays(context(), skeleton, SeparationPlanes(skeleton), std::span(&chart, 1), std::span(&patch, 1),
                       which)[0];
}

double unseen(const Skeleton& skeleton, const Chart& chart) {
  return unseen_area_fractions(skeleton, SeparationPlanes(skeleton), std::span(&chart, 1))[0];
}

Chart chart_of(const MadeSegment& made) {
  return make_chart(made.segment, made.skeleton, SeparationPlanes(made.skeleton));
}

/// Triangles alone: enough for rays.
Chart bare_chart(int bone, std::vector<Vec3> positions, std::vector<Triangle> triangles) {
  Chart chart;
  chart.bone = bone;
  chart.positions = std::move(positions);
  chart.triangles = std::move(triangles);
  return chart;
}

/// A stem of radius 0.3 with a brim of radius 1 that droops: rays at heights from 0.3 to 0.6 meet stem, underside and
/// rim.
std::vector<ProfilePoint> brim_profile() {
  return {{0.3, 0}, {0.3, 0.3}, {0.3, 0.6}, {1, 0.3}, {1, 0.6}, {1, 0.7}, {0.3, 0.8}, {0.3, 1}};
}

/// A bone from (0, 0, 0) to (0, 0, 1), bone 0, with one neighbour at each end that leans by the given angles.
Skeleton bent_skeleton(double head_lean, double tail_lean) {
  return {{{"head", {0, 0, 0}},
           {"tail", {0, 0, 1}},
           {"before", {std::sin(head_lean), 0, -std::cos(head_lean)}},
           {"after", {0, std::sin(tail_lean), 1 + std::cos(tail_lean)}}},
          {{"bone", 0, 1, Vec3(1, 0, 0)}, {"before", 2, 0, {}}, {"after", 1, 3, {}}}};
}

/// Triangles at random around the unit bone, some of them across its axis.
Chart random_soup(int count, double size, double radius, std::mt19937& random) {
  std::vector<Vec3> positions;
  std::vector<Triangle> triangles;
  for (int i = 0; i < count; ++i) {
    const double angle = random_between(random, 0, 2 * kPi),
                 r = i % 4 == 0 ? random_between(random, 0, 0.1) : random_between(random, 0.1, radius);
    const Vec3 centre(r * std::cos(angle), r * std::sin(angle), random_between(random, -0.3, 1.3));
    triangles.push_back({3 * i, 3 * i + 1, 3 * i + 2});
    for (int corner = 0; corner < 3; ++corner) positions.push_back(centre + size * random_direction(random));
  }
  return bare_chart(0, std::move(positions), std::move(triangles));
}

/// The device's hits lie between those with triangles a little shrunk and a little widened: rays that pass an edge
/// within single precision may fall either way.
void expect_hits_of_twin(const Skeleton& skeleton, const Chart& chart, const Patch& patch, SpdHit which) {
  const SeparationPlanes separation(skeleton);
  const SpdHits hits = cast(skeleton, chart, patch, which);
  const double slack = 2e-3;
  int found = 0;
  for (int r = 0; r < patch.rectangle.height; ++r)
    for (int j = 0; j < patch.rectangle.width; ++j) {
      const int at = r * patch.rectangle.width + j;
      SCOPED_TRACE("row " + std::to_string(r) + ", column " + std::to_string(j));
      const TangentFrame frame = tangent_frame(skeleton, separation, chart.bone, patch.row_u[r],
                                               static_cast<double>(j) / patch.rectangle.width);
      const auto wide = testing::hits_of_ray(chart, frame.foot, frame.out, slack),
                 narrow = testing::hits_of_ray(chart, frame.foot, frame.out, -slack);
      const double sign = which == SpdHit::kFirst ? 1 : -1;
      if (hits.triangles[at] < 0) {
        EXPECT_TRUE(narrow.empty());
        EXPECT_EQ(hits.distances[at], 0);
        continue;
      }
      ++found;
      const double distance = hits.distances[at];
      bool is_a_hit = false;
      // A triangle that the ray grazes turns rounding across the ray into an error along it.
      for (const auto& hit : wide) {
        const Triangle& t = chart.triangles[hit.triangle];
        const Vec3 normal = (chart.positions[t[1]] - chart.positions[t[0]])
                                .cross(chart.positions[t[2]] - chart.positions[t[0]])
                                .normalized();
        const double sine = std::abs(normal.dot(frame.out));
        is_a_hit = is_a_hit || (hit.triangle == hits.triangles[at] && std::abs(hit.distance - distance) < 2e-6 / sine);
      }
      EXPECT_TRUE(is_a_hit);
      for (const auto& hit : narrow) EXPECT_LE(sign * distance, sign * hit.distance + 1e-4);
    }
  EXPECT_GT(found, 0);
}

}  // namespace

TEST(Spd, RaysMeetACylinderAtItsRadius) {
  const int n = 24;
  const MadeSegment made = revolve(testing::cylinder_profile(7), {.columns = n});
  for (const int width : {n, 37}) {
    const Patch patch = patch_of(width, 19);
    const SpdHits hits = cast(made.skeleton, chart_of(made), patch, SpdHit::kLast);
    for (int at = 0; at < width * 19; ++at) {
      // The cylinder's section is a regular polygon.
      const double turn = static_cast<double>(at % width) / width, inside = turn * n - std::floor(turn * n) - 0.5;
      EXPECT_NEAR(hits.distances[at], std::cos(kPi / n) / std::cos(2 * kPi * inside / n), 1e-6);
      EXPECT_GE(hits.triangles[at], 0);
    }
  }
}

TEST(Spd, RaysMeetAConeAtItsRadius) {
  const MadeSegment made = revolve({{1, 0}, {0.75, 0.5}, {0.5, 1}}, {.columns = 16});
  const Patch patch = patch_of(16, 33);
  const SpdHits hits = cast(made.skeleton, chart_of(made), patch, SpdHit::kFirst);
  for (int at = 0; at < 16 * 33; ++at) EXPECT_NEAR(hits.distances[at], 1 - 0.5 * patch.row_u[at / 16], 1e-6);
}

TEST(Spd, RaysMeetASphereAtItsClosedForm) {
  // Around the middle of a lone bone: distance from a foot at z along a direction with cosine c to the axis.
  const double radius = 1.25;
  std::vector<ProfilePoint> profile;
  const int steps = 4000;
  for (int i = 0; i <= steps; ++i) {
    const double latitude = kPi * i / steps;
    profile.push_back({i == 0 || i == steps ? 0 : radius * std::sin(latitude), 0.5 - radius * std::cos(latitude)});
  }
  const MadeSegment made = revolve(profile, {.columns = 8});
  const SeparationPlanes separation(made.skeleton);
  const Patch patch = patch_of(8, 61);
  const SpdHits hits = cast(made.skeleton, chart_of(made), patch, SpdHit::kLast);
  for (int at = 0; at < 8 * 61; ++at) {
    const TangentFrame frame =
        tangent_frame(made.skeleton, separation, made.bone(), patch.row_u[at / 8], (at % 8) / 8.0);
    const Vec3 offset = frame.foot - Vec3(0, 0, 0.5);
    const double along = offset.dot(frame.out);
    EXPECT_NEAR(hits.distances[at], -along + std::sqrt(along * along + radius * radius - offset.squaredNorm()), 1e-5)
        << at;
  }
}

TEST(Spd, RaysMeetACapsuleAtItsRadius) {
  std::vector<ProfilePoint> profile;
  const int steps = 1000;
  for (int i = 0; i <= steps; ++i)
    profile.push_back({i == 0 ? 0 : 0.4 * std::sin(0.5 * kPi * i / steps), -0.4 * std::cos(0.5 * kPi * i / steps)});
  for (int i = 0; i <= steps; ++i)
    profile.push_back(
        {i == steps ? 0 : 0.4 * std::cos(0.5 * kPi * i / steps), 1 + 0.4 * std::sin(0.5 * kPi * i / steps)});
  const MadeSegment made = revolve(profile, {.columns = 12});
  const SpdHits hits = cast(made.skeleton, chart_of(made), patch_of(12, 50), SpdHit::kFirst);
  for (const float distance : hits.distances) EXPECT_NEAR(distance, 0.4, 1e-6);
}

TEST(Spd, RaysLeanWithTheSeparationPlanesOfNeighbours) {
  const Skeleton skeleton = bent_skeleton(0.5, -0.8);
  const SeparationPlanes separation(skeleton);
  // A tube that goes on past both separation planes.
  MadeSegment made = revolve({{0.5, -1}, {0.5, 2}}, {.columns = 20});
  const Chart chart = bare_chart(0, made.segment.mesh.positions, made.segment.mesh.triangles);
  const Patch patch = patch_of(20, 31);
  const SpdHits hits = cast(skeleton, chart, patch, SpdHit::kLast);
  for (int r = 0; r < 31; ++r)
    for (int j = 0; j < 20; ++j) {
      const double u = patch.row_u[r], k = (1 - u) * separation.slope(0, BoneEnd::kHead, j / 20.0) +
                                           u * separation.slope(0, BoneEnd::kTail, j / 20.0);
      EXPECT_NEAR(hits.distances[r * 20 + j], 0.5 * std::hypot(1, k), 1e-6);
    }
}

TEST(Spd, FindsWhatABruteForceSearchFindsAmongRandomTriangles) {
  std::mt19937 random(11);
  for (int trial = 0; trial < 6; ++trial) {
    SCOPED_TRACE("soup " + std::to_string(trial));
    // The separation planes meet at 2 and beyond: inside of 0.9 the rays of a column do not cross.
    const Skeleton skeleton = bent_skeleton(random_between(random, -0.4, 0.4), random_between(random, -0.4, 0.4));
    const Chart chart = random_soup(trial < 3 ? 60 : 400, trial % 3 == 0 ? 0.4 : 0.1, 0.9, random);
    for (const SpdHit which : {SpdHit::kFirst, SpdHit::kLast})
      expect_hits_of_twin(skeleton, chart, patch_of(23, 17), which);
  }
}

TEST(Spd, FindsWhatABruteForceSearchFindsInCaps) {
  std::mt19937 random(12);
  const std::vector<Skeleton> skeletons{{{{"head", {0, 0, 0}}, {"tail", {0, 0, 1}}}, {{"bone", 0, 1, Vec3(1, 0, 0)}}},
                                        {{{"head", {0, 0, 0}}, {"tail", {0, 0, 1}}, {"before", {0.2, 0.1, -1}}},
                                         {{"bone", 0, 1, Vec3(1, 0, 0)}, {"before", 2, 0, {}}}},
                                        {{{"head", {0, 0, 0}}, {"tail", {0, 0, 1}}, {"after", {0.2, 0.1, 2}}},
                                         {{"bone", 0, 1, Vec3(1, 0, 0)}, {"after", 1, 2, {}}}}};
  for (const Skeleton& skeleton : skeletons)
    for (const SpdHit which : {SpdHit::kFirst, SpdHit::kLast}) {
      const Chart chart = random_soup(150, 0.3, 0.9, random);
      Patch patch = patch_of(19, 23);
      // Exactly at the pole the column does not matter and every triangle on the axis would do.
      patch.row_u.front() = 0.003;
      patch.row_u.back() = 0.997;
      expect_hits_of_twin(skeleton, chart, patch, which);
    }
}

TEST(Spd, FirstAndLastHitDifferUnderAnOverhang) {
  const MadeSegment made = revolve(brim_profile(), {.columns = 24});
  const Chart chart = chart_of(made);
  const Patch patch = patch_of(24, 51);
  const SpdHits first = cast(made.skeleton, chart, patch, SpdHit::kFirst),
                last = cast(made.skeleton, chart, patch, SpdHit::kLast);
  for (int r = 0; r < 51; ++r)
    for (int j = 0; j < 24; ++j) {
      const double z = patch.row_u[r];
      const bool is_over = z > 0.3 + 1e-6 && z < 0.6 - 1e-6;
      const bool is_seen = z < 0.3 - 1e-6 || z > 0.6 + 1e-6;
      if (is_over) {
        EXPECT_NEAR(first.distances[r * 24 + j], 0.3, 1e-6);
        EXPECT_NEAR(last.distances[r * 24 + j], 1, 1e-6);
      } else if (is_seen) {
        EXPECT_EQ(first.distances[r * 24 + j], last.distances[r * 24 + j]);
      }
    }
  expect_hits_of_twin(made.skeleton, chart, patch_of(11, 13), SpdHit::kFirst);
  expect_hits_of_twin(made.skeleton, chart, patch_of(11, 13), SpdHit::kLast);
}

TEST(Spd, AnOverhangIsUnseenAndSoIsWhatItHides) {
  const MadeSegment made = revolve(brim_profile(), {.columns = 24});
  const Chart chart = chart_of(made);
  double hidden = 0, area = 0;
  for (const Triangle& t : chart.triangles) {
    const Vec3 centre = (chart.positions[t[0]] + chart.positions[t[1]] + chart.positions[t[2]]) / 3;
    const double a =
        0.5 *
        (chart.positions[t[1]] - chart.positions[t[0]]).cross(chart.positions[t[2]] - chart.positions[t[0]]).norm();
    area += a;
    if (centre.z() < 0.6 && std::hypot(centre.x(), centre.y()) > 0.31) hidden += a;
  }
  EXPECT_NEAR(unseen(made.skeleton, chart), hidden / area, 1e-12);
}

TEST(Spd, EveryRayOfAClosedSegmentMeetsIt) {
  // Also those along seams and poles, those through vertices and along edges, and those of slivers.
  std::mt19937 random(13);
  const std::vector<ProfilePoint> profiles[] = {testing::cylinder_profile(12), testing::cap_profile(20),
                                                testing::capsule_profile(24), brim_profile()};
  for (int trial = 0; trial < 24; ++trial) {
    SCOPED_TRACE("trial " + std::to_string(trial));
    const auto& profile = profiles[trial % 4];
    MadeSegment made = revolve(
        profile,
        {.columns = 8 + trial, .noise = trial % 4 == 3 ? 0 : 0.1, .has_random_diagonals = true, .seed = 5u + trial});
    if (trial >= 8) testing::insert_random_vertices(made.segment, 300, random);
    const Eigen::Matrix3d rotation =
        Eigen::Quaterniond(Eigen::AngleAxisd(random_between(random, 0, 6), random_direction(random)))
            .toRotationMatrix();
    if (trial >= 4) testing::transform(made, rotation, random_between(random, 1e-3, 1e3), 3 * random_direction(random));
    const Chart chart = chart_of(made);
    for (const int width : {8 + trial, 64}) {
      const SpdHits hits =
          cast(made.skeleton, chart, patch_of(width, 100), trial % 2 == 0 ? SpdHit::kFirst : SpdHit::kLast);
      int misses = 0;
      for (std::size_t at = 0; at < hits.triangles.size(); ++at)
        misses += hits.triangles[at] < 0 || !(hits.distances[at] > 0);
      EXPECT_EQ(misses, 0) << "of " << hits.triangles.size();
    }
  }
}

TEST(Spd, HitsLieOnTheirTriangles) {
  std::mt19937 random(14);
  MadeSegment made = revolve(testing::capsule_profile(24), {.columns = 20, .noise = 0.1, .has_random_diagonals = true});
  testing::transform(made, Eigen::Quaterniond(Eigen::AngleAxisd(1.1, random_direction(random))).toRotationMatrix(), 10,
                     {5, 6, 7});
  const Chart chart = chart_of(made);
  const SeparationPlanes separation(made.skeleton);
  const Patch patch = patch_of(50, 60);
  const SpdHits hits = cast(made.skeleton, chart, patch, SpdHit::kLast);
  for (int at = 0; at < 50 * 60; ++at) {
    const TangentFrame frame =
        tangent_frame(made.skeleton, separation, made.bone(), patch.row_u[at / 50], (at % 50) / 50.0);
    const Vec3 point = frame.foot + static_cast<double>(hits.distances[at]) * frame.out;
    const Triangle& t = chart.triangles[hits.triangles[at]];
    const Vec3 normal = (chart.positions[t[1]] - chart.positions[t[0]])
                            .cross(chart.positions[t[2]] - chart.positions[t[0]])
                            .normalized();
    EXPECT_LT(std::abs(normal.dot(point - chart.positions[t[0]])), 2e-5) << "of a body of size 20";
  }
}

TEST(Spd, CoordinatesAreThoseOfTheRayThroughThePoint) {
  std::mt19937 random(15);
  for (int trial = 0; trial < 30; ++trial) {
    const Skeleton skeleton = test::random_tree(8, random);
    const SeparationPlanes separation(skeleton);
    for (int bone = 0; bone < 8; ++bone)
      for (int sample = 0; sample < 20; ++sample) {
        const double u = random_between(random, 0.01, 0.99), turn = random_between(random, 0, 1);
        const TangentFrame frame = tangent_frame(skeleton, separation, bone, u, turn);
        const double k_head = separation.slope(bone, BoneEnd::kHead, turn),
                     k_tail = separation.slope(bone, BoneEnd::kTail, turn);
        // Not past where both separation planes meet.
        const double limit = k_head > k_tail ? bone_length(skeleton, bone) / (k_head - k_tail) : 1e9;
        const double across = frame.out.dot(separation.radial(bone, turn));
        const double distance = random_between(random, 0.01, std::min(2.0, 0.9 * limit / across));
        const SpdCoordinates at = spd_coordinates(skeleton, separation, bone, frame.foot + distance * frame.out);
        EXPECT_NEAR(at.u, u, 1e-11);
        EXPECT_LT(test::turn_distance(at.turn, turn), 1e-11 / across / distance);
      }
  }
}

TEST(Spd, CoordinatesLeaveTheMapOutsideTheCell) {
  const Skeleton skeleton = bent_skeleton(0.5, -0.8);
  const SeparationPlanes separation(skeleton);
  std::mt19937 random(16);
  for (int trial = 0; trial < 2000; ++trial) {
    const Vec3 point = Vec3(0, 0, 0.5) + random_between(random, 0.1, 8) * random_direction(random);
    const SpdCoordinates at = spd_coordinates(skeleton, separation, 0, point);
    const Vec3 o(0, 0, 1);
    const bool is_before = point.dot(o - direction_from(skeleton, {1, BoneEnd::kTail})) < 0;
    const bool is_after = (point - o).dot(-o - direction_from(skeleton, {2, BoneEnd::kHead})) < 0;
    EXPECT_EQ(at.u < 0 || at.u > 1, is_before || is_after);
    if (is_before != is_after) {
      EXPECT_EQ(at.u < 0, is_before);
    }
    EXPECT_TRUE(std::isfinite(at.u));
  }
}

TEST(Spd, NothingOfAConvexSegmentIsUnseen) {
  for (const auto& profile : {testing::cylinder_profile(9), testing::cap_profile(20), testing::capsule_profile(30)}) {
    const MadeSegment made = revolve(profile, {.columns = 21});
    EXPECT_EQ(unseen(made.skeleton, chart_of(made)), 0);
  }
}

TEST(Spd, UnseenAreaIsThatOfABruteForceSearch) {
  std::mt19937 random(17);
  for (int trial = 0; trial < 4; ++trial) {
    const MadeSegment made =
        revolve(brim_profile(), {.columns = 14 + trial, .noise = 0.05, .has_random_diagonals = true});
    const Chart chart = chart_of(made);
    EXPECT_NEAR(unseen(made.skeleton, chart),
                testing::unseen_area_fraction_twin(made.skeleton, SeparationPlanes(made.skeleton), chart), 1e-9);
  }
  for (int trial = 0; trial < 4; ++trial) {
    const Skeleton skeleton = bent_skeleton(random_between(random, -0.4, 0.4), random_between(random, -0.4, 0.4));
    const Chart chart = random_soup(300, 0.2, 0.9, random);
    // A triangle may fall either way when an edge of another passes its centre within single precision.
    EXPECT_NEAR(unseen(skeleton, chart),
                testing::unseen_area_fraction_twin(skeleton, SeparationPlanes(skeleton), chart), 0.01);
  }
}

TEST(Spd, WhatLiesBehindASeparationPlaneIsUnseen) {
  const MadeSegment made = revolve({{0.5, -1}, {0.5, 0}, {0.5, 1}, {0.5, 2}}, {.columns = 16});
  EXPECT_NEAR(unseen(bent_skeleton(0, 0), bare_chart(0, made.segment.mesh.positions, made.segment.mesh.triangles)),
              2 / 3.0, 1e-12);
}

TEST(Spd, EveryRayOfRealModelsMeetsThemAndAllOfABearIsSeen) {
  for (const auto& [name, unseen_share] :
       {std::pair{"bear", 0.0}, {"bunny00", 0.0345}, {"armadillo", 0.0366}, {"eight", 0.0}}) {
    SCOPED_TRACE(name);
    const TestModel model = load_standard_model(name);
    const SeparationPlanes separation(model.skeleton);
    const Segmentation segmentation = segment_mesh(context(), model.mesh, model.skeleton);
    std::vector<Chart> charts;
    std::vector<Patch> patches;
    for (const Segment& segment : segmentation.segments) {
      charts.push_back(make_chart(segment, model.skeleton, separation));
      patches.push_back(patch_of(90, 80));
    }
    for (const SpdHits& hits : cast_spd_rays(context(), model.skeleton, separation, charts, patches, SpdHit::kLast))
      EXPECT_EQ(std::count(hits.triangles.begin(), hits.triangles.end(), -1), 0);
    const std::vector<double> shares = unseen_area_fractions(model.skeleton, separation, charts);
    double hidden = 0, area = 0;
    for (std::size_t i = 0; i < charts.size(); ++i) {
      const double a = surface_area(segmentation.segments[i].mesh);
      hidden += shares[i] * a;
      area += a;
      if (charts[i].triangles.size() < 2000)
        EXPECT_NEAR(shares[i], testing::unseen_area_fraction_twin(model.skeleton, separation, charts[i]), 3e-4)
            << model.skeleton.bones[i].name;
    }
    // The shares are those that Embree finds with the same rays.
    EXPECT_NEAR(hidden / area, unseen_share, 5e-4);
  }
}

TEST(Spd, ChartsDoNotDisturbEachOther) {
  std::mt19937 random(18);
  const Skeleton skeleton = bent_skeleton(0.3, 0.2);
  const SeparationPlanes separation(skeleton);
  std::vector<Chart> charts;
  std::vector<Patch> patches;
  for (int i = 0; i < 4; ++i) {
    charts.push_back(random_soup(100, 0.3, 1, random));
    charts.back().bone = i % 3;
    patches.push_back(patch_of(9 + 5 * i, 70 - 17 * i));
  }
  charts.push_back(bare_chart(1, {}, {}));
  patches.push_back(patch_of(4, 4));
  const auto together = cast_spd_rays(context(), skeleton, separation, charts, patches, SpdHit::kLast);
  const auto shares = unseen_area_fractions(skeleton, separation, charts);
  ASSERT_EQ(together.size(), 5u);
  for (int i = 0; i < 5; ++i) {
    // Tolerances at seams are relative to the largest chart, so that it goes along.
    const auto alone = cast_spd_rays(context(), skeleton, separation, std::span(&charts[i], 1),
                                     std::span(&patches[i], 1), SpdHit::kLast)[0];
    EXPECT_EQ(together[i].triangles, alone.triangles);
    EXPECT_EQ(together[i].distances, alone.distances);
    EXPECT_EQ(shares[i], unseen(skeleton, charts[i]));
  }
  EXPECT_EQ(together[4].triangles, std::vector<int>(16, -1));
}

TEST(Spd, GivesTheSameBytesTwiceAndTheSameDistancesForRenumberedTriangles) {
  std::mt19937 random(19);
  const Skeleton skeleton = bent_skeleton(0.3, 0.2);
  Chart chart = random_soup(300, 0.3, 0.9, random);
  const Patch patch = patch_of(40, 90);
  const SpdHits a = cast(skeleton, chart, patch, SpdHit::kFirst), b = cast(skeleton, chart, patch, SpdHit::kFirst);
  EXPECT_EQ(a.triangles, b.triangles);
  EXPECT_EQ(a.distances, b.distances);
  std::shuffle(chart.triangles.begin(), chart.triangles.end(), random);
  EXPECT_EQ(cast(skeleton, chart, patch, SpdHit::kFirst).distances, a.distances);
}

TEST(Spd, TheLowestNumberWinsAmongEqualTriangles) {
  MadeSegment made = revolve(testing::cylinder_profile(2), {.columns = 6});
  auto triangles = made.segment.mesh.triangles;
  const int count = static_cast<int>(triangles.size());
  triangles.insert(triangles.end(), made.segment.mesh.triangles.begin(), made.segment.mesh.triangles.end());
  const Chart chart = bare_chart(made.bone(), made.segment.mesh.positions, triangles);
  for (const SpdHit which : {SpdHit::kFirst, SpdHit::kLast})
    for (const int triangle : cast(made.skeleton, chart, patch_of(13, 9), which).triangles) EXPECT_LT(triangle, count);
}

TEST(Spd, FalseSurfacesAreReportedWhereRaysMeetTheSurfaceTwice) {
  const auto false_bones = [](const char* name, Method method) {
    const TestModel model = load_standard_model(name);
    EncodeOptions options;
    options.width = options.height = 128;
    options.method = method;
    const EncodeReport report = encode_model(context(), model.mesh, model.skeleton, options).report;
    return std::count_if(report.bones.begin(), report.bones.end(),
                         [&](const BoneReport& bone) { return has_false_surface(bone, report.diagonal); });
  };
  EXPECT_GT(false_bones("man", Method::kSpd), 0);
  EXPECT_EQ(false_bones("man", Method::kVsm), 0);
  EXPECT_EQ(false_bones("bear", Method::kSpd), 0);
}

}  // namespace skeletex
