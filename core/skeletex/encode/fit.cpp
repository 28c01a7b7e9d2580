// SPDX-License-Identifier: MIT
#include "skeletex/encode/fit.h"

#include <algorithm>
#include <bit>
#include <functional>

namespace skeletex {
namespace {

constexpr std::size_t kSamples = 4, kSamplePlanes = 7, kLatticePlanes = 5, kSystemStride = 36;  // as in fit.cl
constexpr int kColours = 6;
constexpr int kFarPasses = 8, kFarPassesOfSnapped = 2;  // the latter for the sake of time: a second one still finds a few
constexpr int kSeamRows = 2;
constexpr std::size_t kOutliers = 10;
constexpr float kShareOfFurthest = 0.85f;  // what is measured here is not all that there is

double sum_of(const std::vector<float>& values) {
  double sum = 0;
  for (const float value : values) sum += static_cast<double>(value);
  return sum;
}

TexelPoints allocate_points(ClContext& context, std::size_t size) {
  return {context.allocate<float>(size), context.allocate<float>(size), context.allocate<float>(size)};
}

void choose_diagonals(ClContext& context, const DeviceLayout& layout, const TexelPoints& points, ClBuffer<int>& diagonals) {
  context.launch({"fit.cl", "choose_diagonals"}, layout.range(), layout.width, layout.height, layout.texel_patches, layout.patches, points.x, points.y,
                 points.z, diagonals);
}

/// How far mesh and lattice are from each other, quad by quad.
class FarQuads {
 public:
  FarQuads(ClContext& context, const DeviceLayout& layout, const DeviceMaps& maps, const ClBuffer<int>& covering, const SnapFeatures& features,
           bool is_fitted)
      : context_(context), layout_(layout), maps_(maps), covering_(covering), count_(static_cast<int>(features.vertices.size())), is_fitted_(is_fitted) {
    std::vector<int> patches, points;
    std::vector<float> x, y;
    for (const SnapFeatures::Vertex& vertex : features.vertices) {
      patches.push_back(vertex.patch), points.push_back(vertex.point);
      x.push_back(static_cast<float>(vertex.x)), y.push_back(static_cast<float>(vertex.y));
    }
    patches_ = context.upload(patches), points_ = context.upload(points), x_ = context.upload(x), y_ = context.upload(y);
    diagonals_ = context.allocate<int>(layout.size()), furthest_ = context.allocate<int>(layout.size()), turned_ = context.allocate<int>(1);
  }
  /// Per quad the largest distance between mesh and lattice, as the bits of a float.
  const ClBuffer<int>& measure(const TexelPoints& points) {
    choose_diagonals(context_, layout_, points, diagonals_);
    context_.fill(furthest_, 0), context_.fill(turned_, 0);
    if (count_ > 0)
      context_.launch({"fit.cl", "measure_vertices"}, ClRange({static_cast<std::size_t>(count_), 1}, {64, 1}), count_, layout_.width, patches_, points_, x_, y_,
                      layout_.patches, maps_.x, maps_.y, maps_.z, diagonals_, points.x, points.y, points.z, furthest_);
    context_.launch({"fit.cl", "measure_middles"}, layout_.range(), layout_.width, layout_.height, maps_.triangle_count, static_cast<int>(!is_fitted_),
                    layout_.texel_patches, layout_.patches, covering_, maps_.corners, maps_.across, maps_.x, maps_.y, maps_.z, diagonals_, points.x, points.y,
                    points.z, furthest_, turned_);
    return furthest_;
  }

  /// Triangles that looked against the mesh when it was last measured.
  int turned() const { return context_.download(turned_)[0]; }

 private:
  ClContext& context_;
  const DeviceLayout& layout_;
  const DeviceMaps& maps_;
  const ClBuffer<int>& covering_;
  int count_;
  bool is_fitted_;
  ClBuffer<int> patches_, points_, diagonals_, furthest_, turned_;
  ClBuffer<float> x_, y_;
};

}  // namespace

FarReport put_back_far(ClContext& context, std::span<const Patch> patches, const DeviceLayout& layout, const DeviceMaps& maps, const ClBuffer<int>& covering,
                       const SnapFeatures& features, const TexelPoints& even, const TexelPoints& filtered, bool is_fitted, ReadingPositions& positions,
                       TexelPoints& points) {
  FarReport report;
  FarQuads quads(context, layout, maps, covering, features, is_fitted);
  const std::vector<int> bits = context.download(quads.measure(filtered));
  report.even_turned_triangles = report.turned_triangles = quads.turned();
  // Next to seams the decoder makes strips, which quads only stand for, and a search that is caught somewhere finds too much:
  // what is furthest is taken from the other rows, without the few largest.
  std::vector<int> inner;
  for (const Patch& patch : patches) {
    const Rectangle& r = patch.rectangle;
    for (int row = kSeamRows; row < r.height - 1 - kSeamRows; ++row) {
      const auto begin = bits.begin() + (r.y + row) * static_cast<std::ptrdiff_t>(layout.width) + r.x;
      inner.insert(inner.end(), begin, begin + r.width);
    }
  }
  if (inner.size() <= kOutliers) return report;
  std::nth_element(inner.begin(), inner.begin() + kOutliers, inner.end(), std::greater());
  const float limit = kShareOfFurthest * std::bit_cast<float>(inner[kOutliers]);
  auto count = context.allocate<int>(1);
  for (int pass = 0; pass < (is_fitted ? kFarPasses : kFarPassesOfSnapped); ++pass) {
    context.fill(count, 0);
    context.launch({"fit.cl", "put_far_back"}, layout.range(), layout.width, layout.height, limit, layout.texel_patches, layout.patches,
                   quads.measure(points), filtered.x, filtered.y, filtered.z, positions.home_x, positions.home_y, positions.anchors, positions.x, positions.y, points.x, points.y, points.z, count);
    report.turned_triangles = quads.turned();
    const int back = context.download(count)[0];
    if (back == 0) break;
    report.texels_put_back += back + put_back_folds(context, layout, even, filtered, true, positions, points);
  }
  return report;
}

FitReport fit_points(ClContext& context, const DeviceLayout& layout, const DeviceMaps& maps, const ClBuffer<int>& covering, const TexelPoints& even,
                     ReadingPositions& positions, TexelPoints& points, const FitOptions& options) {
  const std::size_t size = layout.size();
  const auto planes = [&](std::size_t count) { return context.allocate<float>(count * size); };
  auto samples = planes(kSamples * kSamplePlanes), weights = planes(2 * kSamples), residuals = planes(kSamples);
  auto lattice = planes(2 * kLatticePlanes), system = planes(kSystemStride), costs = planes(1), areas = planes(1);
  auto sample_triangles = context.allocate<int>(kSamples * size), matches = context.allocate<int>(kSamples * size), diagonals = context.allocate<int>(size);
  TexelPoints moves = allocate_points(context, size);
  context.launch({"fit.cl", "read_samples"}, layout.range(), layout.width, layout.height, maps.triangle_count, layout.texel_patches, covering, maps.corners,
                 maps.turns, maps.poles, maps.across, maps.u_high, maps.u_low, maps.v_high, maps.v_low, maps.x, maps.y, maps.z, layout.patches,
                 maps.row_high, maps.row_low, positions.x, positions.y, points.x, points.y, points.z, samples, sample_triangles);

  FitReport report;
  const TexelPoints start = points;
  TexelPoints next = points;
  for (int step = 0;; ++step) {
    choose_diagonals(context, layout, next, diagonals);
    context.launch({"fit.cl", "match_samples"}, layout.range(), layout.width, layout.height, layout.texel_patches, layout.patches, samples, diagonals, next.x,
                   next.y, next.z, matches, weights, residuals, costs, areas);
    context.launch({"fit.cl", "match_lattice"}, layout.range(), layout.width, layout.height, maps.triangle_count, layout.texel_patches, layout.patches,
                   sample_triangles, maps.corners, maps.across, maps.x, maps.y, maps.z, diagonals, next.x, next.y, next.z, lattice, costs, areas);
    const double area = sum_of(context.download(areas)), residual = area > 0 ? sum_of(context.download(costs)) / area : 0;
    // A step that does not help is not taken, and ends the fit.
    if (step > 0 && !(residual < report.residuals.back())) break;
    points = next;
    report.residuals.push_back(residual);
    if (step == options.steps || residual == 0) break;

    context.launch({"fit.cl", "assemble"}, layout.range(), layout.width, layout.height, static_cast<float>(options.floor * residual), layout.texel_patches,
                   layout.patches, samples, diagonals, matches, weights, residuals, lattice, system);
    context.fill(moves.x, 0.f), context.fill(moves.y, 0.f), context.fill(moves.z, 0.f);
    for (int sweep = 0; sweep < options.sweeps; ++sweep)
      for (int colour = 0; colour < kColours; ++colour)
        context.launch({"fit.cl", "relax_moves"}, layout.range(), layout.width, layout.height, colour, options.damping, options.springs,
                       layout.texel_patches, layout.patches, system, moves.x, moves.y, moves.z);
    next = allocate_points(context, size);
    context.launch({"fit.cl", "move_points"}, layout.range(), layout.width, layout.height, layout.texel_patches, layout.patches, start.x, start.y, start.z,
                   points.x, points.y, points.z, moves.x, moves.y, moves.z, next.x, next.y, next.z);
  }
  report.texels_put_back = put_back_folds(context, layout, even, start, false, positions, points);
  return report;
}

}  // namespace skeletex
