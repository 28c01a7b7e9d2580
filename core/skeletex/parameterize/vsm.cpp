// SPDX-License-Identifier: MIT
#include "skeletex/parameterize/vsm.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <Eigen/SparseCholesky>
#include <Eigen/SparseCore>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>

#include "skeletex/model/parallel.h"
#include "skeletex/parameterize/half_edge_table.h"

namespace skeletex {
namespace {

constexpr int kSlice = 32;   // VSM_SLICE
constexpr int kStride = 32;  // VSM_STRIDE
constexpr int kBlock = 8;    // VSM_BLOCK
constexpr signed char kPoleJump = -128;  // VSM_POLE

/// Slivers of the cut count as this much of the mean surface area: their weights stay in the others' range.
constexpr double kSmallestArea = 1e-6;
constexpr int kCheckSteps = 10;  // between two looks at the true residual, which costs as much as two steps
/// Cells of the coarse space have about this many vertices, more in charts that would get more cells than this: the cells'
/// matrix is dense.
constexpr std::size_t kCellSize = 16, kMaxCells = 192;

bool is_pole(ChartVertex kind) { return kind == ChartVertex::kHeadPole || kind == ChartVertex::kTailPole; }

/// Surface areas, kept away from zero, in units of the chart's mean.
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

double spread_of(const std::vector<double>& areas) {
  const double count = static_cast<double>(areas.size());
  const double mean = std::accumulate(areas.begin(), areas.end(), 0.0) / count;
  double variance = 0;
  for (const double a : areas) variance += (a - mean) * (a - mean) / count;
  return std::sqrt(variance) / mean;
}

/// The inner neighbours of inner vertex i are vertices[begin[i]] to vertices[begin[i + 1] - 1].
struct InnerNeighbours {
  std::vector<int> begin, vertices;
};

InnerNeighbours find_inner_neighbours(const Chart& chart) {
  const auto is_inner = [&](int v) { return chart.kinds[v] == ChartVertex::kInner; };
  const auto for_edges = [&](const auto& visit) {
    for (const Triangle& t : chart.triangles)
      for (const int c : {0, 1, 2})
        if (const int from = t[c], to = t[(c + 1) % 3]; is_inner(from) && is_inner(to)) visit(from, to);
  };
  InnerNeighbours found;
  found.begin.assign(chart.positions.size() + 1, 0);
  for_edges([&](int from, int) { ++found.begin[from + 1]; });
  std::partial_sum(found.begin.begin(), found.begin.end(), found.begin.begin());
  found.vertices.resize(found.begin.back());
  std::vector<int> next(found.begin.begin(), found.begin.end() - 1);
  for_edges([&](int from, int to) { found.vertices[next[from]++] = to; });
  return found;
}

/// Groups the inner vertices of a chart into cells of `size` connected vertices, each grown breadth first from a vertex next
/// to the cells before it. A cell that is walled in before it has more than half that size joins the smallest one beside it.
std::vector<std::vector<int>> grow_cells(const Chart& chart, std::size_t size) {
  const int count = static_cast<int>(chart.positions.size());
  const InnerNeighbours neighbours = find_inner_neighbours(chart);
  const auto beside = [&](int v) {
    return std::span(neighbours.vertices).subspan(neighbours.begin[v], neighbours.begin[v + 1] - neighbours.begin[v]);
  };
  std::vector<std::vector<int>> cells;
  std::vector<int> cell_of(count, -1);
  std::vector<int> front;  // neighbours of cells, in the order in which the cells reached them
  std::vector<bool> is_in_front(count, false);
  auto take_seed = [&, next_front = std::size_t{0}, next_vertex = 0]() mutable {
    for (; next_front < front.size(); ++next_front)
      if (cell_of[front[next_front]] < 0) return front[next_front];
    for (; next_vertex < count; ++next_vertex)
      if (chart.kinds[next_vertex] == ChartVertex::kInner && cell_of[next_vertex] < 0) return next_vertex;
    return -1;
  };
  for (int seed = take_seed(); seed >= 0; seed = take_seed()) {
    const int id = static_cast<int>(cells.size());
    std::vector<int> cell{seed};
    cell_of[seed] = id;
    for (std::size_t i = 0; i < cell.size(); ++i)
      for (const int v : beside(cell[i]))
        if (cell_of[v] < 0 && cell.size() < size) {
          cell_of[v] = id;
          cell.push_back(v);
        }
    int smallest = -1;
    for (const int member : cell)
      for (const int v : beside(member)) {
        const int other = cell_of[v];
        if (other >= 0 && other != id && (smallest < 0 || cells[other].size() < cells[smallest].size())) smallest = other;
        if (!is_in_front[v]) {
          is_in_front[v] = true;
          front.push_back(v);
        }
      }
    if (2 * cell.size() <= size && smallest >= 0) {
      for (const int v : cell) cell_of[v] = smallest;
      cells[smallest].insert(cells[smallest].end(), cell.begin(), cell.end());
    } else {
      cells.push_back(std::move(cell));
    }
  }
  return cells;
}

/// The systems of all charts in the layout of vsm.cl.
struct DeviceSystems {
  int vertices = 0, triangles = 0, entries = 0;
  int coarse = 0, matrices = 0;  ///< values in a coarse vector and in the coarse matrices of all charts
  std::vector<int> chart_begin, chart_rows, order;
  std::vector<std::vector<int>> device_vertices;  ///< per chart and vertex
  std::vector<int> cell_first, cell_counts, cell_begin, row_cells, matrix_begin;
  std::vector<int> slice_begin, row_length;
  std::vector<int> columns, twins, entry_triangles;  ///< entry_triangles: two planes
  std::vector<signed char> jumps;
  std::vector<float> factors;
  std::vector<int> corners;                 ///< three planes
  std::vector<signed char> corner_jumps;    ///< two planes
  std::vector<float> hi, lo;
};

int padded(int count, int unit) { return (count + unit - 1) / unit * unit; }

DeviceSystems build_systems(std::span<const Chart> charts, double alpha) {
  DeviceSystems s;
  std::vector<HalfEdgeTable> tables;
  for (const Chart& chart : charts) {
    const int count = static_cast<int>(chart.positions.size());
    tables.push_back(link_half_edges(chart.triangles, count));
    const auto cells = grow_cells(chart, std::max(kCellSize, chart.positions.size() / kMaxCells));
    const int cell_count = static_cast<int>(cells.size());
    s.chart_begin.push_back(s.vertices);
    std::vector<int>& map = s.device_vertices.emplace_back(count);
    int next = s.vertices;
    s.cell_first.push_back(s.coarse);
    s.cell_counts.push_back(cell_count);
    s.matrix_begin.push_back(s.matrices);
    s.row_cells.resize(s.vertices + padded(count, kSlice), 0);
    for (int cell = 0; cell < cell_count; ++cell) {
      s.cell_begin.push_back(next);
      for (const int v : cells[cell]) {
        s.row_cells[next] = cell;
        map[v] = next++;
      }
    }
    s.cell_begin.push_back(next);
    s.coarse += padded(cell_count + 1, kBlock);
    s.cell_begin.resize(s.coarse, next);
    s.matrices += cell_count * padded(cell_count, kBlock);
    s.chart_rows.push_back(next - s.vertices);
    for (int v = 0; v < count; ++v)
      if (chart.kinds[v] != ChartVertex::kInner) map[v] = next++;
    s.vertices += padded(count, kSlice);
    s.triangles += static_cast<int>(chart.triangles.size());
  }
  s.order.resize(charts.size());
  std::iota(s.order.begin(), s.order.end(), 0);
  std::stable_sort(s.order.begin(), s.order.end(), [&](int a, int b) { return s.chart_rows[a] > s.chart_rows[b]; });

  s.row_length.assign(s.vertices, 0);
  s.hi.assign(2 * static_cast<std::size_t>(s.vertices), 0);
  s.lo = s.hi;
  for (std::size_t k = 0; k < charts.size(); ++k) {
    const Chart& chart = charts[k];
    for (const Triangle& t : chart.triangles)
      for (const int v : t)
        if (chart.kinds[v] == ChartVertex::kInner) ++s.row_length[s.device_vertices[k][v]];
    for (std::size_t v = 0; v < chart.positions.size(); ++v)
      for (const int axis : {0, 1}) {
        const double x = axis == 0 ? chart.u[v] : chart.v[v];
        const std::size_t at = 2 * static_cast<std::size_t>(s.device_vertices[k][v]) + axis;
        s.hi[at] = static_cast<float>(x);
        s.lo[at] = static_cast<float>(x - static_cast<double>(s.hi[at]));
      }
  }
  for (int slice = 0; slice < s.vertices; slice += kSlice) {
    s.slice_begin.push_back(s.entries);
    s.entries += kSlice * *std::max_element(s.row_length.begin() + slice, s.row_length.begin() + slice + kSlice);
  }

  s.columns.assign(s.entries, 0);
  s.twins.assign(s.entries, -1);
  s.entry_triangles.assign(2 * static_cast<std::size_t>(s.entries), 0);
  s.jumps.assign(s.entries, 0);
  s.factors.assign(s.entries, 1);
  s.corners.resize(3 * static_cast<std::size_t>(s.triangles));
  s.corner_jumps.resize(2 * static_cast<std::size_t>(s.triangles));
  std::vector<int> filled(s.vertices, 0);
  int first_triangle = 0;
  for (std::size_t k = 0; k < charts.size(); ++k) {
    const Chart& chart = charts[k];
    const std::vector<int>& map = s.device_vertices[k];
    const HalfEdgeTable& table = tables[k];
    const std::vector<double> surface = relative_surface_areas(chart);
    // An inner vertex's neighbours are the ends of its outgoing half-edges.
    std::vector<int> entry_of(table.twins.size(), -1);
    for (int h = 0; h < static_cast<int>(table.twins.size()); ++h) {
      const Triangle& t = chart.triangles[h / 3];
      const int from = t[h % 3], to = t[HalfEdgeTable::next(h) % 3];
      if (chart.kinds[from] != ChartVertex::kInner) continue;
      const int row = map[from];
      const int e = s.slice_begin[row / kSlice] + kSlice * filled[row]++ + row % kSlice;
      entry_of[h] = e;
      s.columns[e] = map[to];
      const auto& turns = chart.turns[h / 3];
      s.jumps[e] = is_pole(chart.kinds[to]) ? kPoleJump : static_cast<signed char>(turns[HalfEdgeTable::next(h) % 3] - turns[h % 3]);
      const int other = table.twins[h] / 3;
      s.entry_triangles[e] = first_triangle + h / 3;
      s.entry_triangles[s.entries + e] = first_triangle + other;
      s.factors[e] = static_cast<float>(std::pow(surface[h / 3] + surface[other], -alpha));
      if (const int twin = entry_of[table.twins[h]]; twin >= 0) {
        s.twins[e] = twin;
        s.twins[twin] = e;
      }
    }
    for (std::size_t t = 0; t < chart.triangles.size(); ++t) {
      int first = 0;
      for (const int c : {1, 2})
        if (is_pole(chart.kinds[chart.triangles[t][c]])) first = c;
      const bool has_pole = is_pole(chart.kinds[chart.triangles[t][first]]);
      const std::size_t at = first_triangle + t;
      for (int c = 0; c < 3; ++c) s.corners[c * static_cast<std::size_t>(s.triangles) + at] = map[chart.triangles[t][(first + c) % 3]];
      const auto turn = [&](int c) { return chart.turns[t][(first + c) % 3]; };
      s.corner_jumps[at] = has_pole ? kPoleJump : static_cast<signed char>(turn(1) - turn(0));
      s.corner_jumps[s.triangles + at] = static_cast<signed char>(turn(2) - turn(has_pole ? 1 : 0));
    }
    first_triangle += static_cast<int>(chart.triangles.size());
  }
  return s;
}

void read_map(const DeviceSystems& s, std::size_t k, const std::vector<float>& hi, const std::vector<float>& lo, Chart& chart) {
  for (std::size_t v = 0; v < chart.positions.size(); ++v) {
    if (chart.kinds[v] != ChartVertex::kInner) continue;
    const std::size_t at = 2 * static_cast<std::size_t>(s.device_vertices[k][v]);
    chart.u[v] = static_cast<double>(hi[at]) + static_cast<double>(lo[at]);
    chart.v[v] = static_cast<double>(hi[at + 1]) + static_cast<double>(lo[at + 1]);
  }
}

/// Between two poles v is free to turn: it is turned to the measured angles, which the first guess holds.
void settle_rotation(Chart& chart, const std::vector<double>& guess) {
  double x = 0, y = 0;
  for (std::size_t i = 0; i < guess.size(); ++i) {
    if (chart.kinds[i] != ChartVertex::kInner) continue;
    const double angle = 2 * std::numbers::pi * (guess[i] - chart.v[i]);
    x += std::cos(angle);
    y += std::sin(angle);
  }
  const double shift = std::atan2(y, x) / (2 * std::numbers::pi);
  for (std::size_t i = 0; i < guess.size(); ++i)
    if (chart.kinds[i] == ChartVertex::kInner) chart.v[i] += shift;
}

/// The same map by a sparse factorization in double precision on the host.
void solve_directly(Chart& chart, const VsmOptions& options, int iterations) {
  const int count = static_cast<int>(chart.positions.size());
  const HalfEdgeTable table = link_half_edges(chart.triangles, count);
  const std::vector<double> surface = relative_surface_areas(chart);
  std::vector<int> unknown(count, -1);
  int rows = 0;
  for (int i = 0; i < count; ++i)
    if (chart.kinds[i] == ChartVertex::kInner) unknown[i] = rows++;
  const auto corner = [&](int h) { return chart.triangles[h / 3][h % 3]; };
  std::vector<double> weights(table.twins.size(), 1);
  for (int iteration = 0;; ++iteration) {
    for (const bool is_u : {true, false}) {
      std::vector<double>& x = is_u ? chart.u : chart.v;
      const auto for_entries = [&](const auto& visit) {
        for (int h = 0; h < static_cast<int>(table.twins.size()); ++h) {
          const int to = corner(HalfEdgeTable::next(h));
          if (unknown[corner(h)] < 0 || (!is_u && is_pole(chart.kinds[to]))) continue;
          visit(h, unknown[corner(h)], to, is_u ? 0.0 : static_cast<double>(chart.turns[h / 3][HalfEdgeTable::next(h) % 3] - chart.turns[h / 3][h % 3]));
        }
      };
      Eigen::VectorXd diagonal = Eigen::VectorXd::Zero(rows), right = Eigen::VectorXd::Zero(rows);
      for_entries([&](int h, int row, int, double) { diagonal[row] += weights[h]; });
      std::vector<Eigen::Triplet<double>> entries;
      for_entries([&](int h, int row, int to, double jump) {
        const double scale = weights[h] / std::sqrt(diagonal[row]);
        right[row] += scale * jump;
        if (unknown[to] >= 0)
          entries.emplace_back(row, unknown[to], -scale / std::sqrt(diagonal[unknown[to]]));
        else
          right[row] += scale * x[to];
      });
      // A lone bone's v is free to turn; a little more on one diagonal entry, and the same on the right, pins it.
      const bool is_free = !is_u && chart.topology == SegmentTopology::kSphere;
      for (int row = 0; row < rows; ++row) entries.emplace_back(row, row, is_free && row == 0 ? 2.0 : 1.0);
      Eigen::SparseMatrix<double> matrix(rows, rows);
      matrix.setFromTriplets(entries.begin(), entries.end());
      const Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> solver(matrix);
      Eigen::VectorXd solution = solver.solve(right);
      solution += solver.solve(right - matrix * solution);
      for (int i = 0; i < count; ++i)
        if (unknown[i] >= 0) x[i] = solution[unknown[i]] / std::sqrt(diagonal[unknown[i]]);
    }
    if (iteration == iterations) return;
    const std::vector<double> areas = texture_areas(chart);
    double largest = 0;
    for (int h = 0; h < static_cast<int>(table.twins.size()); ++h) {
      if (table.twins[h] < 0) continue;
      const int a = h / 3, b = table.twins[h] / 3;
      weights[h] *= std::max(areas[a] + areas[b], 1e-300) / std::pow(surface[a] + surface[b], options.alpha);
      largest = std::max(largest, weights[h]);
    }
    for (double& w : weights) w /= largest;
  }
}

std::size_t group_size(const ClContext& context, const VsmOptions& options) {
  return options.work_group_size > 0 ? options.work_group_size : context.device().type == "cpu" ? 1 : 1024;
}

}  // namespace

ClKernelName vsm_kernel(const ClContext& context, const VsmOptions& options) {
  return {"vsm.cl", "solve_charts", group_size(context, options) == 1 ? "-DVSM_SINGLE" : ""};
}

std::vector<VsmReport> solve_vsm(ClContext& context, std::span<Chart> charts, const VsmOptions& options) {
  std::vector<VsmReport> reports(charts.size());
  if (charts.empty()) return reports;
  const DeviceSystems s = build_systems(charts, options.alpha);
  const auto slice_begin = context.upload(s.slice_begin), row_length = context.upload(s.row_length);
  const auto columns = context.upload(s.columns), twins = context.upload(s.twins), entry_triangles = context.upload(s.entry_triangles);
  const auto jumps = context.upload(s.jumps), corner_jumps = context.upload(s.corner_jumps);
  const auto factors = context.upload(s.factors);
  const auto corners = context.upload(s.corners);
  const auto order = context.upload(s.order), chart_begin = context.upload(s.chart_begin), chart_rows = context.upload(s.chart_rows);
  const auto hi = context.upload(s.hi), lo = context.upload(s.lo);
  auto areas = context.allocate<float>(s.triangles);
  auto mantissas = context.allocate<float>(s.entries), shares = context.allocate<float>(s.entries), scaled = context.allocate<float>(s.entries);
  auto exponents = context.allocate<int>(s.entries);
  auto sums = context.allocate<float>(s.vertices), v_parts = context.allocate<float>(s.vertices), roots = context.allocate<float>(s.vertices);
  auto row_exponents = context.allocate<int>(s.vertices);
  const auto cell_first = context.upload(s.cell_first), cell_counts = context.upload(s.cell_counts), cell_begin = context.upload(s.cell_begin);
  const auto row_cells = context.upload(s.row_cells), matrix_begin = context.upload(s.matrix_begin);
  auto basis = context.allocate<float>(s.vertices), inverses = context.allocate<float>(s.matrices),
       coarse = context.allocate<float>(4 * static_cast<std::size_t>(s.coarse));
  const std::size_t pairs = 2 * static_cast<std::size_t>(s.vertices);
  auto residual = context.allocate<float>(pairs), direction = context.allocate<float>(pairs), product = context.allocate<float>(pairs),
       correction = context.allocate<float>(pairs);
  auto queue = context.allocate<int>(1), steps = context.allocate<int>(charts.size());
  auto ratios = context.allocate<float>(charts.size());
  context.fill(mantissas, 0.5f);
  context.fill(exponents, 1);
  context.fill(direction, 0.0f);
  context.fill(correction, 0.0f);
  context.fill(steps, 0);

  // On a CPU one work-item runs a plain loop over the rows; elsewhere a group is as large as the device allows. One program
  // holds all kernels: each is compiled once.
  const std::size_t wanted = group_size(context, options);
  const auto kernel = [&](std::string_view name) { return ClKernelName{"vsm.cl", name, vsm_kernel(context, options).options}; };
  const std::size_t group = context.work_group_size(kernel("invert_coarse"), context.work_group_size(kernel("solve_charts"), wanted));
  // More groups than charts do no harm, and drivers that hand groups to threads in blocks then use every thread.
  const std::size_t groups = std::max<std::size_t>(charts.size(), 64);
  const ClRange group_range({groups * group, 1}, {group, 1});
  const ClLocal scratch{(group + kStride) * sizeof(float)};
  const int chart_count = static_cast<int>(charts.size());
  std::vector<int> frozen(s.vertices / kSlice, 1), iterations(charts.size(), 0);
  std::vector<bool> is_stopped(charts.size(), false);
  std::vector<double> spreads(charts.size(), 0);
  auto frozen_slices = context.upload(frozen);
  for (bool is_last = options.iterations == 0;;) {
    context.launch(kernel("weigh_rows"), ClRange(s.vertices), s.vertices, s.entries, frozen_slices, slice_begin, row_length, jumps, entry_triangles,
                   factors, areas, mantissas, exponents, shares, sums, row_exponents, v_parts);
    context.launch(kernel("scale_entries"), ClRange(s.vertices), s.vertices, slice_begin, row_length, twins, shares, scaled);
    context.fill(queue, 0);
    context.launch(kernel("invert_coarse"), group_range, chart_count, queue, order, chart_begin, chart_rows, cell_first, cell_counts, cell_begin,
                   row_cells, matrix_begin, slice_begin, row_length, columns, shares, scaled, sums, row_exponents, roots, basis, inverses, coarse, scratch);
    context.fill(queue, 0);
    context.launch(kernel("solve_charts"), group_range, chart_count,
                   static_cast<float>(is_last ? options.tolerance : options.intermediate_tolerance), options.max_steps, kCheckSteps, s.coarse, queue,
                   order, chart_begin, chart_rows, cell_first, cell_counts, cell_begin, row_cells, matrix_begin, slice_begin, row_length, columns,
                   jumps, shares, scaled, v_parts, roots, basis, inverses, hi, lo, residual, direction, product, correction, coarse, steps, ratios,
                   scratch);
    if (is_last) break;
    context.launch(kernel("measure_areas"), ClRange(s.triangles), s.triangles, corners, corner_jumps, hi, lo, areas);
    if (options.stop_spread_change > 0) {
      const std::vector<float> now = context.download(areas);
      auto first = now.begin();
      for (std::size_t k = 0; k < charts.size(); ++k) {
        const auto end = first + static_cast<std::ptrdiff_t>(charts[k].triangles.size());
        const double spread = spread_of(std::vector<double>(first, end));
        if (iterations[k] > 0 && std::abs(spread - spreads[k]) < options.stop_spread_change * spreads[k]) is_stopped[k] = true;
        spreads[k] = spread;
        first = end;
      }
    }
    is_last = true;
    for (std::size_t k = 0; k < charts.size(); ++k) {
      if (!is_stopped[k]) {
        ++iterations[k];
        is_last &= iterations[k] == options.iterations;
      }
      const auto begin = frozen.begin() + s.chart_begin[k] / kSlice;
      std::fill(begin, begin + padded(static_cast<int>(charts[k].positions.size()), kSlice) / kSlice, is_stopped[k] ? 1 : 0);
    }
    context.write(frozen_slices, frozen);
  }
  const auto final_hi = context.download(hi), final_lo = context.download(lo);
  const auto final_steps = context.download(steps);
  const auto final_ratios = context.download(ratios);
  for_each_block(charts.size(), 1, [&](std::size_t k, std::size_t, std::size_t) {
    Chart& chart = charts[k];
    VsmReport& report = reports[k];
    const std::vector<double> guess = chart.v;
    read_map(s, k, final_hi, final_lo, chart);
    report.iterations = iterations[k];
    report.solver_steps = final_steps[k];
    report.residual = final_ratios[k];
    report.flipped_triangles = count_flipped(chart);
    if (report.flipped_triangles > 0) {
      solve_directly(chart, options, iterations[k]);
      report.used_direct_solver = true;
      report.flipped_triangles = count_flipped(chart);
    }
    if (chart.topology == SegmentTopology::kSphere) settle_rotation(chart, guess);
    report.spread = spread_of(texture_areas(chart));
  });
  return reports;
}

}  // namespace skeletex
