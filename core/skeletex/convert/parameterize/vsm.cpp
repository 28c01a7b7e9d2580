// SPDX-License-Identifier: MIT
#include "skeletex/convert/parameterize/vsm.h"

#include <algorithm>
#include <bit>
#include <climits>
#include <cmath>
#include <numbers>
#include <numeric>
#include <utility>

#include "skeletex/convert/parameterize/direct_map.h"
#include "skeletex/convert/parameterize/elimination.h"
#include "skeletex/convert/parameterize/vsm_tables.h"
#include "skeletex/geometry/parallel.h"
#include "skeletex/math/portable.h"

namespace skeletex {
namespace {

double spread_of(std::span<const double> areas) {
  const double count = static_cast<double>(areas.size());
  const double mean = std::accumulate(areas.begin(), areas.end(), 0.0) / count;
  double variance = 0;
  for (const double a : areas) variance += (a - mean) * (a - mean) / count;
  return std::sqrt(variance) / mean;
}

/// Between two poles v is free to turn: it is turned to the measured angles, which the first guess holds.
void settle_rotation(Chart& chart, const std::vector<double>& guess) {
  double x = 0, y = 0;
  for (std::size_t i = 0; i < guess.size(); ++i) {
    if (chart.kinds[i] != ChartVertex::kInner) continue;
    const double angle = 2 * std::numbers::pi * (guess[i] - chart.v[i]);
    x += portable::cos(angle);
    y += portable::sin(angle);
  }
  const double shift = portable::atan2(y, x) / (2 * std::numbers::pi);
  for (std::size_t i = 0; i < guess.size(); ++i)
    if (chart.kinds[i] == ChartVertex::kInner) chart.v[i] += shift;
}

/// Work-items of a group. One on a CPU, unless a test asks for more (work_group.h).
std::size_t group_size(const ClContext& context, const VsmOptions& options) {
  return options.work_group_size > 0 ? options.work_group_size : context.row_items();
}

class VsmSolver {
 public:
  VsmSolver(ClContext& context, std::span<Chart> charts, const VsmOptions& options, VsmTables tables)
      : context_(context),
        charts_(charts),
        options_(options),
        kernel_options_(context.row_items() == 1 && group_size(context, options) > 1 ? "-DGROUP_BARRIERS" : ""),
        elimination_(context, std::exchange(tables.elimination, {}), tables.layout.rows, group_size(context, options),
                     kernel_options_),
        layout_(tables.layout),
        device_vertices_(std::move(tables.device_vertices)),
        tables_(context.upload(tables.tables)),
        jumps_(context.upload(tables.jumps)),
        corner_jumps_(context.upload(tables.corner_jumps)),
        corners_(context.upload(tables.corners)),
        factors_(context.upload(tables.factors)),
        map_(context.upload(tables.map)),
        areas_(context.allocate<float>(layout_.triangles)),
        largest_(context.allocate<int>(charts.size())),
        ratios_(context.allocate<int>(charts.size())),
        is_frozen_(charts.size(), 1),
        is_stopped_(charts.size(), false),
        iterations_(charts.size(), 0),
        steps_(charts.size(), 0),
        final_ratios_(charts.size(), 0),
        spreads_(charts.size(), 0) {
    const std::size_t entries = layout_.entries, rows = layout_.rows;
    weights_ = context.allocate<float>(2 * entries + rows);
    exponents_ = context.allocate<int>(entries + rows);
    context.fill(weights_, 0.5f);
    context.fill(exponents_, 1);
    frozen_ = context.upload(is_frozen_);
    // What needs to be known of the elimination's rows and planes.
    layout_.fixed = elimination_.layout().fixed;
    layout_.roots = elimination_.layout().roots;
    layout_.residual = elimination_.layout().residual;
  }

  std::vector<MapReport> run() {
    for (bool is_last = options_.iterations == 0;;) {
      weigh();
      solve(static_cast<float>(is_last ? options_.tolerance : options_.intermediate_tolerance));
      if (is_last) return finish();
      context_.launch(kernel("measure_areas"), ClRange(layout_.triangles), layout_, corners_, corner_jumps_, map_,
                      areas_);
      if (options_.stop_spread_change > 0) stop_settled();
      is_last = true;
      for (std::size_t k = 0; k < charts_.size(); ++k)
        if (!is_stopped_[k]) is_last &= ++iterations_[k] == options_.iterations;
      freeze();
    }
  }

 private:
  ClKernelName kernel(std::string_view name) const { return {"vsm.cl", name, kernel_options_}; }
  /// A group per slice.
  ClRange slices() const {
    const bool is_single = context_.row_items() == 1 && group_size(context_, options_) == 1;
    const std::size_t items = is_single ? 1 : VSM_SLICE;
    return {{static_cast<std::size_t>(layout_.rows) / VSM_SLICE * items, 1}, {items, 1}};
  }

  void weigh() {
    context_.fill(largest_, INT_MIN);
    context_.launch(kernel("weigh_rows"), slices(), layout_, tables_, frozen_, factors_, areas_, weights_, exponents_,
                    largest_);
  }

  bool is_solved(float tolerance) {
    context_.fill(ratios_, 0);
    context_.launch(kernel("form_residual"), slices(), layout_, tables_, jumps_, weights_, exponents_, largest_, map_,
                    elimination_.system(), ratios_);
    const std::vector<int> bits = context_.download(ratios_);
    for (std::size_t k = 0; k < charts_.size(); ++k) final_ratios_[k] = std::bit_cast<float>(bits[k]);
    return std::all_of(final_ratios_.begin(), final_ratios_.end(), [&](float ratio) { return ratio <= tolerance; });
  }

  void solve(float tolerance) {
    for (int step = 0; !is_solved(tolerance) && step < options_.max_steps; ++step) {
      for (std::size_t k = 0; k < charts_.size(); ++k) steps_[k] += final_ratios_[k] > tolerance;
      if (step == 0)
        context_.launch(kernel("scale_rows"), ClRange(layout_.rows), layout_, tables_, jumps_, weights_, exponents_,
                        elimination_.system());
      elimination_.solve(step == 0, tolerance, ratios_, map_);
    }
  }

  /// Marks the charts whose spread has changed too little.
  void stop_settled() {
    const std::vector<float> now = context_.download(areas_);
    auto first = now.begin();
    for (std::size_t k = 0; k < charts_.size(); ++k) {
      const auto end = first + static_cast<std::ptrdiff_t>(charts_[k].triangles.size());
      const double spread = spread_of(std::vector<double>(first, end));
      if (iterations_[k] > 0 && std::abs(spread - spreads_[k]) < options_.stop_spread_change * spreads_[k])
        is_stopped_[k] = true;
      spreads_[k] = spread;
      first = end;
    }
  }

  /// Weights are frozen at the first solve, and those of charts that have stopped.
  void freeze() {
    const std::vector<int> now(is_stopped_.begin(), is_stopped_.end());
    if (now != is_frozen_) context_.write(frozen_, is_frozen_ = now);
  }

  std::vector<MapReport> finish() {
    const std::vector<float> map = context_.download(map_);
    std::vector<MapReport> reports(charts_.size());
    for_each_index(charts_.size(), [&](std::size_t k) {
      Chart& chart = charts_[k];
      const std::vector<double> guess = chart.v;
      for (std::size_t v = 0; v < chart.positions.size(); ++v) {
        if (chart.kinds[v] != ChartVertex::kInner) continue;
        const float* at = &map[4 * static_cast<std::size_t>(device_vertices_[k][v])];
        chart.u[v] = static_cast<double>(at[0]) + static_cast<double>(at[2]);
        chart.v[v] = static_cast<double>(at[1]) + static_cast<double>(at[3]);
      }
      MapReport& report = reports[k];
      report.iterations = iterations_[k];
      report.solver_steps = steps_[k];
      report.residual = final_ratios_[k];
      report.flipped_triangles = count_flipped(chart);
      if (report.flipped_triangles > 0) {
        report.iterations = map_directly(chart, iterations_[k], options_.alpha);
        report.used_direct_solver = true;
        report.flipped_triangles = count_flipped(chart);
      }
      if (chart.topology == SegmentTopology::kSphere) settle_rotation(chart, guess);
      report.spread = spread_of(texture_areas(chart));
    });
    return reports;
  }

  ClContext& context_;
  std::span<Chart> charts_;
  const VsmOptions& options_;
  const char* kernel_options_;
  Elimination elimination_;
  VsmLayout layout_;
  std::vector<std::vector<int>> device_vertices_;
  ClBuffer<int> tables_;
  ClBuffer<signed char> jumps_, corner_jumps_;
  ClBuffer<int> corners_;
  ClBuffer<float> factors_, map_, areas_, weights_;
  ClBuffer<int> exponents_, frozen_, largest_, ratios_;
  std::vector<int> is_frozen_;
  std::vector<bool> is_stopped_;
  std::vector<int> iterations_, steps_;
  std::vector<float> final_ratios_;
  std::vector<double> spreads_;
};

class VsmMethod : public ParameterizationMethod {
 public:
  std::vector<MapReport> map(ClContext& context, std::span<Chart> charts, const MapOptions& options) const override {
    return solve_vsm(context, charts, options.vsm);
  }
};

}  // namespace

std::vector<MapReport> solve_vsm(ClContext& context, std::span<Chart> charts, const VsmOptions& options) {
  if (charts.empty()) return {};
  return VsmSolver(context, charts, options, make_vsm_tables(charts, options.alpha)).run();
}

std::unique_ptr<ParameterizationMethod> make_vsm_method() { return std::make_unique<VsmMethod>(); }

}  // namespace skeletex
