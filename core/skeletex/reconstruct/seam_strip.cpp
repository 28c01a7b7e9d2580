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

/// The columns of a row that the vertices of a seam may be joined to: those between the neighbours' angles and a little
/// more, but never n + 1 of them, so that no column is met twice from the same vertex.
class ColumnRanges {
 public:
  ColumnRanges(std::span<const double> turns, int columns) : count_(columns) {
    // Of seam vertices -1 to 2 m, in unwrapped numbers: a row's angles are column / n.
    places_.reserve(2 * turns.size() + 2);
    places_.push_back(columns * (turns.back() - 1));
    for (const int turn : {0, 1})
      for (const double own : turns) places_.push_back(columns * (own + turn));
    places_.push_back(columns * (turns.front() + 2));
  }
  double place(int i) const { return places_[i + 1]; }
  int first(int i) const {
    const double column = std::max(place(i - 1) - kSlackColumns, place(i) - 0.5 * (count_ - 1));
    return static_cast<int>(column) + (static_cast<int>(column) < column);
  }
  int last(int i) const {
    const double column = std::min(place(i + 1) + kSlackColumns, place(i) + 0.5 * (count_ - 1));
    return static_cast<int>(column) - (static_cast<int>(column) > column);
  }

 private:
  int count_;
  std::vector<double> places_;
};

/// The cheapest merge of a seam and a row, by dynamic programming. It begins and ends at the shortest edge between
/// them: seam vertex 0 is joined to column 0, and seam vertex m, which is vertex 0 again, to column n.
class StripMerge {
 public:
  StripMerge(std::span<const Vec3> positions, const Ring& seam, std::span<const double> turns, const Ring& row)
      : m_(static_cast<int>(seam.vertices.size())), n_(static_cast<int>(row.vertices.size())) {
    const ColumnRanges ranges(turns, n_);
    const int start = find_start(positions, seam, row, ranges);
    const int start_column = static_cast<int>(std::lround(ranges.place(start)));
    for (int k = 0; k <= m_; ++k) seam_.push_back(seam.vertices[start + k < m_ ? start + k : start + k - m_]);
    for (int j = 0; j <= n_; ++j) row_.push_back(row.vertices[column_of(start_column + j)]);
    first_.resize(m_ + 1), last_.resize(m_ + 1), place_.assign(m_ + 2, 0);
    for (int k = 0; k <= m_; ++k) {
      first_[k] = std::max(ranges.first(start + k) - start_column, 0);
      last_[k] = std::min(ranges.last(start + k) - start_column, n_);
      place_[k + 1] = place_[k] + last_[k] - first_[k] + 1;
    }
    measure(positions);
    best_.resize(place_[m_ + 1]), along_row_.resize(place_[m_ + 1]);
    charges_caps_.assign(m_ + 1, 0);
  }

  /// Finds the merge without charging caps; where that has caps, once more with them.
  std::vector<Triangle> run(BoneEnd end) {
    find_cheapest(0);
    int again = m_ + 1;
    std::vector<Triangle> triangles = take_cheapest(end, again);
    if (again <= m_) {
      find_cheapest(again);
      triangles = take_cheapest(end, again);
    }
    return triangles;
  }

 private:
  int column_of(int j) const { return (j % n_ + n_) % n_; }

  int find_start(std::span<const Vec3> positions, const Ring& seam, const Ring& row, const ColumnRanges& ranges) const {
    int start = 0;
    double shortest = 0;
    for (int i = 0; i < m_; ++i) {
      const int column = column_of(static_cast<int>(std::lround(ranges.place(i))));
      const double length = (positions[seam.vertices[i]] - positions[row.vertices[column]]).squaredNorm();
      if (i == 0 || length < shortest) {
        start = i;
        shortest = length;
      }
    }
    return start;
  }

  void measure(std::span<const Vec3> positions) {
    std::vector<Vec3> seam_points, row_points;
    for (const int vertex : seam_) seam_points.push_back(positions[vertex]);
    for (const int vertex : row_) row_points.push_back(positions[vertex]);
    joints2_.resize(place_[m_ + 1]), seam_steps2_.resize(m_), row_steps2_.resize(n_);
    for (int k = 0; k <= m_; ++k)
      for (int j = first_[k]; j <= last_[k]; ++j)
        joints2_[place_[k] + j - first_[k]] = (seam_points[k] - row_points[j]).squaredNorm();
    for (int k = 0; k < m_; ++k) seam_steps2_[k] = (seam_points[k + 1] - seam_points[k]).squaredNorm();
    for (int j = 0; j < n_; ++j) row_steps2_[j] = (row_points[j + 1] - row_points[j]).squaredNorm();
  }

  double joint2(int k, int j) const { return joints2_[place_[k] + j - first_[k]]; }
  /// Of the triangle between seam vertex k and columns j and j + 1.
  double column_cap_cost(int k, int j) const { return cap_cost(joint2(k, j), joint2(k, j + 1), row_steps2_[j]); }
  /// Of the triangle between seam vertices k and k + 1 and column j.
  double seam_cap_cost(int k, int j) const { return cap_cost(joint2(k, j), joint2(k + 1, j), seam_steps2_[k]); }

  /// \param from  the first seam vertex for which costs are found
  void find_cheapest(int from) {
    for (int k = from; k <= m_; ++k) {
      if (k > 0 && !charges_caps_[k] && first_[k] <= last_[k - 1])
        join_plainly(k);
      else
        join(k);
    }
  }

  /// Without branches: which of the two steps is cheaper follows no pattern.
  void join_plainly(int k) {
    const int before = place_[k - 1] - first_[k - 1], own = place_[k] - first_[k],
              last_of_both = std::min(last_[k], last_[k - 1]);
    const double* const lengths2 = joints2_.data();
    double* const costs = best_.data();
    char* const steps = along_row_.data();
    double cheapest = std::numeric_limits<double>::infinity();
    int j = first_[k];
    for (; j <= last_of_both; ++j) {
      steps[own + j] = cheapest < costs[before + j];
      costs[own + j] = cheapest = std::min(costs[before + j], cheapest) + lengths2[own + j];
    }
    for (const int last_of_own = last_[k]; j <= last_of_own; ++j)
      steps[own + j] = 1, costs[own + j] = cheapest = cheapest + lengths2[own + j];
  }

  void join(int k) {
    for (int j = first_[k]; j <= last_[k]; ++j) {
      const int at = place_[k] + j - first_[k];
      const bool has_column = j > first_[k], has_seam = k > 0 && j <= last_[k - 1];
      double from_column = has_column ? best_[at - 1] : 0,
             from_seam = has_seam ? best_[place_[k - 1] + j - first_[k - 1]] : 0;
      if (charges_caps_[k] && has_column) from_column += column_cap_cost(k, j - 1);
      if (charges_caps_[k] && has_seam) from_seam += seam_cap_cost(k - 1, j);
      along_row_[at] = has_column && (!has_seam || from_column < from_seam);
      best_[at] = (along_row_[at] ? from_column : from_seam) + joints2_[at];
    }
  }

  /// The triangles of the merge, from its end to its begin. Caps are charged around those that it has.
  /// \param again  out: the first seam vertex for which costs change, if any
  std::vector<Triangle> take_cheapest(BoneEnd end, int& again) {
    const bool is_head = end == BoneEnd::kHead;
    std::vector<Triangle> triangles;
    triangles.reserve(m_ + n_);
    for (int k = m_, j = n_; k > 0 || j > 0;) {
      if (along_row_[place_[k] + j - first_[k]]) {
        --j;
        const int apex = seam_[k], here = row_[j], next = row_[j + 1];
        triangles.push_back(is_head ? Triangle{apex, next, here} : Triangle{here, next, apex});
        if (column_cap_cost(k, j) > 0) charge_caps_around(k, again);
      } else {
        --k;
        const int apex = row_[j], here = seam_[k], next = seam_[k + 1];
        triangles.push_back(is_head ? Triangle{here, next, apex} : Triangle{apex, next, here});
        if (seam_cap_cost(k, j) > 0) charge_caps_around(k, again);
      }
    }
    return triangles;
  }

  void charge_caps_around(int k, int& again) {
    const int low = std::max(0, k - kAroundCap);
    std::fill(charges_caps_.begin() + low, charges_caps_.begin() + std::min(m_, k + kAroundCap) + 1, 1);
    again = std::min(again, low);
  }

  int m_, n_;                                     ///< vertices of the seam and of the row
  std::vector<int> seam_, row_;                   ///< vertices, the first one again at the end
  std::vector<int> first_, last_;                 ///< per seam vertex the columns that it may be joined to
  std::vector<int> place_;                        ///< of seam vertex k joined to column j: place_[k] + j - first_[k]
  std::vector<double> joints2_;                   ///< by place: squared length
  std::vector<double> seam_steps2_, row_steps2_;  ///< squared lengths along the rings from each vertex on
  std::vector<double> best_;                      ///< by place: cost of the cheapest merge up to there
  std::vector<char> along_row_;     ///< by place: the last step went to the next column, not to the next seam vertex
  std::vector<char> charges_caps_;  ///< per seam vertex
};

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
  const std::vector<Triangle> strip = StripMerge(positions, seam, turns, row).run(end);
  triangles.insert(triangles.end(), strip.rbegin(), strip.rend());
}

}  // namespace skeletex
