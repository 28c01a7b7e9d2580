// SPDX-License-Identifier: MIT
#pragma once
#include <algorithm>
#include <functional>
#include <vector>

#include "skeletex/compact/compact_model.h"
#include "skeletex/geometry/mesh.h"
#include "skeletex/skeleton/skeleton.h"

namespace skeletex {

/// Points of a patch, rows 0 to `intervals`, columns periodic. Rows 0 and `intervals` lie on a seam, or all in a pole.
struct PatchGrid {
  int intervals = 0, columns = 0;
  std::array<bool, 2> has_pole{};
  std::vector<Vec3> points;

  int index(int row, int column) const { return row * columns + (column % columns + columns) % columns; }
  /// A row beyond a pole is that on its other side; see rows_beyond.
  const Vec3& at(int row, int column) const {
    if (row < 0) return points[index(-row, column + columns / 2)];
    if (row > intervals) return points[index(2 * intervals - row, column + columns / 2)];
    return points[index(row, column)];
  }
};

/// The points of the patch's end at a number of columns.
using EndRow = std::function<std::vector<Vec3>(BoneEnd end, int columns)>;

/// Where a step expects a new point, and its frame. Exact on every machine that rounds as IEEE 754 says.
struct Site {
  int row = 0, column = 0;               ///< in the refined grid
  std::array<int, 2> parents{};          ///< indices into the points before the step
  Vec3 predicted, normal, side, across;  ///< unit directions: side from the first to the second parent
  double spacing = 0;                    ///< between the parents
  double width = 0;                      ///< between points across
};

/// The points that a step adds to a grid, as predicted.
class Refinement {
 public:
  /// \param grid  must outlive this
  Refinement(const PatchGrid& grid, bool refines_rows, const EndRow& end_row);
  int site_count() const { return static_cast<int>(sites_.size()); }
  const std::vector<Site>& sites() const { return sites_; }
  double mean_spacing() const { return mean_spacing_; }
  /// How many sites a row has.
  int site_columns() const { return site_columns_; }
  /// The refined grid with new points from `points`, one per site.
  PatchGrid refined(const std::vector<Vec3>& points) const;

 private:
  void add_rows();
  void add_columns();

  const PatchGrid& grid_;
  bool refines_rows_;
  int site_columns_;
  double mean_spacing_ = 0;
  std::array<std::vector<Vec3>, 2> ends_;  ///< the refined grid's rows at its ends, where columns double
  std::vector<Site> sites_;
};

/// The offset of a point in 64ths of q; bounded, whatever a damaged file says.
inline int offset_of(int residual, int expected) {
  constexpr std::int64_t kMost = 1 << 28;
  return static_cast<int>(std::clamp<std::int64_t>(std::int64_t{64} * residual + expected, -kMost, kMost));
}
/// Neighbours of a site among those before it: left, above, above left, above right; -1: none.
std::array<int, 4> neighbours_of(int site, int site_columns);
/// Prediction of an offset from those of the neighbours, in 64ths of q.
int expected_offset(const OffsetWeights& weights, const std::array<int, 4>& neighbours,
                    const std::vector<int>& offsets);

/// The point halfway between the samples of a curve by the polynomial through up to three on each side.
/// \param point  point(i), i = -2 .. 3; halfway lies between 0 and 1
/// \param before, after  how many there are on each side, 1 to 3
template <class Point, class At>
Point halfway(const At& point, int before, int after);
/// Its weights: those of the points -before + 1 .. after.
const double* halfway_weights(int before, int after);

template <class Point, class At>
Point halfway(const At& point, int before, int after) {
  const double* weights = halfway_weights(before, after);
  Point sum = weights[0] * point(1 - before);
  for (int i = 1; i < before + after; ++i) sum += weights[i] * point(1 - before + i);
  return sum;
}

/// Tangential step of a site: of coarse steps a share of their spacing, else fine enough that neighbours do not pass
/// each other.
/// \param number  of the step in its patch, 0: the coarsest
double tangential_step(double q, int number, double mean_spacing, const Site& site);
/// q of a patch's step.
double normal_step(double q, int number);
/// Whether a step comes after those whose offsets have finer steps, see normal_step.
inline bool is_fine(int number) { return number >= 4; }
/// Whether a step's points stay at their home places.
inline bool stays_home(int number) { return number < 2; }

}  // namespace skeletex
