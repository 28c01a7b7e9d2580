// SPDX-License-Identifier: MIT
#include "skeletex/convert/fit/fit.h"

#include <algorithm>
#include <span>

#include "fit_structs.h"
#include "skeletex/convert/fit/mean_distance.h"

namespace skeletex {
namespace {

constexpr int kColours = 6;
constexpr int kSweeps = 4;           // of the solver, per step
constexpr float kDamping = 0.0005f;  // of a step, share of a texel's mean diagonal entry
constexpr float kSprings = 0.001f;   // between the steps of neighbouring texels, the same share
constexpr double kFloor = 1;         // added to |residual| in the weights, share of the mean one

}  // namespace

FitReport fit_points(ClContext& context, const DeviceLayout& layout, const DeviceMaps& maps,
                     const ClBuffer<int>& covering, const ReadingPositions& positions, DevicePlanes& points,
                     double steps) {
  const std::size_t size = layout.size();
  const auto planes = [&](std::size_t count) { return context.allocate<float>(count * size); };
  auto samples = planes(FIT_SAMPLES * SAMPLE_PLANES), matched = planes(FIT_MATCHED_PLANES);
  auto lattice = planes(2 * LATTICE_PLANES), system = planes(SYSTEM_STRIDE);
  auto numbers = context.allocate<int>(FIT_NUMBER_PLANES * size);
  context.copy(covering, numbers);
  DevicePlanes moves = allocate_planes(context, size);
  FitParameters parameters{maps.sizes, layout.width, layout.height, 0, 0, kDamping, kSprings, 1};
  const auto launch = [&](const char* kernel, const auto&... arguments) {
    context.launch({"fit.cl", kernel}, layout.range(), parameters, layout.texel_patches, layout.tables.patches,
                   arguments...);
  };
  launch("read_samples", maps.triangles, maps.values, positions.offsets, points.values, numbers, samples);

  FitReport report;
  MeanDistance distance(context.download(layout.texel_patches), maps.first_triangle.size() - 1);
  const DevicePlanes start = points;
  DevicePlanes next = points;
  for (int step = 0;; ++step) {
    launch("choose_fitted_diagonals", next.values, numbers);
    launch("match_samples", samples, next.values, numbers, matched);
    launch("match_lattice", maps.triangles, maps.values, numbers, next.values, lattice, matched);
    const ClMapping<float> values = context.map(matched);
    const std::span<const float> costs(values.data() + FIT_COSTS * size, size),
        areas(values.data() + FIT_AREAS * size, size);
    if (step == 0) distance.leave_out_squeezed(costs, areas);
    const double residual = distance.of(costs, areas);
    // A step that does not help is not taken, and ends the fit.
    if (step > 0 && !(residual < report.residuals.back())) break;
    points = next;
    report.residuals.push_back(residual);
    if (step >= steps || residual == 0) break;

    parameters.least_residual = static_cast<float>(kFloor * residual);
    launch("assemble", samples, numbers, matched, lattice, system);
    context.fill(moves.values, 0.f);
    for (int sweep = 0; sweep < kSweeps; ++sweep)
      for (parameters.colour = 0; parameters.colour < kColours; ++parameters.colour)
        launch("relax_moves", system, moves.values);
    next = allocate_planes(context, size);
    parameters.share = static_cast<float>(std::min(1.0, steps - step));
    launch("move_points", start.values, points.values, moves.values, next.values);
  }
  return report;
}

}  // namespace skeletex
