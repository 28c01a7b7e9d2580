// SPDX-License-Identifier: MIT
#include "skeletex/convert/layout/patch_requests.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>

#include "skeletex/analysis/metro.h"
#include "skeletex/convert/encode_model.h"
#include "skeletex/reconstruct/reconstruct_mesh.h"
#include "support/load_model.h"

namespace skeletex {
namespace {

constexpr double kPi = std::numbers::pi;

/// A tube of radius `radius(u)` about z, as facets, its map even in height and angle. Every second diagonal may be
/// turned.
template <class Radius>
Chart tube(int rings, int around, double length, const Radius& radius) {
  Chart chart;
  for (int r = 0; r < rings; ++r)
    for (int j = 0; j < around; ++j) {
      const double u = static_cast<double>(r) / (rings - 1), v = static_cast<double>(j) / around;
      chart.u.push_back(u), chart.v.push_back(v);
      chart.positions.push_back({radius(u) * std::cos(2 * kPi * v), -radius(u) * std::sin(2 * kPi * v), length * u});
      chart.kinds.push_back(r == 0           ? ChartVertex::kHeadRow
                            : r == rings - 1 ? ChartVertex::kTailRow
                                             : ChartVertex::kInner);
    }
  for (int r = 0; r + 1 < rings; ++r)
    for (int j = 0; j < around; ++j) {
      const std::int8_t turn = j + 1 == around ? 1 : 0;
      const int a = r * around + j, b = r * around + (j + 1) % around, c = a + around, d = b + around;
      chart.triangles.push_back({a, c, d}), chart.turns.push_back({0, 0, turn});
      chart.triangles.push_back({a, d, b}), chart.turns.push_back({0, turn, turn});
    }
  chart.half_edges = link_half_edges(chart.triangles, static_cast<int>(chart.positions.size()));
  return chart;
}

TEST(ExpectedError, OfACylinderIsItsCurvatureTimesTheSquareOfItsGirth) {
  for (const double radius : {0.3, 2.0}) {
    const double length = 5;
    const ExpectedError error = expected_error(tube(40, 256, length, [&](double) { return radius; }), nullptr);
    // The integral over the surface of the curvature 1 / radius times the square of the girth.
    const double girth = 2 * kPi * radius, expected = girth * length * girth * girth / radius;
    EXPECT_NEAR(error.around, expected, 0.02 * expected);
    EXPECT_LT(error.along, 1e-6 * error.around);
  }
}

TEST(ExpectedError, OfASurfaceOfRevolutionHasBothCurvatures) {
  // A tube with waves along it: in the limit of small ones the curvature along the bone is that of the profile.
  const double length = 5, depth = 0.02, waves = 6, radius = 0.5;
  const auto profile = [&](double u) { return radius + depth * std::sin(2 * kPi * waves * u); };
  const ExpectedError error = expected_error(tube(1200, 240, length, profile), nullptr);
  double expected = 0;
  constexpr int kSteps = 20000;
  for (int i = 0; i < kSteps; ++i) {
    const double u = (i + 0.5) / kSteps, wave = 2 * kPi * waves;
    const double slope = depth * wave * std::cos(wave * u) / length,
                 bend = std::abs(depth * wave * wave * std::sin(wave * u)) / (length * length);
    // Curvature times the square of the meridian's length per u, times the area.
    const double stretch = std::sqrt(1 + slope * slope);
    expected += bend / (stretch * stretch * stretch) * (length * stretch) * (length * stretch) * 2 * kPi * profile(u) *
                length * stretch / kSteps;
  }
  EXPECT_NEAR(error.along, expected, 0.1 * expected);
}

TEST(ExpectedError, GoesWithTheCubeOfSizeAndTurnsWithTheMap) {
  const auto profile = [](double u) { return 0.4 + 0.2 * u * u; };
  const Chart chart = tube(30, 40, 3, profile);
  Chart larger = chart;
  for (Vec3& p : larger.positions) p *= 3;
  const ExpectedError error = expected_error(chart, nullptr), of_larger = expected_error(larger, nullptr);
  EXPECT_NEAR(of_larger.around, 27 * error.around, 1e-9 * of_larger.around);
  EXPECT_NEAR(of_larger.along, 27 * error.along, 1e-9 * of_larger.along);
  EXPECT_NEAR(of_larger.both, 27 * error.both, 1e-9 * of_larger.around);
  EXPECT_NEAR(of_larger.best_ratio(), error.best_ratio(), 1e-9);
  // The best ratio is the best.
  const double best = error.with_ratio(error.best_ratio());
  for (const double factor : {0.5, 0.9, 1.1, 2.0}) EXPECT_GT(error.with_ratio(factor * error.best_ratio()), best);
  EXPECT_NEAR(error.with_ratio(2.5) / 1000, error.around / 2500 + error.along / 400 + 2 * error.both / 1000,
              1e-9 * error.around);
}

TEST(PatchRequests, GiveAnotherModelTheSameWhateverItsSize) {
  const Chart thin = tube(20, 30, 4, [](double u) { return 0.2 + 0.05 * std::sin(9 * u); }),
              wide = tube(20, 30, 1, [](double u) { return 0.8 - 0.1 * u; });
  const auto requests_at = [&](double scale, bool has_map) {
    Chart charts[2]{thin, wide};
    for (Chart& chart : charts)
      for (Vec3& p : chart.positions) p *= scale;
    const ExpectedError errors[2]{expected_error(charts[0], nullptr), expected_error(charts[1], nullptr)};
    const std::vector<PatchSource> sources{{errors, 1140, 5.0 * scale * scale, 4 * scale},
                                           {has_map ? errors + 1 : nullptr, 1140, 4.7 * scale * scale, scale}};
    return patch_requests(sources, TexelShare::kError);
  };
  for (const bool has_map : {true, false}) {
    const std::vector<PatchRequest> one = requests_at(1, has_map), other = requests_at(20, has_map);
    for (int i = 0; i < 2; ++i) EXPECT_NEAR(one[i].columns_per_row, other[i].columns_per_row, 1e-9);
    EXPECT_NEAR(one[0].share / one[1].share, other[0].share / other[1].share, 1e-9);
    if (!has_map) {
      EXPECT_DOUBLE_EQ(one[1].columns_per_row, 4.7);
    }
  }
}

TEST(PatchRequests, OfWhatBendsAroundTheBoneAloneStayNearGirthToLength) {
  const Chart cylinder = tube(20, 64, 4, [](double) { return 0.2; });
  const ExpectedError error = expected_error(cylinder, nullptr);
  const std::vector<PatchRequest> requests =
      patch_requests(std::vector<PatchSource>{{&error, 2432, 5, 4}}, TexelShare::kError);
  EXPECT_DOUBLE_EQ(requests[0].columns_per_row, 2 * 5.0 / 16);
  EXPECT_TRUE(std::isfinite(requests[0].share) && requests[0].share > 0);
}

TEST(PatchRequests, OfAMapThatIsSqueezedToAPointLeaveTheOthersTheirTexels) {
  const auto profile = [](double u) { return 0.2 + 0.05 * std::sin(9 * u); };
  const Chart usual = tube(24, 12, 4, profile);
  const ExpectedError even = expected_error(usual, nullptr);
  const auto share_of_squeezed = [&](double power) {
    Chart squeezed = usual;
    for (double& u : squeezed.u) u = std::pow(u, power);
    const ExpectedError error = expected_error(squeezed, nullptr);
    const std::vector<PatchRequest> requests =
        patch_requests(std::vector<PatchSource>{{&even, 528, 5, 4}, {&error, 528, 5, 4}}, TexelShare::kError);
    return requests[1].share / (requests[0].share + requests[1].share);
  };
  EXPECT_NEAR(share_of_squeezed(1), 0.5, 1e-9);
  EXPECT_GT(share_of_squeezed(3), 0.6);
  EXPECT_LT(share_of_squeezed(12), 0.86);
  EXPECT_NEAR(share_of_squeezed(15), share_of_squeezed(20), 1e-3);
}

TEST(PatchRequests, OfAMapThatIsSqueezedOutOfTheRangeOfNumbersAreNumbers) {
  constexpr int kRings = 24, kAround = 12;
  Chart chart = tube(kRings, kAround, 4, [](double u) { return 0.2 + 0.05 * std::sin(9 * u); });
  for (std::size_t i = kAround; i < chart.u.size(); ++i) chart.u[i] = std::pow(10, -320 * (1 - chart.u[i]));
  const RowProfile profile = row_profile(chart);
  for (const double share : profile.share) EXPECT_TRUE(std::isfinite(share));
  EXPECT_NEAR(profile.share.back(), 1, 1e-9);
  const ExpectedError error = expected_error(chart, &profile);
  const std::vector<PatchRequest> requests =
      patch_requests(std::vector<PatchSource>{{&error, 528, 5, 4}}, TexelShare::kError);
  EXPECT_TRUE(std::isfinite(requests[0].share) && requests[0].share > 0);
  EXPECT_TRUE(std::isfinite(requests[0].columns_per_row) && requests[0].columns_per_row > 0);
}

TEST(PatchRequests, ByErrorHaveLessOfItThanByTriangles) {
  ClContext context;
  double product = 1;
  for (const char* const name : {"bunny00", "camel", "man", "bear"}) {
    const TestModel model = load_standard_model(name);
    const auto mean_with = [&](TexelShare share) {
      EncodeOptions options;
      options.width = options.height = 256;
      options.texel_share = share;
      const SkeletexModel encoded = encode_model(context, model.mesh, model.skeleton, options).model;
      return symmetric_mean(measure_metro(context, model.mesh, reconstruct_mesh(context, encoded)));
    };
    const double ratio = mean_with(TexelShare::kError) / mean_with(TexelShare::kTriangles);
    RecordProperty(name, std::to_string(ratio));
    EXPECT_LT(ratio, 1.03) << name;
    product *= ratio;
  }
  EXPECT_LT(std::pow(product, 0.25), 0.85);
}

}  // namespace
}  // namespace skeletex
