// SPDX-License-Identifier: MIT
#include "skeletex/convert/sample/unfold.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numeric>
#include <random>

#include "skeletex/analysis/metro.h"
#include "skeletex/convert/encode_model.h"
#include "skeletex/convert/layout/row_profile.h"
#include "skeletex/geometry/self_intersection.h"
#include "skeletex/reconstruct/reconstruct_mesh.h"
#include "support/load_model.h"
#include "support/unfold_twin.h"

namespace skeletex {
namespace {

constexpr int kWidth = 40, kHeight = 30, kNone = 0x7fffffff;

ClContext& device() {
  static ClContext context;
  return context;
}

/// A patch that fills its texture, over one triangle of the plane z = 0.
struct PlanePatch {
  Skeleton skeleton{{{"head", Vec3(0, 0, 0)}, {"tail", Vec3(0, 0, 1)}}, {{"bone", 0, 1, Vec3(1, 0, 0)}}};
  std::vector<Patch> patches{
      {{0, 0, kWidth, kHeight}, Method::kVsm, SegmentTopology::kSphere, spread_rows_uniformly(kHeight)}};
  DeviceLayout layout = upload_layout(
      device(), patches, frame_tables(skeleton, SeparationPlanes(skeleton), patches, Vec3::Zero()), kWidth, kHeight);
  DeviceMaps maps;
  ClBuffer<int> triangles = device().upload(std::vector<int>(kWidth * kHeight, 0));

  PlanePatch() {
    maps.sizes = {1, 3, 0};
    maps.triangles = device().upload(std::vector<int>{0, 1, 2, 0, 0, 0, -1, -1, -1, 0, 0});
    std::vector<float> values(4 * 3, 0);  // u and v are not read
    for (const float value : {0.f, 1.f, 0.f, 0.f, 0.f, 1.f, 0.f, 0.f, 0.f}) values.push_back(value);
    maps.values = device().upload(values);
  }
};

DevicePlanes upload_points(const std::vector<Vec3>& points) {
  std::array<std::vector<float>, 3> planes;
  for (const Vec3& p : points)
    for (int k = 0; k < 3; ++k) planes[k].push_back(static_cast<float>(p[k]));
  return upload_planes(device(), planes[0], planes[1], planes[2]);
}

/// A plane that turns about (20, 15) by an angle that falls with the distance: as a map it is one to one, but turns by
/// up to `most` radians.
Vec3 swirl(double x, double y, double most) {
  const double dx = x - 20, dy = y - 15, r2 = dx * dx + dy * dy, angle = most * std::exp(-r2 / 4);
  return {20 + std::cos(angle) * dx - std::sin(angle) * dy, 15 + std::sin(angle) * dx + std::cos(angle) * dy, 0};
}

}  // namespace

TEST(Unfold, FindsAndMovesWhatItsTwinDoes) {
  int compared = 0;
  for (unsigned seed = 1; seed <= 8; ++seed) {
    SCOPED_TRACE(seed);
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> unit(-1, 1);
    const PlanePatch patch;
    std::vector<Vec3> points;
    for (int r = 0; r < kHeight; ++r)
      for (int j = 0; j < kWidth; ++j)
        points.push_back(Vec3(j + 0.15 * seed * unit(random), r + 0.15 * seed * unit(random), 0.1 * unit(random))
                             .cast<float>()
                             .cast<double>());
    const twin::Folds expected = twin::find_folds(points, kWidth, kHeight);
    if (expected.is_close) continue;
    ++compared;
    const DevicePlanes on_device = upload_points(points);
    const std::vector<int> none(points.size(), 0);
    // The quads, whether they are listed, the marked texels, whether they are marked: see unfold.cl.
    std::vector<int> all(4 * points.size(), 0);
    const int quads = static_cast<int>(points.size()) - kWidth, size = static_cast<int>(points.size());
    std::iota(all.begin(), all.begin() + quads, 0), std::fill_n(all.begin() + size, size, 1);
    auto lists = device().upload(all), counts = device().upload(std::vector{quads, 0, 0, 0});
    MapParameters parameters{patch.maps.sizes, kWidth, size, 0, 0, 0, 0};
    const auto plane_of = [&](int plane) {
      const std::vector<int> planes = device().download(lists);
      return std::vector(planes.begin() + plane * size, planes.begin() + (plane + 1) * size);
    };
    device().launch({"unfold.cl", "find_folds"}, ClRange(quads), parameters, patch.layout.texel_patches,
                    patch.layout.tables.patches, patch.triangles, patch.maps.triangles, patch.maps.values,
                    on_device.values, counts, lists);
    EXPECT_EQ(device().download(counts)[FOLD_FOUND], expected.count);
    EXPECT_GT(expected.count, 0);
    EXPECT_EQ(plane_of(3), expected.marks);
    parameters.count = device().download(counts)[FOLD_MARKED];
    const auto flags_of = [&](std::vector<int> list, int count) {
      list.resize(count);
      std::vector<int> flags = none;
      for (const int texel : list) ++flags[texel];
      return flags;
    };
    EXPECT_EQ(flags_of(plane_of(2), parameters.count), expected.marks);

    std::vector<float> x, y;
    for (std::size_t i = 0; i < points.size(); ++i)
      x.push_back(static_cast<float>(unit(random))), y.push_back(static_cast<float>(0.5 * unit(random)));
    std::vector<float> home = x;
    home.insert(home.end(), y.begin(), y.end());
    auto offsets = device().upload(home);
    // Flags are off again but for the last row, which has no quads.
    const std::vector<int> flags = plane_of(1);
    EXPECT_EQ(std::accumulate(flags.begin(), flags.end(), 0), kWidth);
    all = device().download(lists);
    std::fill_n(all.begin() + size, size, 0);
    device().write(lists, all), device().write(counts, std::vector{0, 0, 0, 0});
    device().launch({"unfold.cl", "relax_folds"}, ClRange(parameters.count), parameters, patch.layout.texel_patches,
                    patch.layout.tables.patches, patch.triangles, on_device.values, offsets, counts, lists);
    const std::vector<float> moved = device().download(offsets);
    std::vector<int> around = none;
    for (int r = 0; r < kHeight; ++r)
      for (int j = 0; j < kWidth; ++j) {
        const std::size_t i = static_cast<std::size_t>(r) * kWidth + j;
        if (expected.marks[i])
          for (const int row : {r - 1, r})
            for (const int column : {(j + kWidth - 1) % kWidth, j}) around[row * kWidth + column] = 1;
        const Eigen::Vector2d before(x[i], y[i]),
            wanted = expected.marks[i] ? twin::relaxed(points, kWidth, kHeight, j, r, before) : before;
        EXPECT_NEAR(moved[i], wanted.x(), 2e-4);
        EXPECT_NEAR(moved[size + i], wanted.y(), 2e-4);
      }
    EXPECT_EQ(plane_of(3), none);
    EXPECT_EQ(plane_of(1), around);
    EXPECT_EQ(flags_of(plane_of(0), device().download(counts)[FOLD_QUADS]), around);
  }
  EXPECT_GE(compared, 4);
}

TEST(Unfold, TakesTheFoldsOutOfALatticeOverASwirlAndTouchesNothingElse) {
  const PlanePatch patch;
  ReadingPositions positions = even_positions(device(), patch.layout);
  constexpr double kMost = 5.0;
  // Columns wrap round, which a plane does not: the outer ones are no part of the map.
  std::vector<int> triangles(kWidth * kHeight, 0);
  for (int i = 0; i < kWidth * kHeight; ++i)
    if (i % kWidth < 3 || i % kWidth >= kWidth - 3) triangles[i] = kNone;
  std::vector<Vec3> even;
  for (int r = 0; r < kHeight; ++r)
    for (int j = 0; j < kWidth; ++j) even.push_back(swirl(j, r, kMost));
  DevicePlanes points = upload_points(even);
  const auto read = [&](const ClBuffer<int>& texels, int first, int count) {
    const std::vector<int> listed = device().download(texels);
    const std::vector<float> home = device().download(positions.home);
    std::vector<float> moved = device().download(points.values);
    for (int k = first; k < first + count; ++k) {
      const int i = listed[k];
      if (triangles[i] == kNone) continue;
      const Vec3 p = swirl(i % kWidth + static_cast<double>(home[i]),
                           i / kWidth + static_cast<double>(home[kWidth * kHeight + i]), kMost);
      moved[i] = static_cast<float>(p.x()), moved[kWidth * kHeight + i] = static_cast<float>(p.y());
    }
    device().write(points.values, moved);
  };
  const UnfoldReport report = unfold_lattice(device(), patch.layout, patch.patches, patch.maps,
                                             device().upload(triangles), read, positions, points);
  EXPECT_GT(report.folded_quads, 0);
  EXPECT_EQ(report.left, 0);
  const auto [x, y, z] = download_planes(device(), points);
  std::vector<Vec3> after;
  for (std::size_t i = 0; i < even.size(); ++i) {
    after.emplace_back(x[i], y[i], 0);
    const double distance = std::hypot(static_cast<double>(i % kWidth) - 20, static_cast<double>(i / kWidth) - 15);
    if (distance > 8) {
      EXPECT_EQ((after.back() - even[i].cast<float>().cast<double>()).norm(), 0);
    }
  }
  const twin::Folds before_folds = twin::find_folds(even, kWidth, kHeight),
                    after_folds = twin::find_folds(after, kWidth, kHeight);
  EXPECT_EQ(before_folds.count - report.folded_quads, after_folds.count);
}

TEST(Unfold, TakesMostSelfIntersectionsFromABearAndStaysOnIt) {
  const TestModel model = load_standard_model("bear");
  EncodeOptions options;
  options.width = options.height = 512;
  options.has_snap = false;
  const EncodeResult encoded = encode_model(device(), model.mesh, model.skeleton, options);
  const UnfoldReport& report = encoded.report.unfold.value();
  EXPECT_GT(report.folded_quads, 10);
  EXPECT_LT(4 * report.left, report.folded_quads);
  options.has_unfold = false;
  const auto crossing = count_self_intersections(
      reconstruct_mesh(device(), encode_model(device(), model.mesh, model.skeleton, options).model));
  EXPECT_GT(crossing, 10);
  EXPECT_LT(4 * count_self_intersections(reconstruct_mesh(device(), encoded.model)), crossing);
  // Without the prefilter every vertex is a point of the mesh.
  options.has_unfold = true;
  options.has_prefilter = false;
  const TriangleMesh mesh =
      reconstruct_mesh(device(), encode_model(device(), model.mesh, model.skeleton, options).model);
  EXPECT_LT(measure_metro(device(), mesh, model.mesh, {.samples = 1000}).vertex.max, 2e-6);
}

}  // namespace skeletex
