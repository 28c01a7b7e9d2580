// SPDX-License-Identifier: MIT
#include "skeletex/convert/parameterize/vsm_tables.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "skeletex/geometry/parallel.h"
#include "skeletex/math/portable.h"

namespace skeletex {
namespace {

/// Slivers of the cut count as this much of the mean surface area: their weights stay in the others' range.
constexpr double kSmallestArea = 1e-6;

/// The vertices of a chart. Poles act on u only: at their neighbours the matrices of u and v differ.
OrderedGraph graph_of(const Chart& chart) {
  OrderedGraph system{{chart.positions, chart.half_edges.begin, chart.half_edges.targets, {}, {}}, {}, 0};
  for (const ChartVertex kind : chart.kinds) system.graph.is_unknown.push_back(kind == ChartVertex::kInner);
  system.graph.is_last.assign(chart.kinds.size(), 0);
  for (const Triangle& t : chart.triangles)
    if (std::any_of(t.begin(), t.end(), [&](int v) { return is_pole(chart.kinds[v]); }))
      for (const int v : t) system.graph.is_last[v] = 1;
  system.dissection = dissect(system.graph);
  return system;
}

class TableBuilder {
 public:
  TableBuilder(std::span<const Chart> charts, double alpha) : charts_(charts), alpha_(alpha) {}

  VsmTables build() {
    place_rows();
    place_entries();
    for_each_index(charts_.size(), [&](std::size_t k) {
      fill_map(k);
      fill_entries(k);
      fill_corners(k);
    });
    s_.elimination = make_elimination_tables(systems_, s_.layout.rows);
    join_tables();
    return std::move(s_);
  }

 private:
  /// Each chart's rows begin with a slice.
  void place_rows() {
    for (std::size_t k = 0; k < charts_.size(); ++k) {
      first_rows_.push_back(s_.layout.rows);
      first_triangles_.push_back(s_.layout.triangles);
      const int slices = (static_cast<int>(charts_[k].positions.size()) + VSM_SLICE - 1) / VSM_SLICE;
      slice_chart_.resize(slice_chart_.size() + slices, static_cast<int>(k));
      s_.layout.rows += slices * VSM_SLICE;
      s_.layout.triangles += static_cast<int>(charts_[k].triangles.size());
    }
    systems_.resize(charts_.size());
    row_length_.assign(s_.layout.rows, 0);
    for_each_index(charts_.size(), [&](std::size_t k) {
      systems_[k] = graph_of(charts_[k]);
      systems_[k].first_row = first_rows_[k];
      const Dissection& d = systems_[k].dissection;
      for (std::size_t i = 0; i < d.order.size(); ++i)
        row_length_[first_rows_[k] + i] = static_cast<int>(systems_[k].graph.neighbours(d.order[i]).size());
    });
  }

  void place_entries() {
    for (int slice = 0; slice < s_.layout.rows; slice += VSM_SLICE) {
      slice_begin_.push_back(s_.layout.entries);
      s_.layout.entries +=
          VSM_SLICE * *std::max_element(row_length_.begin() + slice, row_length_.begin() + slice + VSM_SLICE);
    }
    later_end_.assign(s_.layout.rows, 0);
    fixed_end_.assign(s_.layout.rows, 0);
    columns_.assign(s_.layout.entries, 0);
    entry_triangles_.assign(2 * static_cast<std::size_t>(s_.layout.entries), 0);
    s_.jumps.assign(s_.layout.entries, 0);
    s_.factors.assign(s_.layout.entries, 1);
    s_.corners.resize(3 * static_cast<std::size_t>(s_.layout.triangles));
    s_.corner_jumps.resize(2 * static_cast<std::size_t>(s_.layout.triangles));
    s_.map.assign(4 * static_cast<std::size_t>(s_.layout.rows), 0);
    s_.device_vertices.resize(charts_.size());
  }

  /// Unknowns in their order, then fixed vertices.
  void fill_map(std::size_t k) {
    const Chart& chart = charts_[k];
    const Dissection& d = systems_[k].dissection;
    std::vector<int>& rows = s_.device_vertices[k];
    int next = first_rows_[k] + static_cast<int>(d.order.size());
    for (std::size_t v = 0; v < chart.positions.size(); ++v) {
      rows.push_back(d.number[v] >= 0 ? first_rows_[k] + d.number[v] : next++);
      for (const int axis : {0, 1}) {
        const double x = axis == 0 ? chart.u[v] : chart.v[v];
        const std::size_t at = 4 * static_cast<std::size_t>(rows[v]) + axis;
        s_.map[at] = static_cast<float>(x);
        s_.map[at + 2] = static_cast<float>(x - static_cast<double>(s_.map[at]));
      }
    }
  }

  void fill_entries(std::size_t k) {
    const Chart& chart = charts_[k];
    const HalfEdgeTable& table = chart.half_edges;
    const Dissection& d = systems_[k].dissection;
    const std::vector<int>& rows = s_.device_vertices[k];
    const std::vector<double> surface = relative_surface_areas(chart);
    for (std::size_t i = 0; i < d.order.size(); ++i) {
      const int v = d.order[i], row = rows[v], first_entry = slice_begin_[row / VSM_SLICE] + row % VSM_SLICE;
      for (const int to : systems_[k].graph.neighbours(v)) {
        later_end_[row] += d.number[to] > d.number[v];
        fixed_end_[row] += d.number[to] > d.number[v] || d.number[to] < 0;
      }
      int later = 0, fixed = later_end_[row], before = fixed_end_[row];
      for (int at = table.begin[v]; at < table.begin[v + 1]; ++at) {
        const int h = table.outgoing[at], to = table.targets[at];
        int& place = d.number[to] < 0 ? fixed : d.number[to] > d.number[v] ? later : before;
        const int e = first_entry + VSM_SLICE * place++, own = h / 3, other = table.twins[h] / 3;
        columns_[e] = rows[to];
        s_.jumps[e] =
            is_pole(chart.kinds[to])
                ? VSM_POLE
                : static_cast<signed char>(chart.turns[own][HalfEdgeTable::next(h) % 3] - chart.turns[own][h % 3]);
        entry_triangles_[e] = first_triangles_[k] + own;
        entry_triangles_[s_.layout.entries + e] = first_triangles_[k] + other;
        // The same bits in both directions.
        const float area = static_cast<float>(surface[own] + surface[other]);
        s_.factors[e] = alpha_ == 0.5 ? 1 / std::sqrt(area) : static_cast<float>(portable::pow(area, -alpha_));
      }
    }
  }

  void fill_corners(std::size_t k) {
    const Chart& chart = charts_[k];
    const std::vector<int>& rows = s_.device_vertices[k];
    const std::size_t all = s_.layout.triangles;
    for (std::size_t t = 0; t < chart.triangles.size(); ++t) {
      const Triangle& triangle = chart.triangles[t];
      const auto& turns = chart.turns[t];
      // The pole first, if there is one.
      const auto pole = std::find_if(triangle.begin(), triangle.end(), [&](int v) { return is_pole(chart.kinds[v]); });
      const bool has_pole = pole != triangle.end();
      const std::size_t a = has_pole ? pole - triangle.begin() : 0, b = (a + 1) % 3, c = (a + 2) % 3,
                        at = first_triangles_[k] + t;
      s_.corners[at] = rows[triangle[a]];
      s_.corners[all + at] = rows[triangle[b]];
      s_.corners[2 * all + at] = rows[triangle[c]];
      s_.corner_jumps[at] = has_pole ? VSM_POLE : static_cast<signed char>(turns[b] - turns[a]);
      s_.corner_jumps[all + at] = static_cast<signed char>(turns[c] - turns[has_pole ? b : a]);
    }
  }

  void join_tables() {
    const auto place = [&](const std::vector<int>& table) {
      const int begin = static_cast<int>(s_.tables.size());
      s_.tables.insert(s_.tables.end(), table.begin(), table.end());
      return begin;
    };
    place(slice_chart_);
    s_.layout.slice_begin = place(slice_begin_);
    s_.layout.row_length = place(row_length_);
    s_.layout.later_end = place(later_end_);
    s_.layout.fixed_end = place(fixed_end_);
    s_.layout.matrix_begin = place(s_.elimination.row_begin);
    s_.layout.columns = place(columns_);
    s_.layout.triangles_at = place(entry_triangles_);
  }

  std::span<const Chart> charts_;
  double alpha_;
  std::vector<OrderedGraph> systems_;
  std::vector<int> first_rows_, first_triangles_;  ///< per chart
  std::vector<int> slice_chart_, slice_begin_, row_length_, later_end_, fixed_end_, columns_, entry_triangles_;
  VsmTables s_;
};

}  // namespace

VsmTables make_vsm_tables(std::span<const Chart> charts, double alpha) { return TableBuilder(charts, alpha).build(); }

std::vector<double> relative_surface_areas(const Chart& chart) {
  std::vector<double> areas;
  areas.reserve(chart.triangles.size());
  double total = 0;
  for (const Triangle& t : chart.triangles) {
    const Vec3& a = chart.positions[t[0]];
    areas.push_back(0.5 * (chart.positions[t[1]] - a).cross(chart.positions[t[2]] - a).norm());
    total += areas.back();
  }
  const double mean = total / static_cast<double>(areas.size());
  for (double& area : areas) area = std::max(area / mean, kSmallestArea);
  return areas;
}

}  // namespace skeletex
