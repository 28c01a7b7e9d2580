// SPDX-License-Identifier: MIT
#include "skeletex/compact/refine.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>

namespace skeletex {
namespace {

/// Lagrange's polynomial through the points -before + 1 .. after, at 1/2.
std::array<double, 6> weights_of(int before, int after) {
  std::array<double, 6> weights{};
  for (int i = 0; i < before + after; ++i) {
    double numerator = 1, denominator = 1;
    for (int k = 0; k < before + after; ++k) {
      if (k == i) continue;
      numerator *= 0.5 - (k + 1 - before);
      denominator *= i - k;
    }
    weights[i] = numerator / denominator;
  }
  return weights;
}

/// How many rows beyond an end a stencil may read: those beyond a pole are those on its other side, where a column lies
/// opposite.
int rows_beyond(const PatchGrid& grid, int end) {
  return grid.has_pole[end] && grid.columns % 2 == 0 ? std::min(2, grid.intervals - 1) : 0;
}

Vec3 unit_or_zero(const Vec3& v) {
  const double length = v.norm();
  return length > 0 ? Vec3(v / length) : Vec3(Vec3::Zero());
}

/// Normal and tangents, given the directions along and across the refined one.
void set_frame(Site& site, const Vec3& along, const Vec3& across) {
  site.spacing = along.norm();
  site.width = 0.25 * across.norm();
  site.side = unit_or_zero(along);
  site.normal = unit_or_zero(along.cross(across));
  if (site.normal == Vec3::Zero()) {  // any direction that both sides agree on
    if (site.side == Vec3::Zero()) site.side = Vec3::UnitX();
    const int axis = std::abs(site.side[0]) < 0.5 ? 0 : 1;
    site.normal = unit_or_zero(site.side.cross(Vec3::Unit(axis)));
  }
  site.across = site.normal.cross(site.side);
}

/// By how much each new point of an end's row differs from its prediction along the row.
std::vector<Vec3> end_misses(const PatchGrid& grid, int row, const std::vector<Vec3>& fine) {
  std::vector<Vec3> misses;
  for (int c = 0; c < grid.columns; ++c)
    misses.push_back(fine[2 * c + 1] - halfway<Vec3>([&](int i) -> const Vec3& { return grid.at(row, c + i); }, 3, 3));
  return misses;
}

/// How much of that a point inside is expected to follow, by its squared distance from the end in squared spacings:
/// a wave along the end fades within one of its lengths.
double end_share(double squared_distance, double squared_spacing) {
  constexpr double kFade = 10;  // about pi^2
  return squared_spacing / (squared_spacing + kFade * squared_distance);
}

}  // namespace

const double* halfway_weights(int before, int after) {
  static const auto table = [] {
    std::array<std::array<std::array<double, 6>, 3>, 3> t{};
    for (int b = 1; b <= 3; ++b)
      for (int a = 1; a <= 3; ++a) t[b - 1][a - 1] = weights_of(b, a);
    return t;
  }();
  return table[before - 1][after - 1].data();
}

Refinement::Refinement(const PatchGrid& grid, bool refines_rows, const EndRow& end_row)
    : grid_(grid), refines_rows_(refines_rows) {
  site_columns_ = grid.columns;
  if (refines_rows) {
    add_rows();
  } else {
    ends_ = {end_row(BoneEnd::kHead, 2 * grid.columns), end_row(BoneEnd::kTail, 2 * grid.columns)};
    add_columns();
  }
  for (const Site& site : sites_) mean_spacing_ += site.spacing;
  mean_spacing_ /= std::max(1, site_count());
}

void Refinement::add_rows() {
  const PatchGrid& grid = grid_;
  const int before_first = rows_beyond(grid, 0), beyond_last = rows_beyond(grid, 1);
  for (int r = 0; r < grid.intervals; ++r)
    for (int c = 0; c < grid.columns; ++c) {
      Site site;
      site.row = 2 * r + 1;
      site.column = c;
      site.parents = {grid.index(r, c), grid.index(r + 1, c)};
      const int before = std::min(3, r + 1 + before_first), after = std::min(3, grid.intervals - r + beyond_last);
      site.predicted = halfway<Vec3>([&](int i) -> const Vec3& { return grid.at(r + i, c); }, before, after);
      set_frame(site, grid.at(r + 1, c) - grid.at(r, c),
                (grid.at(r, c + 1) + grid.at(r + 1, c + 1)) - (grid.at(r, c - 1) + grid.at(r + 1, c - 1)));
      sites_.push_back(site);
    }
}

void Refinement::add_columns() {
  const PatchGrid& grid = grid_;
  const std::array<std::vector<Vec3>, 2> misses{end_misses(grid, 0, ends_[0]),
                                                end_misses(grid, grid.intervals, ends_[1])};
  for (int r = 1; r < grid.intervals; ++r)
    for (int c = 0; c < grid.columns; ++c) {
      Site site;
      site.row = r;
      site.column = 2 * c + 1;
      site.parents = {grid.index(r, c), grid.index(r, c + 1)};
      site.predicted = halfway<Vec3>([&](int i) -> const Vec3& { return grid.at(r, c + i); }, 3, 3);
      set_frame(site, grid.at(r, c + 1) - grid.at(r, c),
                (grid.at(r + 1, c) + grid.at(r + 1, c + 1)) - (grid.at(r - 1, c) + grid.at(r - 1, c + 1)));
      for (const int end : {0, 1}) {
        if (grid.has_pole[end] || site.spacing == 0) continue;
        const int row = end == 0 ? 0 : grid.intervals;
        const Vec3 from_end = 0.5 * (grid.at(r, c) + grid.at(r, c + 1) - grid.at(row, c) - grid.at(row, c + 1));
        site.predicted += end_share(from_end.squaredNorm(), site.spacing * site.spacing) * misses[end][c];
      }
      sites_.push_back(site);
    }
}

std::array<int, 4> neighbours_of(int site, int site_columns) {
  const int row = site / site_columns, column = site % site_columns;
  const int above = row > 0 ? site - site_columns : -1;
  return {column > 0 ? site - 1 : -1, above,
          above < 0    ? -1
          : column > 0 ? above - 1
                       : above + site_columns - 1,
          above < 0                   ? -1
          : column + 1 < site_columns ? above + 1
                                      : above + 1 - site_columns};
}

PatchGrid Refinement::refined(const std::vector<Vec3>& points) const {
  PatchGrid fine;
  fine.intervals = refines_rows_ ? 2 * grid_.intervals : grid_.intervals;
  fine.columns = refines_rows_ ? grid_.columns : 2 * grid_.columns;
  fine.has_pole = grid_.has_pole;
  fine.points.resize(static_cast<std::size_t>(fine.intervals + 1) * fine.columns);
  for (int r = 0; r <= grid_.intervals; ++r)
    for (int c = 0; c < grid_.columns; ++c)
      fine.points[fine.index(refines_rows_ ? 2 * r : r, refines_rows_ ? c : 2 * c)] = grid_.points[grid_.index(r, c)];
  if (!refines_rows_) {
    std::copy(ends_[0].begin(), ends_[0].end(), fine.points.begin());
    std::copy(ends_[1].begin(), ends_[1].end(), fine.points.end() - fine.columns);
  }
  for (std::size_t i = 0; i < sites_.size(); ++i) fine.points[fine.index(sites_[i].row, sites_[i].column)] = points[i];
  return fine;
}

int expected_offset(const OffsetWeights& weights, const std::array<int, 4>& neighbours,
                    const std::vector<int>& offsets) {
  std::int64_t sum = 0;
  for (int i = 0; i < 4; ++i)
    if (neighbours[i] >= 0) sum += static_cast<std::int64_t>(weights[i]) * offsets[neighbours[i]];
  return static_cast<int>(sum / 64);
}

double tangential_step(double q, int number, double mean_spacing, const Site& site) {
  if (stays_home(number)) return std::max(0.05 * mean_spacing, 4 * q);
  return std::clamp(0.25 * std::min(site.spacing, site.width), q / 4, 16 * q);
}

double normal_step(double q, int number) { return is_fine(number) ? q : 0.6 * q; }

}  // namespace skeletex
