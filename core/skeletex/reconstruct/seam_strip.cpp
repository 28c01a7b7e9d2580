// SPDX-License-Identifier: MIT
#include "skeletex/reconstruct/seam_strip.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>

#include "skeletex/geometry/loop_turns.h"

namespace skeletex {
namespace {

constexpr double kLargestStep = 0.45;  // with 4 columns still 1.2 columns of overlap between neighbouring ranges
constexpr double kSlackColumns = 1.5;
constexpr double kCapCosine2 = 0.9924;  // 175 degrees
constexpr double kCapCost = 1;          // times the square of its longest side
constexpr int kAroundCap = 3;           // seam vertices where caps are charged, before and behind one

/// What it costs that a triangle is a cap, one with hardly an area and a direction of its own: a texel or sample lies
/// between two others that sit on the same edge of the mesh. By its sides, squared.
double cap_cost(double a2, double b2, double c2) {
  const double longest2 = std::max({a2, b2, c2}),
               along = 0.5 * (2 * longest2 - (a2 + b2 + c2));  // the others' inner product
  return along > 0 && along * along * longest2 > kCapCosine2 * a2 * b2 * c2 ? kCapCost * longest2 : 0;
}

}  // namespace

std::vector<double> seam_turns(const std::vector<Vec3>& points, const std::vector<double>& turns) {
  const int count = static_cast<int>(turns.size());
  std::vector<double> result(count);
  if (std::optional<std::vector<double>> grown = loop_turns(points, turns))
    result = std::move(*grown);
  else
    for (int i = 0; i < count; ++i)
      result[i] = (std::isfinite(turns[0]) ? turns[0] : 0) + static_cast<double>(i) / count;

  double largest = 0;
  for (int i = 0; i < count; ++i)
    largest = std::max(largest, i + 1 < count ? result[i + 1] - result[i] : result[0] + 1 - result[i]);
  if (largest > kLargestStep) {
    const double share = (largest - kLargestStep) / (largest - 1.0 / count);
    for (int i = 1; i < count; ++i)
      result[i] = (1 - share) * result[i] + share * (result[0] + static_cast<double>(i) / count);
  }
  const double whole = std::floor(result[0]);
  for (double& turn : result) turn -= whole;
  return result;
}

void append_seam_strip(std::span<const Vec3> positions, const Ring& seam, const Ring& row, BoneEnd end,
                       std::vector<Triangle>& triangles) {
  std::vector<Vec3> points;
  for (const int vertex : seam.vertices) points.push_back(positions[vertex]);
  append_seam_strip(positions, seam, seam_turns(points, seam.turns), row, end, triangles);
}

void append_seam_strip(std::span<const Vec3> positions, const Ring& seam, std::span<const double> turns,
                       const Ring& row, BoneEnd end, std::vector<Triangle>& triangles) {
  const int m = static_cast<int>(seam.vertices.size()), n = static_cast<int>(row.vertices.size());
  // Columns of seam vertices -1 to 2 m in unwrapped numbers: row angles are column / n.
  std::vector<double> columns;
  columns.reserve(2 * m + 2);
  columns.push_back(n * (turns[m - 1] - 1));
  for (const int turn : {0, 1})
    for (const double own : turns) columns.push_back(n * (own + turn));
  columns.push_back(n * (turns[0] + 2));
  const auto column_of = [&](int i) { return columns[i + 1]; };
  const auto row_vertex = [&](int j) { return row.vertices[(j % n + n) % n]; };
  const auto cost = [&](const Vec3& p, int j) { return (p - positions[row_vertex(j)]).squaredNorm(); };

  // The columns that a seam vertex may be joined to: those between its neighbours' angles and a little more, but never
  // n + 1 of them, so that no column is met twice from the same vertex.
  const auto first_column = [&](int i) {
    const double column = std::max(column_of(i - 1) - kSlackColumns, column_of(i) - 0.5 * (n - 1));
    return static_cast<int>(column) + (static_cast<int>(column) < column);
  };
  const auto last_column = [&](int i) {
    const double column = std::min(column_of(i + 1) + kSlackColumns, column_of(i) + 0.5 * (n - 1));
    return static_cast<int>(column) - (static_cast<int>(column) > column);
  };

  int start = 0;
  double shortest = 0;
  for (int i = 0; i < m; ++i) {
    const double length = cost(positions[seam.vertices[i]], static_cast<int>(std::lround(column_of(i))));
    if (i == 0 || length < shortest) {
      start = i;
      shortest = length;
    }
  }
  const int start_column = static_cast<int>(std::lround(column_of(start)));

  // From here on both rings begin there, and end where they began.
  std::vector<int> seam_vertices, row_vertices;
  for (int k = 0; k <= m; ++k) seam_vertices.push_back(seam.vertices[start + k < m ? start + k : start + k - m]);
  for (int j = 0, at = (start_column % n + n) % n; j <= n; ++j, at = at + 1 < n ? at + 1 : 0)
    row_vertices.push_back(row.vertices[at]);
  std::vector<Vec3> seam_points, row_points;
  for (const int vertex : seam_vertices) seam_points.push_back(positions[vertex]);
  for (const int vertex : row_vertices) row_points.push_back(positions[vertex]);
  std::vector<int> first(m + 1), last(m + 1), place(m + 2, 0);
  for (int k = 0; k <= m; ++k) {
    first[k] = std::max(first_column(start + k) - start_column, 0),
    last[k] = std::min(last_column(start + k) - start_column, n);
    place[k + 1] = place[k] + last[k] - first[k] + 1;
  }
  // Squared lengths: of what joins seam vertex k to column j, at place[k] + j - first[k], and along the rings from k or
  // j on.
  std::vector<double> joints2(place[m + 1]), seam_steps2(m), row_steps2(n);
  for (int k = 0; k <= m; ++k)
    for (int j = first[k]; j <= last[k]; ++j)
      joints2[place[k] + j - first[k]] = (seam_points[k] - row_points[j]).squaredNorm();
  for (int k = 0; k < m; ++k) seam_steps2[k] = (seam_points[k + 1] - seam_points[k]).squaredNorm();
  for (int j = 0; j < n; ++j) row_steps2[j] = (row_points[j + 1] - row_points[j]).squaredNorm();
  const auto joint2 = [&](int k, int j) { return joints2[place[k] + j - first[k]]; };
  const auto column_cap_cost = [&](int k, int j) { return cap_cost(joint2(k, j), joint2(k, j + 1), row_steps2[j]); };
  const auto seam_cap_cost = [&](int k, int j) { return cap_cost(joint2(k, j), joint2(k + 1, j), seam_steps2[k]); };
  std::vector<double> best(place[m + 1]);     // the cheapest merge that joins k to j, at the same places
  std::vector<char> along_row(place[m + 1]);  // the last step went to the next column, not to the next seam vertex
  std::vector<char> charges_caps(m + 1, 0);
  const auto find_cheapest = [&](int from) {
    for (int k = from; k <= m; ++k) {
      if (k > 0 && !charges_caps[k] && first[k] <= last[k - 1]) {
        // Without branches: which of the two is cheaper follows no pattern.
        const int before = place[k - 1] - first[k - 1], own = place[k] - first[k],
                  last_of_both = std::min(last[k], last[k - 1]);
        const double* const lengths2 = joints2.data();
        double* const costs = best.data();
        char* const steps = along_row.data();
        double cheapest = std::numeric_limits<double>::infinity();
        int j = first[k];
        for (; j <= last_of_both; ++j) {
          steps[own + j] = cheapest < costs[before + j];
          costs[own + j] = cheapest = std::min(costs[before + j], cheapest) + lengths2[own + j];
        }
        for (const int last_of_own = last[k]; j <= last_of_own; ++j)
          steps[own + j] = 1, costs[own + j] = cheapest = cheapest + lengths2[own + j];
        continue;
      }
      for (int j = first[k]; j <= last[k]; ++j) {
        const int at = place[k] + j - first[k];
        const bool has_column = j > first[k], has_seam = k > 0 && j <= last[k - 1];
        double from_column = has_column ? best[at - 1] : 0,
               from_seam = has_seam ? best[place[k - 1] + j - first[k - 1]] : 0;
        if (charges_caps[k] && has_column) from_column += column_cap_cost(k, j - 1);
        if (charges_caps[k] && has_seam) from_seam += seam_cap_cost(k - 1, j);
        along_row[at] = has_column && (!has_seam || from_column < from_seam);
        best[at] = (along_row[at] ? from_column : from_seam) + joints2[at];
      }
    }
  };
  const std::size_t begin = triangles.size();
  triangles.reserve(begin + m + n);
  const bool is_head = end == BoneEnd::kHead;
  /// \return the first seam vertex where the merge is to be looked for again, m + 1 if none
  const auto take_cheapest = [&] {
    int again = m + 1;
    const auto look_again = [&](int k) {
      const int low = std::max(0, k - kAroundCap);
      std::fill(charges_caps.begin() + low, charges_caps.begin() + std::min(m, k + kAroundCap) + 1, 1);
      again = std::min(again, low);
    };
    for (int k = m, j = n; k > 0 || j > 0;) {
      if (along_row[place[k] + j - first[k]]) {
        --j;
        const int apex = seam_vertices[k], here = row_vertices[j], next = row_vertices[j + 1];
        triangles.push_back(is_head ? Triangle{apex, next, here} : Triangle{here, next, apex});
        if (column_cap_cost(k, j) > 0) look_again(k);
      } else {
        --k;
        const int apex = row_vertices[j], here = seam_vertices[k], next = seam_vertices[k + 1];
        triangles.push_back(is_head ? Triangle{here, next, apex} : Triangle{apex, next, here});
        if (seam_cap_cost(k, j) > 0) look_again(k);
      }
    }
    return again;
  };
  find_cheapest(0);
  if (const int again = take_cheapest(); again <= m) {
    triangles.resize(begin);
    find_cheapest(again);
    take_cheapest();
  }
  std::reverse(triangles.begin() + static_cast<std::ptrdiff_t>(begin), triangles.end());
}

}  // namespace skeletex
