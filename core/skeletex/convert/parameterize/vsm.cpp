// SPDX-License-Identifier: MIT
#include "skeletex/convert/parameterize/vsm.h"

#include <Eigen/Geometry>
#include <Eigen/SparseCholesky>
#include <Eigen/SparseCore>
#include <algorithm>
#include <array>
#include <bit>
#include <climits>
#include <cmath>
#include <numbers>
#include <numeric>
#include <utility>

#include "skeletex/convert/parameterize/dissection.h"
#include "skeletex/geometry/parallel.h"
#include "vsm_structs.h"

namespace skeletex {
namespace {

constexpr int kSlice = 32;           // VSM_SLICE
constexpr signed char kPole = -128;  // VSM_POLE

/// Slivers of the cut count as this much of the mean surface area: their weights stay in the others' range.
constexpr double kSmallestArea = 1e-6;
/// One work-group takes whole subtrees of so many vertices: a share of all that keeps processors busy, within limits.
constexpr int kSubtrees = 32, kSmallestSubtree = 256, kLargestSubtree = 1024;

/// More groups than tasks do no harm, and drivers that hand groups to threads in blocks then use every thread.
constexpr int kLeastGroups = 64;

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

/// A run of fronts that one work-group takes, and when it can.
struct Task {
  int begin = 0, end = 0, stage = 0;
  double work = 0;
};

/// The fronts of charts in the layout of vsm.cl.
struct FrontTables {
  std::vector<FrontRecord> fronts;
  std::vector<int> children, boundary_rows, parent_columns;
  int matrix_rows = 0, vector_rows = 0;  ///< of VSM_TILE floats
  std::vector<Task> tasks;
};

template <class T>
void append(std::vector<T>& to, const std::vector<T>& more) {
  to.insert(to.end(), more.begin(), more.end());
}

void append_tables(FrontTables& to, FrontTables&& more) {
  const int fronts = static_cast<int>(to.fronts.size()), children = static_cast<int>(to.children.size()),
            list = static_cast<int>(to.boundary_rows.size());
  for (FrontRecord& front : more.fronts) {
    front.list += list;
    front.child_begin += children;
    front.child_end += children;
    front.rows += to.matrix_rows;
    front.rest += to.matrix_rows;
    front.vectors += to.vector_rows;
  }
  for (int& child : more.children) child += fronts;
  for (Task& task : more.tasks) {
    task.begin += fronts;
    task.end += fronts;
  }
  append(to.fronts, more.fronts);
  append(to.children, more.children);
  append(to.boundary_rows, more.boundary_rows);
  append(to.parent_columns, more.parent_columns);
  append(to.tasks, more.tasks);
  to.matrix_rows += more.matrix_rows;
  to.vector_rows += more.vector_rows;
}

/// The systems of all charts in the layout of vsm.cl.
struct DeviceSystems {
  int vertices = 0, triangles = 0, entries = 0;
  std::vector<ChartRecord> charts;  ///< the largest first
  std::vector<int> slice_chart, slice_begin, row_length, later_end, fixed_end;
  std::vector<std::vector<int>> device_vertices;             ///< per chart and vertex
  std::vector<int> columns, entry_triangles, entry_columns;  ///< entry_triangles: two planes
  std::vector<signed char> jumps;
  std::vector<float> factors;
  std::vector<int> corners;               ///< three planes
  std::vector<signed char> corner_jumps;  ///< two planes
  std::vector<float> map;                 ///< u and v of all vertices, and what they are more than these floats
  FrontTables fronts;
  std::vector<int> tasks, stage_begin;  ///< tasks: first front and end, largest first in each stage
};

int padded(int count, int unit) { return (count + unit - 1) / unit * unit; }

/// The fronts of a chart, and the tasks that they make. Columns of later neighbours (per place in `table.targets`, else
/// -1), and of boundaries in their parents, are found where a front's own columns are known; and how many neighbours of
/// a row are later or fixed.
FrontTables make_fronts(const HalfEdgeTable& table, const Dissection& d, int id, int first_row, int subtree_size,
                        std::vector<int>& neighbour_columns, DeviceSystems& systems) {
  FrontTables s;
  const int count = static_cast<int>(d.fronts.size());
  std::vector<int> column(d.order.size(), -1), list(count), ids(count), stage(count, 0), depth(count, 0),
      rest_size(count);
  std::vector<double> work(count, 0);
  for (int f = count - 1; f >= 0; --f)
    if (d.fronts[f].parent >= 0) depth[f] = depth[d.fronts[f].parent] + 1;
  // A task's boundary rows lie on two stacks, by depth, so that little memory is touched: a front's go on one, its
  // children's leave the other.
  std::array<int, 2> stack{}, stack_size{};
  neighbour_columns.assign(table.targets.size(), -1);
  for (int f = 0; f < count; ++f) {
    const Front& front = d.fronts[f];
    const int pivots = padded(front.pivots, VSM_TILE), boundary_size = static_cast<int>(front.boundary.size());
    const int boundary = padded(boundary_size + 1, VSM_TILE), width = pivots + boundary;
    for (int i = 0; i < front.pivots; ++i) column[front.first + i] = i;
    for (int i = 0; i < boundary_size; ++i) column[front.boundary[i]] = pivots + i;
    for (int number = front.first; number < front.first + front.pivots; ++number) {
      const int v = d.order[number], begin = table.begin[v], end = table.begin[v + 1];
      int later = 0, fixed = 0;
      for (int k = begin; k < end; ++k) {
        const int other = d.number[table.targets[k]];
        if (other > number) neighbour_columns[k] = column[other], ++later;
        fixed += other < 0;
      }
      systems.later_end[first_row + number] = later;
      systems.fixed_end[first_row + number] = later + fixed;
    }
    for (const int child : front.children) {
      const std::vector<int>& joined = d.fronts[child].boundary;
      for (std::size_t i = 0; i < joined.size(); ++i) s.parent_columns[list[child] + i] = column[joined[i]];
      s.parent_columns[list[child] + joined.size()] = pivots + boundary_size;
      const int shared =
          static_cast<int>(std::lower_bound(joined.begin(), joined.end(), front.first + front.pivots) - joined.begin());
      for (int k = ids[child]; k < (child + 1 < f ? ids[child + 1] : static_cast<int>(s.fronts.size())); ++k)
        s.fronts[k].shared = shared;
    }
    list[f] = static_cast<int>(s.boundary_rows.size());
    for (const int number : front.boundary) s.boundary_rows.push_back(first_row + number);
    s.boundary_rows.push_back(-1);
    s.parent_columns.resize(s.boundary_rows.size(), -1);

    const bool is_in_subtree = front.size <= subtree_size;
    const int begin = ids[f] = static_cast<int>(s.fronts.size()), side = depth[f] % 2;
    // Poles act on u only: beside them, which is last of all, u and v have fronts of their own.
    for (const int axes : front.is_beside_poles ? std::vector<int>{1, 2} : std::vector<int>{3}) {
      FrontRecord record{};
      record.chart = id;
      record.axes = axes;
      record.first = first_row + front.first;
      record.pivots = front.pivots;
      record.boundary = boundary_size + 1;
      record.list = list[f];
      record.child_begin = static_cast<int>(s.children.size());
      for (const int child : front.children) s.children.push_back(ids[child]);
      record.child_end = static_cast<int>(s.children.size());
      record.rows = s.matrix_rows;
      s.matrix_rows += pivots * width / VSM_TILE;
      int& rest_end = is_in_subtree ? stack[side] : s.matrix_rows;
      record.rest = rest_end;
      rest_end += boundary * (boundary + VSM_TILE) / 2 / VSM_TILE;
      rest_size[f] += rest_end - record.rest;
      record.vectors = s.vector_rows;
      s.vector_rows += 4 * width / VSM_TILE;
      s.fronts.push_back(record);
    }
    const int end = static_cast<int>(s.fronts.size());
    const double own_work = static_cast<double>(pivots) * width * width;
    work[f] += (end - begin) * own_work;
    if (front.parent >= 0) work[front.parent] += work[f];
    if (!is_in_subtree) {
      for (const int child : front.children) stage[f] = std::max(stage[f], stage[child] + 1);
      for (int k = begin; k < end; ++k) s.tasks.push_back({k, k + 1, stage[f], own_work});
      continue;
    }
    stack_size[side] = std::max(stack_size[side], stack[side]);
    for (const int child : front.children) stack[1 - side] -= rest_size[child];
    if (front.parent >= 0 && d.fronts[front.parent].size <= subtree_size) continue;
    s.tasks.push_back({ids[front.subtree], end, 0, work[f]});
    for (int g = front.subtree; g <= f; ++g)
      for (int k = ids[g]; k < (g < f ? ids[g + 1] : end); ++k)
        s.fronts[k].rest += s.matrix_rows + depth[g] % 2 * stack_size[0];
    s.matrix_rows += stack_size[0] + stack_size[1];
    stack = stack_size = {};
  }
  return s;
}

using ChartPointers = std::vector<Chart*>;

/// Charts by number, the largest first: processors that take them in this order end together.
std::vector<int> by_falling_size(const ChartPointers& charts) {
  std::vector<int> order(charts.size());
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(),
                   [&](int a, int b) { return charts[a]->triangles.size() > charts[b]->triangles.size(); });
  return order;
}

/// Calls act(k) for every chart on all processors.
template <class Act>
void for_each_chart(const ChartPointers& charts, const Act& act) {
  const std::vector<int> order = by_falling_size(charts);
  for_each_block(order.size(), 1, [&](std::size_t i, std::size_t, std::size_t) { act(order[i]); });
}

/// \param are_whole  charts are not divided into subtrees
DeviceSystems build_systems(const ChartPointers& charts, double alpha, bool are_whole) {
  DeviceSystems s;
  std::vector<int> first_rows, first_triangles, first_fronts;
  for (std::size_t k = 0; k < charts.size(); ++k) {
    first_rows.push_back(s.vertices);
    first_triangles.push_back(s.triangles);
    s.vertices += padded(static_cast<int>(charts[k]->positions.size()), kSlice);
    s.slice_chart.resize(s.vertices / kSlice, static_cast<int>(k));
    s.triangles += static_cast<int>(charts[k]->triangles.size());
  }
  first_rows.push_back(s.vertices), first_triangles.push_back(s.triangles);
  const int subtree_size = are_whole ? INT_MAX : std::clamp(s.vertices / kSubtrees, kSmallestSubtree, kLargestSubtree);
  s.device_vertices.resize(charts.size());
  s.row_length.assign(s.vertices, 0);
  s.later_end = s.fixed_end = s.row_length;
  s.map.assign(4 * static_cast<std::size_t>(s.vertices), 0);
  std::vector<Dissection> dissections(charts.size());
  for_each_chart(charts, [&](std::size_t k) {
    const Dissection& d = dissections[k] = dissect(*charts[k]);
    const std::vector<int>& begin = charts[k]->half_edges.begin;
    for (std::size_t i = 0; i < d.order.size(); ++i)
      s.row_length[first_rows[k] + i] = begin[d.order[i] + 1] - begin[d.order[i]];
  });
  for (int slice = 0; slice < s.vertices; slice += kSlice) {
    s.slice_begin.push_back(s.entries);
    s.entries += kSlice * *std::max_element(s.row_length.begin() + slice, s.row_length.begin() + slice + kSlice);
  }

  s.columns.assign(s.entries, 0);
  s.entry_columns.assign(s.entries, 0);
  s.entry_triangles.assign(2 * static_cast<std::size_t>(s.entries), 0);
  s.jumps.assign(s.entries, 0);
  s.factors.assign(s.entries, 1);
  s.corners.resize(3 * static_cast<std::size_t>(s.triangles));
  s.corner_jumps.resize(2 * static_cast<std::size_t>(s.triangles));
  std::vector<FrontTables> fronts(charts.size());
  for_each_chart(charts, [&](std::size_t k) {
    const Chart& chart = *charts[k];
    const Dissection d = std::exchange(dissections[k], {});
    const HalfEdgeTable& table = chart.half_edges;
    const int count = static_cast<int>(chart.positions.size());
    std::vector<int>& map = s.device_vertices[k];
    map.resize(count);
    int next = first_rows[k] + static_cast<int>(d.order.size());
    for (int v = 0; v < count; ++v) {
      map[v] = chart.kinds[v] == ChartVertex::kInner ? first_rows[k] + d.number[v] : next++;
      for (const int axis : {0, 1}) {
        const double x = axis == 0 ? chart.u[v] : chart.v[v];
        const std::size_t at = 4 * static_cast<std::size_t>(map[v]) + axis;
        s.map[at] = static_cast<float>(x);
        s.map[at + 2] = static_cast<float>(x - static_cast<double>(s.map[at]));
      }
    }
    std::vector<int> neighbour_columns;
    fronts[k] = make_fronts(table, d, static_cast<int>(k), first_rows[k], subtree_size, neighbour_columns, s);
    const std::vector<double> surface = relative_surface_areas(chart);
    // Where they lie does not change, which compilers cannot know where bytes are written.
    int *const columns = s.columns.data(), *const entry_columns = s.entry_columns.data(),
               *const triangles = s.entry_triangles.data();
    signed char* const jumps = s.jumps.data();
    float* const factors = s.factors.data();
    const int *const numbers = d.number.data(), *const own_columns = neighbour_columns.data(), *const rows = map.data();
    const int *const outgoing = table.outgoing.data(), *const targets = table.targets.data(),
                     *const twins = table.twins.data();
    const auto* const turns = chart.turns.data();
    const ChartVertex* const kinds = chart.kinds.data();
    const int entries = s.entries, first_triangle = first_triangles[k];
    for (const int v : d.order) {
      const int row = map[v], first_entry = s.slice_begin[row / kSlice] + row % kSlice;
      int later = 0, fixed = s.later_end[row], before = s.fixed_end[row];
      for (int at = table.begin[v]; at < table.begin[v + 1]; ++at) {
        const int h = outgoing[at], to = targets[at], column = own_columns[at];
        int& place = column >= 0 ? later : numbers[to] < 0 ? fixed : before;
        const int e = first_entry + kSlice * place++, own = h / 3, corner = h % 3, other = twins[h] / 3;
        entry_columns[e] = std::max(column, 0);
        columns[e] = rows[to];
        jumps[e] = is_pole(kinds[to])
                       ? kPole
                       : static_cast<signed char>(turns[own][corner < 2 ? corner + 1 : 0] - turns[own][corner]);
        triangles[e] = first_triangle + own;
        triangles[entries + e] = first_triangle + other;
        // The same bits in both directions.
        factors[e] = static_cast<float>(surface[own] + surface[other]);
      }
    }
    const auto slice_of = [&](int row) { return row < s.vertices ? s.slice_begin[row / kSlice] : s.entries; };
    const std::span own_factors(factors + slice_of(first_rows[k]), factors + slice_of(first_rows[k + 1]));
    if (alpha == 0.5)
      for (float& factor : own_factors) factor = 1 / std::sqrt(factor);
    else
      for (float& factor : own_factors) factor = std::pow(factor, static_cast<float>(-alpha));
    int* const corners = s.corners.data() + first_triangle;
    signed char* const corner_jumps = s.corner_jumps.data() + first_triangle;
    const int all = s.triangles;
    for (std::size_t t = 0; t < chart.triangles.size(); ++t) {
      const Triangle& triangle = chart.triangles[t];
      const auto& own_turns = turns[t];
      // The pole first, if there is one.
      const int a = is_pole(kinds[triangle[1]])   ? 1
                    : is_pole(kinds[triangle[2]]) ? 2
                                                  : 0,
                b = a < 2 ? a + 1 : 0, c = b < 2 ? b + 1 : 0;
      const bool has_pole = is_pole(kinds[triangle[a]]);
      corners[t] = rows[triangle[a]];
      corners[all + t] = rows[triangle[b]];
      corners[2 * static_cast<std::size_t>(all) + t] = rows[triangle[c]];
      corner_jumps[t] = has_pole ? kPole : static_cast<signed char>(own_turns[b] - own_turns[a]);
      corner_jumps[all + t] = static_cast<signed char>(own_turns[c] - own_turns[has_pole ? b : a]);
    }
  });
  for (FrontTables& tables : fronts) {
    first_fronts.push_back(static_cast<int>(s.fronts.fronts.size()));
    append_tables(s.fronts, std::exchange(tables, {}));
  }
  first_fronts.push_back(static_cast<int>(s.fronts.fronts.size()));
  for (const int k : by_falling_size(charts))
    s.charts.push_back({k, first_rows[k] / kSlice, first_rows[k + 1] / kSlice, first_fronts[k], first_fronts[k + 1],
                        first_triangles[k], first_triangles[k + 1]});
  std::vector<Task>& tasks = s.fronts.tasks;
  std::stable_sort(tasks.begin(), tasks.end(), [](const Task& a, const Task& b) {
    return a.stage != b.stage ? a.stage < b.stage : a.work > b.work;
  });
  for (const Task& task : tasks) {
    s.stage_begin.resize(task.stage + 1, static_cast<int>(s.tasks.size() / 2));
    s.tasks.insert(s.tasks.end(), {task.begin, task.end});
  }
  s.stage_begin.push_back(static_cast<int>(tasks.size()));
  return s;
}

void read_map(const DeviceSystems& s, std::size_t k, const std::vector<float>& map, Chart& chart) {
  for (std::size_t v = 0; v < chart.positions.size(); ++v) {
    if (chart.kinds[v] != ChartVertex::kInner) continue;
    const float* at = &map[4 * static_cast<std::size_t>(s.device_vertices[k][v])];
    chart.u[v] = static_cast<double>(at[0]) + static_cast<double>(at[2]);
    chart.v[v] = static_cast<double>(at[1]) + static_cast<double>(at[3]);
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
  const HalfEdgeTable& table = chart.half_edges;
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
          visit(h, unknown[corner(h)], to,
                is_u ? 0.0
                     : static_cast<double>(chart.turns[h / 3][HalfEdgeTable::next(h) % 3] - chart.turns[h / 3][h % 3]));
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
  return options.work_group_size > 0 ? options.work_group_size : context.row_items();
}

/// VSM_SINGLE
bool is_single(const ClContext& context, const VsmOptions& options) {
  return group_size(context, options) == 1 && context.row_items() == 1;
}

/// \param s          the charts' systems
/// \param are_whole  one work-item takes a chart from its first weights to its last solution; else work-groups share
/// each step of all charts
std::vector<VsmReport> solve_charts(ClContext& context, const ChartPointers& charts, DeviceSystems s,
                                    const VsmOptions& options, bool are_whole) {
  std::vector<VsmReport> reports(charts.size());
  if (charts.empty()) return reports;
  // The host's copy goes at once: both together would be the largest part of all memory.
  const auto hand_over = [&](auto& values) { return context.upload(std::exchange(values, {})); };
  const auto slice_chart = context.upload(s.slice_chart), slice_begin = hand_over(s.slice_begin),
             row_length = hand_over(s.row_length), later_end = hand_over(s.later_end),
             fixed_end = hand_over(s.fixed_end);
  const auto columns = hand_over(s.columns), entry_triangles = hand_over(s.entry_triangles),
             entry_columns = hand_over(s.entry_columns);
  const auto jumps = hand_over(s.jumps), corner_jumps = hand_over(s.corner_jumps);
  const auto factors = hand_over(s.factors);
  const auto corners = hand_over(s.corners);
  const auto fronts = hand_over(s.fronts.fronts);
  const auto children = hand_over(s.fronts.children), boundary_rows = hand_over(s.fronts.boundary_rows),
             parent_columns = hand_over(s.fronts.parent_columns);
  const auto tasks = hand_over(s.tasks);
  const auto map = hand_over(s.map);
  auto areas = context.allocate<float>(s.triangles);
  auto mantissas = context.allocate<float>(s.entries), weights = context.allocate<float>(s.entries);
  auto exponents = context.allocate<int>(s.entries);
  auto inverse_roots = context.allocate<float>(s.vertices), roots = context.allocate<float>(s.vertices);
  auto half_exponents = context.allocate<int>(s.vertices);
  const std::size_t pairs = 2 * static_cast<std::size_t>(s.vertices);
  auto residual = context.allocate<float>(pairs), solution = context.allocate<float>(pairs);
  auto matrices = context.allocate<float>(static_cast<std::size_t>(s.fronts.matrix_rows) * VSM_TILE),
       vectors = context.allocate<float>(static_cast<std::size_t>(s.fronts.vector_rows) * VSM_TILE);
  auto largest = context.allocate<int>(charts.size()), ratios = context.allocate<int>(charts.size());
  const int stages = static_cast<int>(s.stage_begin.size()) - 1;
  auto queues = context.allocate<int>(2 * stages + 1);
  context.fill(mantissas, 0.5f);
  context.fill(exponents, 1);

  // On a CPU one work-item runs plain loops; elsewhere a group shares them. One program holds all kernels: each is
  // compiled once.
  const std::size_t wanted = group_size(context, options);
  const char* const kernel_options = !is_single(context, options) && context.row_items() == 1 ? "-DVSM_BARRIERS" : "";
  const auto kernel = [&](std::string_view name) { return ClKernelName{"vsm.cl", name, kernel_options}; };
  std::vector<int> iterations(charts.size(), 0), steps(charts.size(), 0);
  std::vector<float> final_ratios(charts.size(), 0);
  const auto read_ratios = [&] {
    const std::vector<int> bits = context.download(ratios);
    for (std::size_t k = 0; k < charts.size(); ++k) final_ratios[k] = std::bit_cast<float>(bits[k]);
  };
  const auto map_whole_charts = [&] {
    const auto order = context.upload(s.charts);
    auto steps_of_charts = context.upload(steps);
    context.fill(queues, 0);
    context.launch(kernel("map_charts"), ClRange({std::max<std::size_t>(kLeastGroups, charts.size()), 1}, {1, 1}),
                   options.iterations, static_cast<float>(options.intermediate_tolerance),
                   static_cast<float>(options.tolerance), options.max_steps, static_cast<int>(charts.size()), order,
                   queues, s.entries, s.triangles, slice_begin, row_length, later_end, fixed_end, columns,
                   entry_triangles, entry_columns, jumps, factors, corners, corner_jumps, fronts, children,
                   boundary_rows, parent_columns, areas, mantissas, exponents, weights, inverse_roots, roots,
                   half_exponents, residual, solution, matrices, vectors, map, largest, ratios, steps_of_charts);
    steps = context.download(steps_of_charts);
    read_ratios();
    iterations.assign(charts.size(), options.iterations);
  };

  const std::size_t lanes = is_single(context, options) ? 1 : kSlice;  // work-items that share a slice
  const ClRange slices({s.vertices / kSlice * lanes, 1}, {lanes, 1});
  const auto for_stage = [&](int stage, const auto& launch) {
    const std::size_t group =
        context.work_group_size(kernel("eliminate_fronts"), context.work_group_size(kernel("substitute_back"), wanted));
    const std::size_t groups = std::max(s.stage_begin[stage + 1] - s.stage_begin[stage], kLeastGroups);
    launch(ClRange({groups * group, 1}, {group, 1}), s.stage_begin[stage], s.stage_begin[stage + 1]);
  };
  const auto is_solved = [&](float tolerance) {
    context.fill(ratios, 0);
    context.launch(kernel("form_residual"), slices, slice_chart, slice_begin, row_length, columns, jumps, weights,
                   inverse_roots, half_exponents, largest, map, roots, residual, ratios);
    read_ratios();
    return std::all_of(final_ratios.begin(), final_ratios.end(), [&](float ratio) { return ratio <= tolerance; });
  };
  const auto solve = [&](float tolerance) {
    for (int step = 0; !is_solved(tolerance) && step < options.max_steps; ++step) {
      for (std::size_t k = 0; k < charts.size(); ++k) steps[k] += final_ratios[k] > tolerance;
      context.fill(queues, 0);
      for (int stage = 0; stage < stages; ++stage)
        for_stage(stage, [&](const ClRange& range, int begin, int end) {
          context.launch(kernel("eliminate_fronts"), range, step == 0 ? 1 : 0, tolerance, begin, end, tasks, stage,
                         queues, fronts, children, boundary_rows, parent_columns, slice_begin, later_end, fixed_end,
                         columns, jumps, entry_columns, mantissas, exponents, weights, inverse_roots, half_exponents,
                         roots, residual, ratios, matrices, vectors);
        });
      for (int stage = stages - 1; stage >= 0; --stage)
        for_stage(stage, [&](const ClRange& range, int begin, int end) {
          context.launch(kernel("substitute_back"), range, tolerance, begin, end, tasks, stages + stage, queues, fronts,
                         boundary_rows, roots, ratios, matrices, vectors, solution, map);
        });
    }
  };
  const auto map_together = [&] {
    std::vector<int> frozen(s.vertices / kSlice, 1);
    std::vector<bool> is_stopped(charts.size(), false);
    std::vector<double> spreads(charts.size(), 0);
    auto frozen_slices = context.upload(frozen);
    for (bool is_last = options.iterations == 0;;) {
      context.fill(largest, INT_MIN);
      context.launch(kernel("weigh_rows"), slices, s.entries, frozen_slices, slice_chart, slice_begin, row_length,
                     entry_triangles, factors, areas, mantissas, exponents, weights, inverse_roots, half_exponents,
                     largest);
      solve(static_cast<float>(is_last ? options.tolerance : options.intermediate_tolerance));
      if (is_last) break;
      context.launch(kernel("measure_areas"), ClRange(s.triangles), s.triangles, corners, corner_jumps, map, areas);
      if (options.stop_spread_change > 0) {
        const std::vector<float> now = context.download(areas);
        auto first = now.begin();
        for (std::size_t k = 0; k < charts.size(); ++k) {
          const auto end = first + static_cast<std::ptrdiff_t>(charts[k]->triangles.size());
          const double spread = spread_of(std::vector<double>(first, end));
          if (iterations[k] > 0 && std::abs(spread - spreads[k]) < options.stop_spread_change * spreads[k])
            is_stopped[k] = true;
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
      }
      std::vector<int> now_frozen;
      for (const int chart : s.slice_chart) now_frozen.push_back(is_stopped[chart] ? 1 : 0);
      if (now_frozen != frozen) context.write(frozen_slices, frozen = now_frozen);
    }
  };
  if (are_whole)
    map_whole_charts();
  else
    map_together();
  const auto final_map = context.download(map);
  for_each_chart(charts, [&](std::size_t k) {
    Chart& chart = *charts[k];
    VsmReport& report = reports[k];
    const std::vector<double> guess = chart.v;
    read_map(s, k, final_map, chart);
    report.iterations = iterations[k];
    report.solver_steps = steps[k];
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

}  // namespace

std::vector<VsmReport> solve_vsm(ClContext& context, std::span<Chart> charts, const VsmOptions& options) {
  // On a CPU a chart of moderate size is one task: what it needs stays in one processor's cache. Larger ones would
  // leave others idle, and are shared.
  std::size_t vertices = 0;
  for (const Chart& chart : charts) vertices += chart.positions.size();
  const std::size_t largest_whole = is_single(context, options) && options.stop_spread_change == 0
                                        ? vertices / (4 * std::max(1, context.device().compute_units))
                                        : 0;
  std::array<ChartPointers, 2> groups;
  for (Chart& chart : charts) groups[chart.positions.size() <= largest_whole].push_back(&chart);
  std::array<DeviceSystems, 2> systems;
  for_each_block(groups.size(), 1, [&](std::size_t i, std::size_t, std::size_t) {
    systems[i] = build_systems(groups[i], options.alpha, i == 1);
  });
  std::vector<VsmReport> reports(charts.size());
  for (const std::size_t i : {0, 1}) {
    const std::vector<VsmReport> of_group = solve_charts(context, groups[i], std::move(systems[i]), options, i == 1);
    for (std::size_t k = 0; k < of_group.size(); ++k) reports[groups[i][k] - charts.data()] = of_group[k];
  }
  return reports;
}

}  // namespace skeletex
