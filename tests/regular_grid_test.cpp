// SPDX-License-Identifier: MIT
#include "skeletex/edit/regular_grid.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <random>

#include "regular_grid_structs.h"
#include "skeletex/analysis/manifold.h"
#include "skeletex/analysis/metro.h"
#include "skeletex/convert/encode_model.h"
#include "skeletex/edit/morph/morph.h"
#include "skeletex/reconstruct/displace.h"
#include "skeletex/reconstruct/reconstruct_mesh.h"
#include "support/load_model.h"

namespace skeletex {
namespace {

ClContext& device() {
  static ClContext context;
  return context;
}

SkeletexModel encoded(const std::string& name, int size, bool is_snapped, std::optional<Method> method = Method::kVsm) {
  const TestModel model = load_standard_model(name);
  EncodeOptions options;
  options.width = options.height = size;
  options.method = method;
  options.has_snap = is_snapped;
  options.has_fit = false;
  return encode_model(device(), model.mesh, model.skeleton, options).model;
}

/// Mean over the length of all edges of the angle between their two triangles, degrees.
double mean_angle(const SkeletexModel& model) {
  const TriangleMesh mesh = reconstruct_mesh(device(), model);
  std::vector<std::pair<std::array<int, 2>, Vec3>> sides;
  for (const Triangle& t : mesh.triangles) {
    const Vec3 normal =
        (mesh.positions[t[1]] - mesh.positions[t[0]]).cross(mesh.positions[t[2]] - mesh.positions[t[0]]);
    for (int k = 0; k < 3; ++k)
      sides.push_back({{std::min(t[k], t[(k + 1) % 3]), std::max(t[k], t[(k + 1) % 3])}, normal});
  }
  std::sort(sides.begin(), sides.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
  double sum = 0, length = 0;
  for (std::size_t i = 0; i + 1 < sides.size(); i += 2) {
    const double edge = (mesh.positions[sides[i].first[0]] - mesh.positions[sides[i].first[1]]).norm();
    sum +=
        edge * std::atan2(sides[i].second.cross(sides[i + 1].second).norm(), sides[i].second.dot(sides[i + 1].second));
    length += edge;
  }
  return sum / length * 180 / std::numbers::pi;
}

/// Kernel slide_points for one patch, in double precision.
struct SlideTwin {
  int width, height;
  std::vector<Vec3> own;

  Vec3 at(double x, double y, Eigen::Matrix<double, 3, 2>* slopes = nullptr) const {
    const double row = std::clamp(std::floor(y), 0.0, height - 2.0), column = std::floor(x);
    const auto corner = [&](int dx, int dy) {
      const int j = static_cast<int>(column) + dx;
      return own[(static_cast<std::size_t>(row) + dy) * width + ((j % width) + width) % width];
    };
    const double fx = x - column, fy = y - row;
    if (slopes)
      *slopes << (1 - fy) * (corner(1, 0) - corner(0, 0)) + fy * (corner(1, 1) - corner(0, 1)),
          (1 - fx) * (corner(0, 1) - corner(0, 0)) + fx * (corner(1, 1) - corner(1, 0));
    return (1 - fy) * ((1 - fx) * corner(0, 0) + fx * corner(1, 0)) +
           fy * ((1 - fx) * corner(0, 1) + fx * corner(1, 1));
  }
  Eigen::Vector2d stepped(const std::vector<Eigen::Vector2d>& offsets, int j, int row) const {
    const auto now = [&](int column, int r) {
      const int c = (column + width) % width;
      const Eigen::Vector2d& offset = offsets[static_cast<std::size_t>(r) * width + c];
      return at(c + offset.x(), r + offset.y());
    };
    const Eigen::Vector2d before = offsets[static_cast<std::size_t>(row) * width + j];
    const Vec3 wanted = (now(j - 1, row) + now(j + 1, row) + now(j, row - 1) + now(j, row + 1)) / 4 - now(j, row);
    Eigen::Matrix<double, 3, 2> slopes;
    at(j + before.x(), row + before.y(), &slopes);
    Eigen::Matrix2d normal = slopes.transpose() * slopes;
    normal += 1e-3 * normal.trace() * Eigen::Matrix2d::Identity();
    const Eigen::Vector2d step = 0.7 * normal.inverse() * slopes.transpose() * wanted;
    const Eigen::Vector2d after = before + step.cwiseMax(-0.25).cwiseMin(0.25);
    return {std::clamp(after.x(), -2.0, 2.0),
            std::clamp(after.y(), std::max(-2.0, 0.5 - row), std::min(2.0, height - 1.5 - row))};
  }
};

}  // namespace

TEST(RegularGrid, SlidesAsItsTwinDoes) {
  constexpr int kWidth = 12, kHeight = 9;
  for (unsigned seed = 1; seed <= 6; ++seed) {
    SCOPED_TRACE(seed);
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> unit(-1, 1);
    // A tube, rougher with each seed; the last has cells without an area.
    SlideTwin twin{kWidth, kHeight, {}};
    std::array<std::vector<float>, 3> planes;
    std::vector<float> x, y;
    std::vector<Eigen::Vector2d> offsets;
    for (int r = 0; r < kHeight; ++r)
      for (int j = 0; j < kWidth; ++j) {
        const double angle = 2 * std::numbers::pi * (seed == 6 && j < 4 ? 0 : j + 0.1 * seed * unit(random)) / kWidth;
        const Vec3 p(std::cos(angle), std::sin(angle), 0.5 * (r + 0.1 * seed * unit(random)));
        for (int k = 0; k < 3; ++k) planes[k].push_back(static_cast<float>(p[k]));
        twin.own.push_back(p.cast<float>().cast<double>());
        const bool is_end = r == 0 || r == kHeight - 1;
        x.push_back(is_end ? 0.f : static_cast<float>(1.9 * unit(random)));
        y.push_back(is_end ? 0.f : static_cast<float>(std::clamp(1.9 * unit(random), 0.5 - r, kHeight - 1.5 - r)));
        offsets.emplace_back(x.back(), y.back());
      }
    std::array<std::vector<float>, 3> at;
    for (int r = 0; r < kHeight; ++r)
      for (int j = 0; j < kWidth; ++j) {
        const Eigen::Vector2d& offset = offsets[static_cast<std::size_t>(r) * kWidth + j];
        const Vec3 p = twin.at(j + offset.x(), r + offset.y());
        for (int k = 0; k < 3; ++k) at[k].push_back(static_cast<float>(p[k]));
      }
    for (const int is_kept : {0, 1}) {
      const std::vector<Patch> patches{
          {{0, 0, kWidth, kHeight}, Method::kVsm, SegmentTopology::kAnnulus, std::vector<double>(kHeight, 0)}};
      PatchRecord record{};
      record.width = kWidth, record.height = kHeight;
      const std::vector<LatticeRow> rows = lattice_rows(patches, RowChoice::kAll);
      const auto upload = [&](const std::vector<float>& values) { return device().upload(values); };
      std::vector<float> both = x;
      both.insert(both.end(), y.begin(), y.end());
      const DevicePlanes own = upload_planes(device(), planes[0], planes[1], planes[2]),
                         now = upload_planes(device(), at[0], at[1], at[2]),
                         next_points = allocate_planes(device(), own.count);
      const auto next = upload(both);
      device().launch({"regular_grid.cl", "slide_points"}, row_range(device(), rows.size()),
                      SlideParameters{static_cast<int>(rows.size()), kWidth * kHeight}, device().upload(rows),
                      device().upload(std::vector<PatchRecord>{record}), device().upload(std::vector<int>{is_kept}),
                      own.values, upload(both), now.values, next, next_points.values);
      const std::vector<float> got = device().download(next), got_x(got.begin(), got.begin() + kWidth * kHeight),
                               got_y(got.begin() + kWidth * kHeight, got.end());
      const std::array<std::vector<float>, 3> points = download_planes(device(), next_points);
      for (int r = 0; r < kHeight; ++r)
        for (int j = 0; j < kWidth; ++j) {
          const std::size_t i = static_cast<std::size_t>(r) * kWidth + j;
          const bool stays = is_kept || r == 0 || r == kHeight - 1;
          const Eigen::Vector2d wanted = stays ? offsets[i] : twin.stepped(offsets, j, r);
          EXPECT_NEAR(got_x[i], wanted.x(), 2e-3) << r << " " << j;
          EXPECT_NEAR(got_y[i], wanted.y(), 2e-3) << r << " " << j;
          const Vec3 there = twin.at(j + static_cast<double>(got_x[i]), r + static_cast<double>(got_y[i]));
          for (int k = 0; k < 3; ++k) EXPECT_NEAR(points[k][i], there[k], 1e-5);
        }
    }
  }
}

TEST(RegularGrid, LeavesRegularModelsAndSpdPatchesAndEndsAlone) {
  const SkeletexModel regular = encoded("bear", 64, false);
  const SkeletexModel same = regular_grid(device(), regular);
  EXPECT_EQ(same.texture.out, regular.texture.out);
  EXPECT_EQ(same.texture.along, regular.texture.along);

  SkeletexModel snapped = encoded("bear", 256, true);
  snapped.patches[3].method = Method::kSpd;
  const SkeletexModel slid = regular_grid(device(), snapped);
  EXPECT_EQ(slid.diagonals, DiagonalRule::kNearest);
  std::size_t moved = 0, inner = 0;
  for (std::size_t bone = 0; bone < snapped.patches.size(); ++bone) {
    const auto [x, y, width, height] = snapped.patches[bone].rectangle;
    for (int r = 0; r < height; ++r)
      for (int j = 0; j < width; ++j) {
        const std::size_t texel = static_cast<std::size_t>(y + r) * snapped.texture.width + x + j;
        const bool has_moved = slid.texture.out[texel] != snapped.texture.out[texel] ||
                               slid.texture.along[texel] != snapped.texture.along[texel];
        if (r == 0 || r == height - 1 || bone == 3) {
          EXPECT_FALSE(has_moved) << bone << " " << r << " " << j;
        } else {
          moved += has_moved, ++inner;
        }
      }
  }
  EXPECT_GT(moved, 0.95 * static_cast<double>(inner));
}

TEST(RegularGrid, StaysOnTheSurfaceAndMakesMorphsAsSmoothAsOfEvenModels) {
  for (const auto& [first, second] : {std::pair{"bear", "bear_bis"}, {"man", "homer"}}) {
    SCOPED_TRACE(first);
    const std::array regular{encoded(first, 192, false), encoded(second, 192, false)},
        snapped{encoded(first, 192, true), encoded(second, 192, true)};
    const SkeletexModel slid = regular_grid(device(), snapped[0]);
    const TriangleMesh mesh = load_standard_model(first).mesh, surface = reconstruct_mesh(device(), slid);
    EXPECT_TRUE(measure_manifold(surface).is_closed_manifold());
    EXPECT_LT(symmetric_mean(measure_metro(device(), mesh, surface)),
              1.3 * symmetric_mean(measure_metro(device(), mesh, reconstruct_mesh(device(), regular[0]))));

    const auto half_way = [](const std::array<SkeletexModel, 2>& models) {
      const Correspondence bones = find_correspondence(models[0].skeleton, models[1].skeleton);
      return Morph(device(), {models[0], models[1]}, std::vector{bones}).at(std::vector{0.5, 0.5});
    };
    const double own = mean_angle(snapped[0]), from_snapped = mean_angle(half_way(snapped)),
                 from_regular = mean_angle(half_way(regular));
    EXPECT_LT(from_snapped, 1.02 * from_regular);
    // Means of the texels themselves are rougher by half.
    SkeletexModel untold[2] = {snapped[0], snapped[1]};
    for (SkeletexModel& model : untold) model.sampling = {};
    const double mixed = mean_angle(half_way({untold[0], untold[1]}));
    EXPECT_GT(mixed, 1.2 * from_snapped);
    RecordProperty(
        first,
        fmt::format("{:.2f} degrees in the model, half-way {:.2f} mixed, {:.2f} made regular, {:.2f} from even models",
                    own, mixed, from_snapped, from_regular));
  }
}

}  // namespace skeletex
