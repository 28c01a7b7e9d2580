// SPDX-License-Identifier: MIT
#include <gtest/gtest.h>

#include <numbers>
#include <random>

#include "skeletex/convert/layout/row_profile.h"
#include "skeletex/convert/sample/read_texels.h"
#include "skeletex/convert/sample/sample_seams.h"
#include "skeletex/model/frame.h"
#include "support/encode_twin.h"

namespace skeletex {
namespace {

constexpr double kPi = std::numbers::pi;

Skeleton straight_chain(int bones) {
  Skeleton skeleton;
  for (int i = 0; i <= bones; ++i) skeleton.nodes.push_back({"n" + std::to_string(i), Vec3(0.1 * i, 0.2, i)});
  for (int i = 0; i < bones; ++i) skeleton.bones.push_back({"b" + std::to_string(i), i, i + 1, Vec3(1, 0, 0)});
  return skeleton;
}

/// A map that is a jittered lattice of rows x columns vertices, squeezed towards u = 0 by `power`, of a bumpy tube
/// around a bone; with poles it is closed at both ends. Random diagonals.
Chart jittered_chart(const Skeleton& skeleton, const SeparationPlanes& separation, int bone, int rows, int columns,
                     double power, bool has_poles, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> jitter(-0.35, 0.35);
  Chart chart;
  chart.bone = bone;
  chart.topology = has_poles ? SegmentTopology::kSphere : SegmentTopology::kAnnulus;
  const Vec3 head = end_position(skeleton, bone, BoneEnd::kHead), tail = end_position(skeleton, bone, BoneEnd::kTail);
  const auto place = [&](double u, double v) {
    const double radius = has_poles ? 0.4 * std::sin(kPi * (0.02 + 0.96 * u)) : 0.4 + 0.05 * std::sin(6 * kPi * v);
    return Vec3(head + u * (tail - head) + radius * separation.radial(bone, v));
  };
  const int begin = has_poles ? 1 : 0, end = has_poles ? rows - 1 : rows;
  for (int r = begin; r < end; ++r)
    for (int j = 0; j < columns; ++j) {
      const bool is_row = !has_poles && (r == 0 || r == rows - 1);
      const double u = std::pow((r + (is_row ? 0 : jitter(random))) / (rows - 1), power);
      const double v = (j + jitter(random) * 0.9) / columns;
      chart.u.push_back(is_row ? (r == 0 ? 0 : 1) : u);
      chart.v.push_back(v);
      chart.positions.push_back(place(chart.u.back(), v));
      chart.kinds.push_back(!is_row ? ChartVertex::kInner : r == 0 ? ChartVertex::kHeadRow : ChartVertex::kTailRow);
    }
  const auto add = [&](int a, int ta, int b, int tb, int c, int tc) {
    chart.triangles.push_back({a, b, c});
    chart.turns.push_back({static_cast<std::int8_t>(ta), static_cast<std::int8_t>(tb), static_cast<std::int8_t>(tc)});
  };
  for (int r = 0; r + 1 < end - begin; ++r)
    for (int j = 0; j < columns; ++j) {
      const int k = (j + 1) % columns, t = j + 1 == columns ? 1 : 0;
      const int a = r * columns + j, b = r * columns + k, c = (r + 1) * columns + k, d = (r + 1) * columns + j;
      if (random() % 2)
        add(a, 0, b, t, c, t), add(a, 0, c, t, d, 0);
      else
        add(a, 0, b, t, d, 0), add(b, t, c, t, d, 0);
    }
  if (has_poles) {
    const int head_pole = static_cast<int>(chart.u.size()), tail_pole = head_pole + 1;
    for (const int u : {0, 1}) {
      chart.u.push_back(u), chart.v.push_back(0), chart.positions.push_back(u ? tail : head);
      chart.kinds.push_back(u ? ChartVertex::kTailPole : ChartVertex::kHeadPole);
    }
    for (int j = 0; j < columns; ++j) {
      const int k = (j + 1) % columns, t = j + 1 == columns ? 1 : 0, last = (end - begin - 1) * columns;
      add(head_pole, 0, k, t, j, 0);
      add(last + j, 0, last + k, t, tail_pole, 0);
    }
  }
  chart.half_edges = link_half_edges(chart.triangles, static_cast<int>(chart.positions.size()));
  return chart;
}

struct Setting {
  Skeleton skeleton;
  std::vector<Chart> charts;
  std::vector<Patch> patches;
  std::vector<SpdHits> hits;
  std::vector<std::array<std::vector<Vec3>, 2>> end_points;
};

Setting random_setting(unsigned seed, double power) {
  Setting s;
  s.skeleton = straight_chain(1);
  const SeparationPlanes separation(s.skeleton);
  std::mt19937 random(seed);
  const int rows = 5 + static_cast<int>(random() % 12), columns = 3 + static_cast<int>(random() % 14);
  s.charts.push_back(jittered_chart(s.skeleton, separation, 0, rows, columns, power, true, seed));
  const int width = 4 + static_cast<int>(random() % 60), height = 4 + static_cast<int>(random() % 60);
  s.patches.push_back({{static_cast<int>(random() % 5), static_cast<int>(random() % 7), width, height},
                       Method::kVsm,
                       SegmentTopology::kSphere,
                       spread_rows_by_length(row_profile(s.charts[0]), height)});
  s.hits.resize(1);
  s.end_points.push_back({std::vector<Vec3>{s.charts[0].positions[s.charts[0].positions.size() - 2]},
                          std::vector<Vec3>{s.charts[0].positions.back()}});
  return s;
}

Vec3 decoded(const Setting& s, const SeparationPlanes& separation, const DisplacementTexture& texture, int row,
             int column) {
  const Patch& patch = s.patches[0];
  const std::size_t at = static_cast<std::size_t>(patch.rectangle.y + row) * texture.width + patch.rectangle.x + column;
  const TangentFrame frame =
      tangent_frame(s.skeleton, separation, 0, patch.row_u[row], static_cast<double>(column) / patch.rectangle.width);
  return decode_texel(frame, Vec3(texture.along[at], texture.around[at], texture.out[at]),
                      end_position(s.skeleton, 0, BoneEnd::kHead), end_position(s.skeleton, 0, BoneEnd::kTail));
}

}  // namespace

TEST(Encode, TexelsOfRandomMapsDecodeToThePointsThatTheTwinFinds) {
  ClContext context;
  for (unsigned seed = 1; seed <= 20; ++seed) {
    SCOPED_TRACE(seed);
    // Powers above 1 squeeze the first rows of triangles to sizes far below single precision's.
    const Setting s = random_setting(seed, seed % 4 == 0 ? 9.0 : 1.0);
    const SeparationPlanes separation(s.skeleton);
    const TexelResult result = read_texels(context, s.skeleton, separation, {s.charts, s.patches, s.hits, s.end_points},
                                           72, 80, Vec3(0, 0.2, 0.5), {.has_prefilter = false});
    EXPECT_EQ(result.report.missed_texels[0], 0);
    for (int row = 1; row + 1 < s.patches[0].rectangle.height; ++row)
      for (int j = 0; j < s.patches[0].rectangle.width; ++j) {
        const Vec3 expected = twin::surface_point(s.charts[0], s.patches[0].row_u[row],
                                                  static_cast<double>(j) / s.patches[0].rectangle.width);
        EXPECT_LT((decoded(s, separation, result.texture, row, j) - expected).norm(), 2e-6) << row << " " << j;
      }
  }
}

TEST(Encode, PolesAndEndRowsHoldTheirPoints) {
  ClContext context;
  const Setting s = random_setting(7, 1);
  const SeparationPlanes separation(s.skeleton);
  const TexelResult result =
      read_texels(context, s.skeleton, separation, {s.charts, s.patches, s.hits, s.end_points}, 72, 80, Vec3::Zero());
  for (int j = 0; j < s.patches[0].rectangle.width; ++j) {
    EXPECT_LT((decoded(s, separation, result.texture, 0, j) - s.end_points[0][0][0]).norm(), 1e-6);
    EXPECT_LT(
        (decoded(s, separation, result.texture, s.patches[0].rectangle.height - 1, j) - s.end_points[0][1][0]).norm(),
        1e-6);
  }
}

TEST(Encode, PrefilterMovesPointsAsItsTwinDoes) {
  ClContext context;
  for (unsigned seed = 30; seed < 34; ++seed) {
    const Setting s = random_setting(seed, 1);
    const SeparationPlanes separation(s.skeleton);
    const int rows = s.patches[0].rectangle.height, columns = s.patches[0].rectangle.width;
    const TexelSources sources{s.charts, s.patches, s.hits, s.end_points};
    const TexelResult plain =
        read_texels(context, s.skeleton, separation, sources, 72, 80, Vec3::Zero(), {.has_prefilter = false});
    const TexelResult filtered = read_texels(context, s.skeleton, separation, sources, 72, 80, Vec3::Zero());
    std::vector<Vec3> points;
    for (int r = 0; r < rows; ++r)
      for (int j = 0; j < columns; ++j) points.push_back(decoded(s, separation, plain.texture, r, j));
    const std::vector<Vec3> expected = twin::prefiltered(points, rows, columns);
    for (int r = 1; r + 1 < rows; ++r)
      for (int j = 0; j < columns; ++j) {
        // Where the lattice is nearly a line its normal is noise; the twin's input carries that of single precision.
        const Vec3 normal =
            (points[r * columns + (j + 1) % columns] - points[r * columns + (j + columns - 1) % columns])
                .cross(points[(r + 1) * columns + j] - points[(r - 1) * columns + j]);
        if (normal.norm() > 1e-3) {
          EXPECT_LT((decoded(s, separation, filtered.texture, r, j) - expected[r * columns + j]).norm(), 2e-5) << seed;
        }
      }
  }
}

TEST(Encode, SpdTexelsAreHeightsAndMissesAreFilledFromTheirColumn) {
  ClContext context;
  Setting s = random_setting(5, 1);
  const SeparationPlanes separation(s.skeleton);
  s.patches[0].method = Method::kSpd;
  const Rectangle r = s.patches[0].rectangle;
  s.patches[0].row_u = spread_rows_uniformly(r.height);
  std::mt19937 random(9);
  s.hits[0].triangles.assign(static_cast<std::size_t>(r.width) * r.height, 0);
  for (std::size_t i = 0; i < s.hits[0].triangles.size(); ++i)
    s.hits[0].distances.push_back(0.2f + 1e-3f * static_cast<float>(random() % 100));
  const std::size_t miss = 2 * r.width + 1;
  s.hits[0].triangles[miss] = -1;
  s.hits[0].distances[miss] = 0;
  const TexelResult result = read_texels(context, s.skeleton, separation, {s.charts, s.patches, s.hits, s.end_points},
                                         72, 80, Vec3::Zero(), {.has_prefilter = false});
  EXPECT_EQ(result.report.missed_texels[0], 1);
  for (int row = 1; row + 1 < r.height; ++row)
    for (int j = 0; j < r.width; ++j) {
      const std::size_t at = static_cast<std::size_t>(row) * r.width + j;
      const double distance = at == miss ? 0.5 * (s.hits[0].distances[at - r.width] + s.hits[0].distances[at + r.width])
                                         : s.hits[0].distances[at];
      const TangentFrame frame =
          tangent_frame(s.skeleton, separation, 0, s.patches[0].row_u[row], static_cast<double>(j) / r.width);
      EXPECT_LT((decoded(s, separation, result.texture, row, j) - (frame.foot + distance * frame.out)).norm(), 1e-6);
      const std::size_t texel = static_cast<std::size_t>(r.y + row) * 72 + r.x + j;
      EXPECT_LT(std::abs(result.texture.along[texel]) + std::abs(result.texture.around[texel]), 2e-6);
    }
}

TEST(RowProfile, OfALongCylinderIsLinearWhateverTheTriangles) {
  const Skeleton skeleton = straight_chain(1);
  const SeparationPlanes separation(skeleton);
  Chart chart = jittered_chart(skeleton, separation, 0, 9, 12, 1, false, 3);
  // On a cylinder of height 100 and radius 0.1 every meridian is 100 long, however the triangles lie.
  for (std::size_t i = 0; i < chart.u.size(); ++i)
    chart.positions[i] = 0.1 * separation.radial(0, chart.v[i]) + 100 * chart.u[i] * separation.bases()[0].o;
  const RowProfile profile = row_profile(chart);
  EXPECT_NEAR(profile.length, 100, 0.01);
  const std::vector<double> rows = spread_rows_by_length(profile, 33);
  for (int r = 0; r < 33; ++r) EXPECT_NEAR(rows[r], r / 32.0, 1e-4);
}

TEST(RowProfile, SpreadsRowsEvenlyOverALatticeOfKnownSpeed) {
  // Meridians with length u^2: rows lie at sqrt.
  constexpr int kRows = 1025;
  std::vector<Vec3> points;
  for (int r = 0; r < kRows; ++r) points.push_back(Vec3(0, 0, std::pow(r / (kRows - 1.0), 2)));
  const std::vector<double> rows = spread_rows_by_length(row_profile(points, kRows, 1), 11);
  for (int r = 0; r <= 10; ++r) EXPECT_NEAR(rows[r], std::sqrt(r / 10.0), r <= 1 ? 2e-2 : 1e-3);
}

TEST(RowProfile, GivesStretchedColumnsMoreThanTheirMean) {
  // Two columns: one as fast everywhere, the other 8 times as fast in the upper half.
  constexpr int kRows = 101;
  std::vector<Vec3> points;
  for (int r = 0; r < kRows; ++r) {
    const double u = r / (kRows - 1.0);
    points.push_back(Vec3(0, 0, u));
    points.push_back(Vec3(1, 0, u + 7 * std::max(0.0, u - 0.5)));
  }
  const RowProfile profile = row_profile(points, kRows, 2);
  EXPECT_NEAR(profile.length, (1 + 4.5) / 2, 1e-9);
  const double upper = std::pow((1 + std::pow(8, 1.25)) / 2, 1 / 1.25);
  EXPECT_NEAR(profile.share[50], 1 / (1 + upper), 1e-4);
  EXPECT_GT(upper, (1 + 8) / 2.0);
}

}  // namespace skeletex
