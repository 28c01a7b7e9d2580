// SPDX-License-Identifier: MIT
#pragma once
#include <Eigen/Geometry>
#include <Eigen/SparseCholesky>
#include <Eigen/SparseCore>
#include <algorithm>
#include <cmath>
#include <map>
#include <vector>

#include "skeletex/convert/parameterize/chart.h"
#include "skeletex/convert/parameterize/vsm.h"

/// VSM once more, short and in double precision with a sparse factorization: what the device is compared with.
namespace skeletex::testing {

struct TwinEdge {
  int i = -1, j = -1;
  int jump = 0;  ///< lifted v_j - v_i = v[j] - v[i] + jump
  std::vector<int> triangles;
  double weight = 1;
};

inline bool is_twin_pole(ChartVertex kind) { return kind == ChartVertex::kHeadPole || kind == ChartVertex::kTailPole; }

inline std::vector<TwinEdge> twin_edges(const Chart& chart) {
  std::map<std::pair<int, int>, TwinEdge> edges;
  for (int t = 0; t < static_cast<int>(chart.triangles.size()); ++t)
    for (int c = 0; c < 3; ++c) {
      int p = c, q = (c + 1) % 3;
      if (chart.triangles[t][p] > chart.triangles[t][q]) std::swap(p, q);
      TwinEdge& edge = edges[{chart.triangles[t][p], chart.triangles[t][q]}];
      edge.i = chart.triangles[t][p];
      edge.j = chart.triangles[t][q];
      edge.jump = chart.turns[t][q] - chart.turns[t][p];
      edge.triangles.push_back(t);
    }
  std::vector<TwinEdge> list;
  for (const auto& [key, edge] : edges) list.push_back(edge);
  return list;
}

/// Fills u (is_u) or v of all inner vertices with the barycentric map of the given weights.
inline void twin_solve(Chart& chart, const std::vector<TwinEdge>& edges, bool is_u) {
  const int count = static_cast<int>(chart.positions.size());
  std::vector<double>& x = is_u ? chart.u : chart.v;
  std::vector<int> unknown(count, -1);
  int size = 0;
  bool has_row = false;
  for (int i = 0; i < count; ++i) {
    if (chart.kinds[i] == ChartVertex::kInner) unknown[i] = size++;
    has_row |= chart.kinds[i] == ChartVertex::kHeadRow || chart.kinds[i] == ChartVertex::kTailRow;
  }
  std::vector<double> diagonal(size, 0);
  for (const TwinEdge& e : edges) {
    if (!is_u && (is_twin_pole(chart.kinds[e.i]) || is_twin_pole(chart.kinds[e.j]))) continue;
    for (const int k : {unknown[e.i], unknown[e.j]})
      if (k >= 0) diagonal[k] += e.weight;
  }
  // Scaled to a unit diagonal: weights may span more than a double's comfortable range.
  std::vector<Eigen::Triplet<double>> entries;
  Eigen::VectorXd rhs = Eigen::VectorXd::Zero(size);
  const int pinned = !is_u && !has_row ? 0 : -1;  // a lone bone's v is free to turn
  for (int k = 0; k < size; ++k) entries.emplace_back(k, k, k == pinned ? 2.0 : 1.0);
  const double pin_value =
      pinned < 0 ? 0 : chart.v[std::find(unknown.begin(), unknown.end(), pinned) - unknown.begin()];
  if (pinned >= 0) rhs[pinned] += pin_value * std::sqrt(diagonal[pinned]);
  for (const TwinEdge& e : edges) {
    if (!is_u && (is_twin_pole(chart.kinds[e.i]) || is_twin_pole(chart.kinds[e.j]))) continue;
    const double jump = is_u ? 0 : e.jump;
    for (const auto& [from, to, lift] : {std::tuple{e.i, e.j, jump}, std::tuple{e.j, e.i, -jump}}) {
      const int k = unknown[from], l = unknown[to];
      if (k < 0) continue;
      const double scale = 1 / std::sqrt(diagonal[k]);
      rhs[k] += e.weight * scale * lift;
      if (l < 0)
        rhs[k] += e.weight * scale * x[to];
      else
        entries.emplace_back(k, l, -e.weight * scale / std::sqrt(diagonal[l]));
    }
  }
  Eigen::SparseMatrix<double> matrix(size, size);
  matrix.setFromTriplets(entries.begin(), entries.end());
  const Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> solver(matrix);
  Eigen::VectorXd solution = solver.solve(rhs);
  solution += solver.solve(rhs - matrix * solution);
  for (int i = 0; i < count; ++i)
    if (unknown[i] >= 0) x[i] = solution[unknown[i]] / std::sqrt(diagonal[unknown[i]]);
}

/// w <- w A / A3^alpha, then normalised to a largest weight of 1.
inline void twin_reweight(const Chart& chart, std::vector<TwinEdge>& edges, double alpha) {
  const std::vector<double> areas = texture_areas(chart);
  const TriangleMesh mesh{chart.positions, chart.triangles};
  const double smallest = 1e-6 * surface_area(mesh) / static_cast<double>(mesh.triangles.size());
  double largest = 0;
  for (TwinEdge& e : edges) {
    double a = 0, a3 = 0;
    for (const int t : e.triangles) {
      a += areas[t];
      a3 += std::max(smallest, area_vector(mesh, chart.triangles[t]).norm());
    }
    e.weight *= a / std::pow(a3, alpha);
    largest = std::max(largest, e.weight);
  }
  for (TwinEdge& e : edges) e.weight /= largest;
}

inline std::vector<TwinEdge> twin_vsm(Chart& chart, int iterations, double alpha) {
  std::vector<TwinEdge> edges = twin_edges(chart);
  for (int k = 0;; ++k) {
    twin_solve(chart, edges, true);
    twin_solve(chart, edges, false);
    if (k == iterations) return edges;
    twin_reweight(chart, edges, alpha);
  }
}

}  // namespace skeletex::testing
