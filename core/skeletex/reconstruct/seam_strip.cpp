// SPDX-License-Identifier: MIT
#include "skeletex/reconstruct/seam_strip.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>

#include "skeletex/geometry/loop_turns.h"

namespace skeletex {
namespace {

constexpr double kLargestStep = 0.45;  // with 4 columns still 1.2 columns of overlap between neighbouring ranges
constexpr double kSlackColumns = 4;
constexpr double kCapCosine2 = 0.9924;  // 175 degrees
constexpr double kCapCost = 30;         // times the square of its longest side
constexpr double kBendCost = 8;         // times an edge's squared length and the difference of the normals beside it

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

/// The cheapest merge of a seam and a row, by dynamic programming over the edges between them and the triangles that
/// lead there. It begins and ends at the shortest edge: seam vertex 0 is joined to column 0, and seam vertex m, which
/// is vertex 0 again, to column n.
class StripMerge {
 public:
  StripMerge(std::span<const Vec3> positions, const Ring& seam, std::span<const double> turns, const Ring& row)
      : m_(static_cast<int>(seam.vertices.size())), n_(static_cast<int>(row.vertices.size())) {
    const ColumnRanges ranges(turns, n_);
    const int start = find_start(positions, seam, row, ranges);
    const int start_column = static_cast<int>(std::lround(ranges.place(start)));
    for (int k = 0; k <= m_; ++k) seam_.push_back(seam.vertices[start + k < m_ ? start + k : start + k - m_]);
    for (int j = 0; j <= n_; ++j) row_.push_back(row.vertices[column_of(start_column + j)]);
    for (const VertexIndex vertex : seam_) seam_points_.push_back(positions[vertex]);
    for (const VertexIndex vertex : row_) row_points_.push_back(positions[vertex]);
    first_.resize(m_ + 1), last_.resize(m_ + 1), place_.assign(m_ + 2, 0);
    for (int k = 0; k <= m_; ++k) {
      first_[k] = std::max(ranges.first(start + k) - start_column, 0);
      last_[k] = std::min(ranges.last(start + k) - start_column, n_);
      place_[k + 1] = place_[k] + last_[k] - first_[k] + 1;
    }
  }

  std::vector<Triangle> run(BoneEnd end) {
    edges_.resize(place_[m_ + 1]);
    for (int k = 0; k <= m_; ++k)
      for (int j = first_[k]; j <= last_[k]; ++j)
        for (const Step step : {kAlongSeam, kAlongRow}) reach(k, j, step);
    return take_cheapest(end);
  }

 private:
  /// The triangle between two edges goes to the next vertex of the seam or to the next column.
  enum Step { kAlongSeam, kAlongRow };
  /// An edge between the rings, by the step that leads there.
  struct Edge {
    std::array<bool, 2> is_reached{};
    std::array<double, 2> costs{};  ///< of the cheapest merge up to there; no number where positions are none
    std::array<Step, 2> before{};   ///< the step before it
    std::array<Vec3, 2> normals;    ///< of the step's triangle
  };

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

  Edge& edge(int k, int j) { return edges_[place_[k] + j - first_[k]]; }
  bool has_edge(int k, int j) const { return k >= 0 && first_[k] <= j && j <= last_[k]; }

  void reach(int k, int j, Step step) {
    const int from_k = k - (step == kAlongSeam), from_j = j - (step == kAlongRow);
    if (!has_edge(from_k, from_j)) return;
    const Edge& from = edge(from_k, from_j);
    Edge& own = edge(k, j);
    const Vec3 across = row_points_[from_j] - seam_points_[from_k], onward = row_points_[j] - seam_points_[k],
               along =
                   step == kAlongSeam ? seam_points_[k] - seam_points_[from_k] : row_points_[j] - row_points_[from_j];
    const double across2 = across.squaredNorm(), onward2 = onward.squaredNorm();
    const Vec3 normal = along.cross(across).stableNormalized();
    double least = 0;
    bool is_first = true;
    for (const Step before : {kAlongSeam, kAlongRow}) {
      if (!from.is_reached[before]) continue;
      const double cost = from.costs[before] + kBendCost * across2 * (normal - from.normals[before]).norm();
      if (is_first || cost < least) least = cost, own.before[step] = before;
      is_first = false;
    }
    own.is_reached[step] = !is_first || (from_k == 0 && from_j == 0);
    own.normals[step] = normal;
    own.costs[step] = least + onward2 + cap_cost(across2, onward2, along.squaredNorm());
  }

  /// The triangles of the merge, from its end to its begin.
  std::vector<Triangle> take_cheapest(BoneEnd end) {
    const bool is_head = end == BoneEnd::kHead;
    std::vector<Triangle> triangles;
    triangles.reserve(m_ + n_);
    const Edge& last = edge(m_, n_);
    Step step =
        !last.is_reached[kAlongSeam] || (last.is_reached[kAlongRow] && last.costs[kAlongRow] < last.costs[kAlongSeam])
            ? kAlongRow
            : kAlongSeam;
    for (int k = m_, j = n_; k > 0 || j > 0;) {
      const Step before = edge(k, j).before[step];
      if (step == kAlongRow) {
        --j;
        const int apex = seam_[k], here = row_[j], next = row_[j + 1];
        triangles.push_back(is_head ? Triangle{apex, next, here} : Triangle{here, next, apex});
      } else {
        --k;
        const int apex = row_[j], here = seam_[k], next = seam_[k + 1];
        triangles.push_back(is_head ? Triangle{here, next, apex} : Triangle{apex, next, here});
      }
      step = before;
    }
    return triangles;
  }

  int m_, n_;                    ///< vertices of the seam and of the row
  std::vector<int> seam_, row_;  ///< vertices, the first one again at the end
  std::vector<Vec3> seam_points_, row_points_;
  std::vector<int> first_, last_;  ///< per seam vertex the columns that it may be joined to
  std::vector<int> place_;         ///< of seam vertex k joined to column j: place_[k] + j - first_[k]
  std::vector<Edge> edges_;        ///< by place
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
  for (const VertexIndex vertex : seam.vertices) points.push_back(positions[vertex]);
  append_seam_strip(positions, seam, seam_turns(points, seam.turns), row, end, triangles);
}

void append_seam_strip(std::span<const Vec3> positions, const Ring& seam, std::span<const double> turns,
                       const Ring& row, BoneEnd end, std::vector<Triangle>& triangles) {
  const std::vector<Triangle> strip = StripMerge(positions, seam, turns, row).run(end);
  triangles.insert(triangles.end(), strip.rbegin(), strip.rend());
}

}  // namespace skeletex
