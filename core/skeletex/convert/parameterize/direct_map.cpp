// SPDX-License-Identifier: MIT
#include "skeletex/convert/parameterize/direct_map.h"

#include <Eigen/SparseCholesky>
#include <Eigen/SparseCore>
#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "skeletex/convert/parameterize/vsm_tables.h"
#include "skeletex/geometry/parallel.h"
#include "skeletex/math/portable.h"

namespace skeletex {
namespace {

/// From an inner vertex to a neighbour: x[from] belongs at the weighted mean of x[to] + jump.
struct Entry {
  int half_edge, row, to;
  double jump;
};

/// The entries of the system of u or of v, on which poles do not act.
std::vector<Entry> entries_of(const Chart& chart, const std::vector<int>& unknown, bool is_u) {
  std::vector<Entry> entries;
  for (int h = 0; h < static_cast<int>(chart.half_edges.twins.size()); ++h) {
    const int next = HalfEdgeTable::next(h) % 3, from = chart.triangles[h / 3][h % 3],
              to = chart.triangles[h / 3][next];
    if (unknown[from] < 0 || (!is_u && is_pole(chart.kinds[to]))) continue;
    entries.push_back(
        {h, unknown[from], to, is_u ? 0.0 : static_cast<double>(chart.turns[h / 3][next] - chart.turns[h / 3][h % 3])});
  }
  return entries;
}

using Factorization = Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>>;

/// \param solver  of the same chart and coordinate; the pattern of its matrix is analysed in the first call
void solve(const Chart& chart, const std::vector<int>& unknown, int rows, const std::vector<double>& weights, bool is_u,
           Factorization& solver, std::vector<double>& x) {
  const std::vector<Entry> entries = entries_of(chart, unknown, is_u);
  Eigen::VectorXd diagonal = Eigen::VectorXd::Zero(rows), right = Eigen::VectorXd::Zero(rows);
  for (const Entry& entry : entries) diagonal[entry.row] += weights[entry.half_edge];
  std::vector<Eigen::Triplet<double>> triplets;
  for (const auto& [h, row, to, jump] : entries) {
    const double scale = weights[h] / std::sqrt(diagonal[row]);
    right[row] += scale * jump;
    if (unknown[to] >= 0)
      triplets.emplace_back(row, unknown[to], -scale / std::sqrt(diagonal[unknown[to]]));
    else
      right[row] += scale * x[to];
  }
  // A lone bone's v is free to turn; a little more on one diagonal entry, and the same on the right, pins it.
  const bool is_free = !is_u && chart.topology == SegmentTopology::kSphere;
  for (int row = 0; row < rows; ++row) triplets.emplace_back(row, row, is_free && row == 0 ? 2.0 : 1.0);
  Eigen::SparseMatrix<double> matrix(rows, rows);
  matrix.setFromTriplets(triplets.begin(), triplets.end());
  if (solver.rows() == 0) solver.analyzePattern(matrix);
  solver.factorize(matrix);
  Eigen::VectorXd solution = solver.solve(right);
  solution += solver.solve(right - matrix * solution);
  for (std::size_t i = 0; i < unknown.size(); ++i)
    if (unknown[i] >= 0) x[i] = solution[unknown[i]] / std::sqrt(diagonal[unknown[i]]);
}

}  // namespace

int map_directly(Chart& chart, int iterations, double alpha) {
  const HalfEdgeTable& table = chart.half_edges;
  const std::vector<double> surface = relative_surface_areas(chart);
  std::vector<int> unknown(chart.positions.size(), -1);
  int rows = 0;
  for (std::size_t i = 0; i < unknown.size(); ++i)
    if (chart.kinds[i] == ChartVertex::kInner) unknown[i] = rows++;
  std::vector<double> weights(table.twins.size(), 1);
  std::array<Factorization, 2> solvers;  // of u and v
  for (int iteration = 0, flipped = 0;; ++iteration) {
    const std::vector<double> u = chart.u, v = chart.v;
    for_each_index(2, [&](std::size_t k) {
      solve(chart, unknown, rows, weights, k == 0, solvers[k], k == 0 ? chart.u : chart.v);
    });
    if (const int before = std::exchange(flipped, count_flipped(chart)); iteration > 0 && flipped > before) {
      // Triangles are too small in the map for the precision of the weights: the step before is the best there is.
      chart.u = u;
      chart.v = v;
      return iteration - 1;
    }
    if (iteration == iterations) return iteration;
    const std::vector<double> areas = texture_areas(chart);
    double largest = 0;
    for (int h = 0; h < static_cast<int>(table.twins.size()); ++h) {
      if (table.twins[h] < 0) continue;
      const int a = h / 3, b = table.twins[h] / 3;
      weights[h] *= std::max(areas[a] + areas[b], 1e-300) / portable::pow(surface[a] + surface[b], alpha);
      largest = std::max(largest, weights[h]);
    }
    for (double& w : weights) w /= largest;
  }
}

}  // namespace skeletex
