// SPDX-License-Identifier: MIT
#include "skeletex/convert/fit/fit.h"

namespace skeletex {
namespace {

constexpr std::size_t kSamples = 4, kSamplePlanes = 7, kLatticePlanes = 5, kSystemStride = 36;  // as in fit.cl
constexpr int kColours = 6;

double sum_of(const std::vector<float>& values) {
  double sum = 0;
  for (const float value : values) sum += static_cast<double>(value);
  return sum;
}

TexelPoints allocate_points(ClContext& context, std::size_t size) {
  return {context.allocate<float>(size), context.allocate<float>(size), context.allocate<float>(size)};
}

void choose_diagonals(ClContext& context, const DeviceLayout& layout, const TexelPoints& points,
                      ClBuffer<int>& diagonals) {
  context.launch({"fit.cl", "choose_fitted_diagonals"}, layout.range(), layout.width, layout.height,
                 layout.texel_patches, layout.patches, points.x, points.y, points.z, diagonals);
}

}  // namespace

FitReport fit_points(ClContext& context, const DeviceLayout& layout, const DeviceMaps& maps,
                     const ClBuffer<int>& covering, const ReadingPositions& positions, TexelPoints& points,
                     const FitOptions& options) {
  const std::size_t size = layout.size();
  const auto planes = [&](std::size_t count) { return context.allocate<float>(count * size); };
  auto samples = planes(kSamples * kSamplePlanes), weights = planes(2 * kSamples), residuals = planes(kSamples);
  auto lattice = planes(2 * kLatticePlanes), system = planes(kSystemStride), costs = planes(1), areas = planes(1);
  auto sample_triangles = context.allocate<int>(kSamples * size), matches = context.allocate<int>(kSamples * size),
       diagonals = context.allocate<int>(size);
  TexelPoints moves = allocate_points(context, size);
  context.launch({"fit.cl", "read_samples"}, layout.range(), layout.width, layout.height, maps.triangle_count,
                 layout.texel_patches, covering, maps.corners, maps.turns, maps.poles, maps.across, maps.u_high,
                 maps.u_low, maps.v_high, maps.v_low, maps.x, maps.y, maps.z, layout.patches, maps.row_high,
                 maps.row_low, positions.x, positions.y, points.x, points.y, points.z, samples, sample_triangles);

  FitReport report;
  const TexelPoints start = points;
  TexelPoints next = points;
  for (int step = 0;; ++step) {
    choose_diagonals(context, layout, next, diagonals);
    context.launch({"fit.cl", "match_samples"}, layout.range(), layout.width, layout.height, layout.texel_patches,
                   layout.patches, samples, diagonals, next.x, next.y, next.z, matches, weights, residuals, costs,
                   areas);
    context.launch({"fit.cl", "match_lattice"}, layout.range(), layout.width, layout.height, maps.triangle_count,
                   layout.texel_patches, layout.patches, sample_triangles, maps.corners, maps.across, maps.x, maps.y,
                   maps.z, diagonals, next.x, next.y, next.z, lattice, costs, areas);
    const double area = sum_of(context.download(areas)),
                 residual = area > 0 ? sum_of(context.download(costs)) / area : 0;
    // A step that does not help is not taken, and ends the fit.
    if (step > 0 && !(residual < report.residuals.back())) break;
    points = next;
    report.residuals.push_back(residual);
    if (step == options.steps || residual == 0) break;

    context.launch({"fit.cl", "assemble"}, layout.range(), layout.width, layout.height,
                   static_cast<float>(options.floor * residual), layout.texel_patches, layout.patches, samples,
                   diagonals, matches, weights, residuals, lattice, system);
    context.fill(moves.x, 0.f), context.fill(moves.y, 0.f), context.fill(moves.z, 0.f);
    for (int sweep = 0; sweep < options.sweeps; ++sweep)
      for (int colour = 0; colour < kColours; ++colour)
        context.launch({"fit.cl", "relax_moves"}, layout.range(), layout.width, layout.height, colour, options.damping,
                       options.springs, layout.texel_patches, layout.patches, system, moves.x, moves.y, moves.z);
    next = allocate_points(context, size);
    context.launch({"fit.cl", "move_points"}, layout.range(), layout.width, layout.height, layout.texel_patches,
                   layout.patches, start.x, start.y, start.z, points.x, points.y, points.z, moves.x, moves.y, moves.z,
                   next.x, next.y, next.z);
  }
  return report;
}

}  // namespace skeletex
