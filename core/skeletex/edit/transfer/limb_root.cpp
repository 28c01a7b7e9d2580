// SPDX-License-Identifier: MIT
#include "skeletex/edit/transfer/limb_root.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace skeletex {
namespace {

constexpr double kMostCut = 0.85;    // share of a patch's rows that may be left out
constexpr double kTurnRange = 0.12;  // share of the rows before and behind that a turn is measured over
// What it costs to leave out rows, in turns of the surface (radians), and to run along the bone as far as around it.
constexpr double kCutCost = 0.15, kBend = 0.02;
// The cost of a distance from the wanted place, per squared girth, and the distance from which on it stays the same.
constexpr double kMisfitCost = 0.15, kMostMisfit = 4;

/// A coarse grid of rows and columns, and the cost of each of its points: [column * levels + level].
struct CostGrid {
  int columns, levels;
  double row_step;
  std::vector<double> costs;
};

/// How far the surface turns at a row, in radians: positive where it is concave.
double turn_at(const BoneProfile& column, double row, double range) {
  const Vec3 before = at_row(column, row) - at_row(column, std::max(0.0, row - range)),
             after = at_row(column, row + range) - at_row(column, row);
  return std::atan2(after.z() * -before.x() + after.x() * before.z(), before.x() * after.x() + before.z() * after.z());
}

CostGrid find_costs(const std::vector<BoneProfile>& columns, const std::vector<Eigen::Vector2d>& wanted) {
  const int width = static_cast<int>(columns.size()), last = static_cast<int>(columns[0].size()) - 1;
  const int column_step = std::max(1, width / 64);
  const double range = std::max(1.5, kTurnRange * last);
  CostGrid grid{width / column_step, 0, std::max(1.0, last / 64.0), {}};
  grid.levels = static_cast<int>(kMostCut * last / grid.row_step);
  double girth2 = 0;
  for (const Eigen::Vector2d& place : wanted) girth2 += place.squaredNorm() / static_cast<double>(wanted.size());
  for (int k = 0; k < grid.columns; ++k)
    for (int level = 0; level < grid.levels; ++level) {
      const BoneProfile& column = columns[k * column_step];
      const double row = level * grid.row_step;
      double cost = 0;
      if (girth2 > 0)
        cost += kMisfitCost *
                std::min(kMostMisfit, (at_row(column, row).head<2>() - wanted[k * column_step]).squaredNorm() / girth2);
      if (level > 0) {
        const double share = std::min(1.0, row / range);  // the turn near the end is uncertain
        cost += kCutCost * (1 + row / last) - share * turn_at(column, row, range);
      }
      grid.costs.push_back(cost);
    }
  return grid;
}

/// The level at each column of the cheapest closed curve, by dynamic programming over three turns, of which the middle
/// one does not depend on where the curve begins.
std::vector<int> cheapest_loop(const CostGrid& grid) {
  const int levels = grid.levels, steps = 3 * grid.columns;
  std::vector<double> best(grid.costs.begin(), grid.costs.begin() + levels);
  std::vector<int> from(static_cast<std::size_t>(steps) * levels, 0);
  for (int k = 1; k < steps; ++k) {
    std::vector<double> next(levels);
    for (int to = 0; to < levels; ++to) {
      double least = std::numeric_limits<double>::infinity();
      for (int level = 0; level < levels; ++level) {
        const double cost = best[level] + kBend * (to - level) * (to - level);
        if (cost < least) least = cost, from[static_cast<std::size_t>(k) * levels + to] = level;
      }
      next[to] = least + grid.costs[static_cast<std::size_t>(k % grid.columns) * levels + to];
    }
    best = std::move(next);
  }
  int level = static_cast<int>(std::min_element(best.begin(), best.end()) - best.begin());
  std::vector<int> loop(grid.columns);
  for (int k = steps - 1; k >= grid.columns; --k) {
    if (k < 2 * grid.columns) loop[k - grid.columns] = level;
    level = from[static_cast<std::size_t>(k) * levels + level];
  }
  return loop;
}

}  // namespace

std::vector<double> limb_root(const std::vector<BoneProfile>& columns, const std::vector<Eigen::Vector2d>& wanted) {
  const CostGrid grid = find_costs(columns, wanted);
  const std::vector<int> loop = cheapest_loop(grid);
  const int width = static_cast<int>(columns.size());
  std::vector<double> rows(width);
  for (int j = 0; j < width; ++j) {
    const double at = static_cast<double>(j) / width * grid.columns;
    const int k = static_cast<int>(at);
    rows[j] = (1 - (at - k)) * (loop[k % grid.columns] * grid.row_step) +
              (at - k) * (loop[(k + 1) % grid.columns] * grid.row_step);
  }
  smooth_around(rows);
  return rows;
}

}  // namespace skeletex
