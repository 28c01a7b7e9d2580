// SPDX-License-Identifier: MIT
#include "skeletex/convert/fit/fit.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <numbers>
#include <random>

#include "fit_structs.h"
#include "skeletex/analysis/manifold.h"
#include "skeletex/analysis/metro.h"
#include "skeletex/convert/encode_model.h"
#include "skeletex/convert/fit/mean_distance.h"
#include "skeletex/convert/layout/row_profile.h"
#include "skeletex/geometry/self_intersection.h"
#include "skeletex/reconstruct/reconstruct_mesh.h"
#include "support/fit_twin.h"
#include "support/load_model.h"

namespace skeletex {
namespace {

constexpr int kTextureWidth = 40, kTextureHeight = 30;

ClContext& device() {
  static ClContext context;
  return context;
}

/// One patch of a texture, its points a tube with a random surface, and random samples near it.
struct RandomPatch {
  Skeleton skeleton{{{"head", Vec3(0, 0, 0)}, {"tail", Vec3(0, 0, 1)}}, {{"bone", 0, 1, Vec3(1, 0, 0)}}};
  std::vector<Patch> patches;
  DeviceLayout layout;
  std::array<std::vector<float>, 3> points;
  std::vector<float> samples;

  RandomPatch(const Rectangle& r, unsigned seed) {
    patches.push_back({r, Method::kVsm, SegmentTopology::kSphere, spread_rows_uniformly(r.height)});
    layout = upload_layout(device(), patches, frame_tables(skeleton, SeparationPlanes(skeleton), patches, Vec3::Zero()),
                           kTextureWidth, kTextureHeight);
    std::mt19937 random(seed);
    std::normal_distribution<float> normal(0, 1);
    std::uniform_real_distribution<float> unit(0, 1);
    const std::size_t size = layout.size();
    for (auto& plane : points) plane.resize(size, 0);
    const auto place = [&](double column, double row, std::size_t index, float noise) {
      const double angle = 2 * std::numbers::pi * column / r.width;
      points[0][index] = static_cast<float>(std::cos(angle)) + noise * normal(random);
      points[1][index] = static_cast<float>(std::sin(angle)) + noise * normal(random);
      points[2][index] = static_cast<float>(0.4 * row) + noise * normal(random);
    };
    for (int row = 0; row < r.height; ++row)
      for (int j = 0; j < r.width; ++j) place(j, row, texel(j, row), 0.05f);
    samples.resize(7 * 4 * size, 0);
    for (int row = 0; row + 1 < r.height; ++row)
      for (int j = 0; j < r.width; ++j)
        for (int i = 0; i < 4; ++i) {
          const double angle = 2 * std::numbers::pi * (j + 0.25 + 0.5 * (i & 1)) / r.width;
          const Vec3 direction =
              Vec3(std::cos(angle) + 0.3 * normal(random), std::sin(angle) + 0.3 * normal(random), 0.3 * normal(random))
                  .normalized();
          const double values[7] = {std::cos(angle) + 0.1 * normal(random),
                                    std::sin(angle) + 0.1 * normal(random),
                                    0.4 * (row + 0.25 + 0.25 * (i & 2)) + 0.1 * normal(random),
                                    direction[0],
                                    direction[1],
                                    direction[2],
                                    0.5 + unit(random)};
          for (int k = 0; k < 7; ++k) samples[(7 * i + k) * size + texel(j, row)] = static_cast<float>(values[k]);
        }
  }
  const Rectangle& rectangle() const { return patches[0].rectangle; }
  std::size_t texel(int column, int row) const {
    const Rectangle& r = rectangle();
    return static_cast<std::size_t>(r.y + row) * kTextureWidth + r.x + (column % r.width + r.width) % r.width;
  }
  Vec3 point(int column, int row) const {
    const std::size_t at = texel(column, row);
    return {points[0][at], points[1][at], points[2][at]};
  }
};

/// The kernels from matching to the solved moves, in work-groups of a size.
struct Solved {
  std::vector<int> numbers;
  std::vector<float> matched, system;
  std::array<std::vector<float>, 3> moves;
  std::size_t size;

  int diagonal(std::size_t texel) const { return numbers[FIT_DIAGONALS * size + texel]; }
  int match(int sample, std::size_t texel) const { return numbers[(FIT_MATCHES + sample) * size + texel]; }
  double weight(int sample, int corner, std::size_t texel) const {
    return matched[(MATCH_PLANES * sample + corner - 1) * size + texel];
  }
  double residual(int sample, std::size_t texel) const { return matched[(MATCH_PLANES * sample + 2) * size + texel]; }
};
Solved solve(const RandomPatch& patch, int sweeps, std::size_t group, float damping, float springs,
             float least_residual) {
  ClContext& c = device();
  const DeviceLayout& layout = patch.layout;
  const std::size_t size = layout.size();
  const auto points = upload_planes(c, patch.points[0], patch.points[1], patch.points[2]);
  const auto samples = c.upload(patch.samples);
  auto numbers = c.allocate<int>(FIT_NUMBER_PLANES * size);
  auto matched = c.allocate<float>(FIT_MATCHED_PLANES * size);
  auto lattice = c.allocate<float>(2 * LATTICE_PLANES * size), system = c.allocate<float>(SYSTEM_STRIDE * size);
  auto moves = allocate_planes(c, size);
  c.fill(numbers, 0), c.fill(matched, 0.f), c.fill(lattice, 0.f), c.fill(system, 0.f), c.fill(moves.values, 0.f);
  FitParameters parameters{{}, kTextureWidth, kTextureHeight, least_residual, 0, damping, springs, 0};
  const auto launch = [&](const char* kernel, const auto&... arguments) {
    c.launch({"fit.cl", kernel}, ClRange({kTextureWidth, kTextureHeight}, {group, 1}), parameters, layout.texel_patches,
             layout.tables.patches, arguments...);
  };
  launch("choose_fitted_diagonals", points.values, numbers);
  launch("match_samples", samples, points.values, numbers, matched);
  launch("assemble", samples, numbers, matched, lattice, system);
  for (int sweep = 0; sweep < sweeps; ++sweep)
    for (parameters.colour = 0; parameters.colour < 6; ++parameters.colour) launch("relax_moves", system, moves.values);
  return {c.download(numbers), c.download(matched), c.download(system), download_planes(c, moves), size};
}

}  // namespace

TEST(FitKernels, ASampleIsMatchedWithAPointOfTheLatticeAsNearAsTheTwinFinds) {
  const RandomPatch patch({3, 2, 23, 17}, 1);
  const Solved got = solve(patch, 0, 64, 0.01f, 0.01f, 0.01f);
  const std::size_t size = patch.layout.size();
  const Rectangle& r = patch.rectangle();
  const auto point = [&](int j, int row) { return patch.point(j, row); };
  int nearest = 0, count = 0;
  for (int row = 0; row + 1 < r.height; ++row)
    for (int j = 0; j < r.width; ++j)
      for (int i = 0; i < 4; ++i, ++count) {
        const std::size_t at = patch.texel(j, row);
        const auto value = [&](int k) { return static_cast<double>(patch.samples[(7 * i + k) * size + at]); };
        const Vec3 sample(value(0), value(1), value(2)), normal(value(3), value(4), value(5));
        const int match = got.match(i, at);
        ASSERT_GE(match, 0);
        const int column = j + (match & 3) - 1, up = row + (match >> 2 & 3) - 1;
        const auto corners = twin::triangle_corners(got.diagonal(patch.texel(column, up)) != 0, match >> 4);
        const double w1 = got.weight(i, 1, at), w2 = got.weight(i, 2, at);
        const double w[3] = {1 - w1 - w2, w1, w2};
        Vec3 matched = Vec3::Zero();
        for (int k = 0; k < 3; ++k) matched += w[k] * point(column + corners[k][0], up + corners[k][1]);
        EXPECT_NEAR(got.residual(i, at), normal.dot(matched - sample), 1e-5);
        // Not further than anything in the sample's own quad; the quads beside it are only searched across the nearest
        // side.
        const double own = twin::nearest_in_quad(point, j, row, got.diagonal(at) != 0, sample);
        EXPECT_LE((matched - sample).norm(), own + 1e-5);
        double best = own;
        for (int dy = -1; dy <= 1; ++dy)
          for (int dx = -1; dx <= 1; ++dx)
            if (row + dy >= 0 && row + dy <= r.height - 2)
              best = std::min(best, twin::nearest_in_quad(point, j + dx, row + dy,
                                                          got.diagonal(patch.texel(j + dx, row + dy)) != 0, sample));
        nearest += (matched - sample).norm() < best + 1e-5;
      }
  EXPECT_GT(nearest, 0.9 * count);
}

TEST(FitKernels, TheSweepsEndAtTheSolutionOfTheTwinsDenseSystem) {
  constexpr float kDamping = 0.02f, kSprings = 0.05f, kLeast = 0.02f;
  const RandomPatch patch({5, 4, 9, 8}, 2);
  const Solved got = solve(patch, 600, 64, kDamping, kSprings, kLeast);
  const Rectangle& r = patch.rectangle();
  twin::FitSystem system(r.width, r.height);
  const std::size_t size = patch.layout.size();
  for (int row = 0; row + 1 < r.height; ++row)
    for (int j = 0; j < r.width; ++j)
      for (int i = 0; i < 4; ++i) {
        const std::size_t at = patch.texel(j, row);
        const int match = got.match(i, at), column = j + (match & 3) - 1, up = row + (match >> 2 & 3) - 1;
        const auto corners = twin::triangle_corners(got.diagonal(patch.texel(column, up)) != 0, match >> 4);
        const double w1 = got.weight(i, 1, at), w2 = got.weight(i, 2, at);
        const auto value = [&](int k) { return static_cast<double>(patch.samples[(7 * i + k) * size + at]); };
        system.add({value(3), value(4), value(5)}, got.residual(i, at), value(6), kLeast, column, up, corners,
                   {1 - w1 - w2, w1, w2});
      }
  const Eigen::VectorXd expected = system.solve(kDamping, kSprings);
  const double largest = expected.cwiseAbs().maxCoeff();
  ASSERT_GT(largest, 1e-3);
  for (int row = 0; row < r.height; ++row)
    for (int j = 0; j < r.width; ++j)
      for (int k = 0; k < 3; ++k)
        EXPECT_NEAR(got.moves[k][patch.texel(j, row)], expected[3 * (row * r.width + j) + k], 2e-3 * largest)
            << row << " " << j;
}

TEST(FitKernels, TheSizeOfWorkGroupsDoesNotShow) {
  const RandomPatch patch({1, 0, 31, 30}, 3);
  const Solved first = solve(patch, 5, 64, 0.001f, 0.002f, 0.01f), second = solve(patch, 5, 8, 0.001f, 0.002f, 0.01f);
  EXPECT_EQ(first.numbers, second.numbers);
  EXPECT_EQ(first.system, second.system);
  EXPECT_EQ(first.moves, second.moves);
}

TEST(MeanDistance, LeavesOutPatchesWhoseMapsAreSqueezed) {
  // Four patches of ten texels and some texels of none; a texel of the last patch is far away.
  std::vector<int> patches(44, -1);
  std::vector<float> costs(patches.size(), 1e9f), areas(patches.size(), 1e9f);
  for (int t = 0; t < 40; ++t) patches[t] = t / 10, areas[t] = 2, costs[t] = static_cast<float>(1 + t / 10);
  MeanDistance distance(patches, 4);
  EXPECT_DOUBLE_EQ(distance.of(costs, areas), 2.5 / 2);
  costs[39] = 10 * 50;  // its patch: 18 times the median one
  distance.leave_out_squeezed(costs, areas);
  EXPECT_NEAR(distance.of(costs, areas), (100 - 40 + 36 + 500) / 80.0, 1e-9);
  costs[39] = 10 * 5000;
  distance.leave_out_squeezed(costs, areas);
  EXPECT_DOUBLE_EQ(distance.of(costs, areas), 2.0 / 2);
  costs[39] = 10 * 2;  // it stays left out, or steps could not be compared
  EXPECT_DOUBLE_EQ(distance.of(costs, areas), 2.0 / 2);
  const std::vector<float> none(patches.size(), 0.f);
  distance.leave_out_squeezed(none, none);
  EXPECT_EQ(distance.of(none, none), 0);
}

TEST(Fit, LowersTheResidualStepByStepAndTheMeanErrorWithIt) {
  const TestModel model = load_standard_model("bear");
  EncodeOptions options;
  options.width = options.height = 128;
  options.has_snap = options.has_fit = false;
  const EncodeResult plain = encode_model(device(), model.mesh, model.skeleton, options);
  options.has_fit = true;
  const EncodeResult fitted = encode_model(device(), model.mesh, model.skeleton, options);
  const FitReport& report = fitted.report.fit.value();
  ASSERT_GE(report.residuals.size(), 3u);
  for (std::size_t i = 1; i < report.residuals.size(); ++i) EXPECT_LT(report.residuals[i], report.residuals[i - 1]);
  EXPECT_LT(report.residuals.back(), 0.4 * report.residuals.front());
  const TriangleMesh plain_mesh = reconstruct_mesh(device(), plain.model),
                     mesh = reconstruct_mesh(device(), fitted.model);
  const MetroReport before = measure_metro(device(), model.mesh, plain_mesh),
                    after = measure_metro(device(), model.mesh, mesh);
  EXPECT_LT(symmetric_mean(after), 0.8 * symmetric_mean(before));
  EXPECT_LT(after.vertex.mean, 0.7 * before.vertex.mean);
  EXPECT_TRUE(measure_manifold(mesh).is_closed_manifold());
  EXPECT_EQ(fitted.model.diagonals, DiagonalRule::kSmooth);
  EXPECT_EQ(plain.model.diagonals, DiagonalRule::kNearest);
}

TEST(Fit, LeavesSeamsAndPolesBitForBitAndGivesTheSameModelTwice) {
  const TestModel model = load_standard_model("bear");
  EncodeOptions options;
  options.width = options.height = 96;
  options.has_snap = options.has_fit = false;
  const SkeletexModel plain = encode_model(device(), model.mesh, model.skeleton, options).model;
  options.has_fit = true;
  const SkeletexModel fitted = encode_model(device(), model.mesh, model.skeleton, options).model;
  ASSERT_EQ(plain.arcs.size(), fitted.arcs.size());
  for (std::size_t a = 0; a < plain.arcs.size(); ++a) {
    ASSERT_EQ(plain.arcs[a].samples.size(), fitted.arcs[a].samples.size());
    for (std::size_t i = 0; i < plain.arcs[a].samples.size(); ++i) {
      EXPECT_EQ(plain.arcs[a].samples[i].turn, fitted.arcs[a].samples[i].turn);
      EXPECT_EQ(plain.arcs[a].samples[i].distance, fitted.arcs[a].samples[i].distance);
    }
  }
  long moved = 0;
  for (const Patch& patch : fitted.patches) {
    const Rectangle& r = patch.rectangle;
    for (int row = 0; row < r.height; ++row)
      for (int j = 0; j < r.width; ++j) {
        const std::size_t at = static_cast<std::size_t>(r.y + row) * fitted.texture.width + r.x + j;
        const bool is_same = plain.texture.along[at] == fitted.texture.along[at] &&
                             plain.texture.around[at] == fitted.texture.around[at] &&
                             plain.texture.out[at] == fitted.texture.out[at];
        if (row == 0 || row == r.height - 1) {
          EXPECT_TRUE(is_same);
        } else
          moved += !is_same;
      }
  }
  EXPECT_GT(moved, 96 * 96 / 2);
  const SkeletexModel again = encode_model(device(), model.mesh, model.skeleton, options).model;
  EXPECT_EQ(fitted.texture.along, again.texture.along);
  EXPECT_EQ(fitted.texture.around, again.texture.around);
  EXPECT_EQ(fitted.texture.out, again.texture.out);
}

TEST(Fit, LeavesALatticeAloneThatIsTheMesh) {
  // A tube, square across, whose vertices are the lattice's points.
  constexpr int kColumns = 16, kRows = 9;
  Chart chart;
  chart.bone = 0;
  chart.topology = SegmentTopology::kAnnulus;
  for (int row = 0; row < kRows; ++row)
    for (int j = 0; j < kColumns; ++j) {
      chart.u.push_back(row / (kRows - 1.0));
      chart.v.push_back(static_cast<double>(j) / kColumns);
      const double t = 0.25 * (j % 4) * 2 - 1;  // from corner to corner of a side
      const Vec3 sides[4] = {{1, t, 0}, {-t, 1, 0}, {-1, -t, 0}, {t, -1, 0}};
      chart.positions.push_back(sides[j / 4] + Vec3(0, 0, 0.5 * row));
      chart.kinds.push_back(row == 0           ? ChartVertex::kHeadRow
                            : row == kRows - 1 ? ChartVertex::kTailRow
                                               : ChartVertex::kInner);
    }
  for (int row = 0; row + 1 < kRows; ++row)
    for (int j = 0; j < kColumns; ++j) {
      const int k = (j + 1) % kColumns, a = kColumns * row + j, b = kColumns * row + k;
      const auto turn = static_cast<std::int8_t>(k == 0);
      chart.triangles.push_back({a, b, b + kColumns});
      chart.turns.push_back({0, turn, turn});
      chart.triangles.push_back({a, b + kColumns, a + kColumns});
      chart.turns.push_back({0, turn, 0});
    }
  const Skeleton skeleton{{{"head", Vec3(0, 0, 0)}, {"tail", Vec3(0, 0, 4)}}, {{"bone", 0, 1, Vec3(1, 0, 0)}}};
  const std::vector<Patch> patches{
      {{2, 1, kColumns, kRows}, Method::kVsm, SegmentTopology::kAnnulus, spread_rows_uniformly(kRows)}};
  std::vector<std::array<std::vector<Vec3>, 2>> ends(1);
  ends[0][0].assign(chart.positions.begin(), chart.positions.begin() + kColumns);
  ends[0][1].assign(chart.positions.end() - kColumns, chart.positions.end());
  chart.half_edges = link_half_edges(chart.triangles, static_cast<int>(chart.positions.size()));
  const std::vector<Chart> charts{chart};
  const std::vector<SpdHits> hits(1);
  const auto read = [&](bool has_fit) {
    return read_texels(device(), skeleton, SeparationPlanes(skeleton), {charts, patches, hits, ends}, 24, 12,
                       Vec3::Zero(), {.has_prefilter = false, .fit_steps = has_fit ? 4.0 : 0.0});
  };
  const TexelResult plain = read(false), fitted = read(true);
  EXPECT_LT(fitted.report.fit->residuals.front(), 1e-6);
  for (std::size_t i = 0; i < plain.texture.out.size(); ++i) {
    EXPECT_NEAR(plain.texture.along[i], fitted.texture.along[i], 1e-5);
    EXPECT_NEAR(plain.texture.around[i], fitted.texture.around[i], 1e-5);
    EXPECT_NEAR(plain.texture.out[i], fitted.texture.out[i], 1e-5);
  }
}

TEST(RevertFaults, NeitherTheMaximumNorFoldsAreAboveThoseOfTheRegularGrid) {
  const TestModel model = load_standard_model("bear");
  // The furthest of middles of triangles and sides, and of the mesh's vertices.
  const auto furthest = [&](const TriangleMesh& mesh) {
    std::vector<Vec3> points;
    for (const auto& [a, b, c] : mesh.triangles) {
      const Vec3 &p = mesh.positions[a], &q = mesh.positions[b], &r = mesh.positions[c];
      for (const Vec3& point : {Vec3((p + q + r) / 3), Vec3((p + q) / 2), Vec3((q + r) / 2), Vec3((r + p) / 2)})
        points.push_back(point);
    }
    float most = 0;
    for (const float distance : closest_distances(device(), model.mesh, points)) most = std::max(most, distance);
    for (const float distance : closest_distances(device(), mesh, model.mesh.positions))
      most = std::max(most, distance);
    return most;
  };
  EncodeOptions options;
  options.width = options.height = 192;
  const TriangleMesh plain =
      reconstruct_mesh(device(), encode_model(device(), model.mesh, model.skeleton, options).model);
  options.has_snap = options.has_fit = true;
  const EncodeResult encoded = encode_model(device(), model.mesh, model.skeleton, options);
  const TriangleMesh mesh = reconstruct_mesh(device(), encoded.model);
  EXPECT_GT(encoded.report.fit->reverted_texels, 0);
  // Quads of the regular grid may have their other diagonal beside moved ones.
  EXPECT_LT(furthest(mesh), 1.02f * furthest(plain));
  EXPECT_LE(static_cast<double>(count_self_intersections(mesh)),
            1.2 * static_cast<double>(count_self_intersections(plain)) + 10);
  const RevertReport& revert = encoded.report.revert.value();
  EXPECT_LE(revert.inverted_triangles, 1.2 * revert.regular_inverted_triangles + 10);
}

}  // namespace skeletex
