// SPDX-License-Identifier: MIT
#pragma once
#include <span>
#include <vector>

#include "skeletex/convert/parameterize/chart.h"

namespace skeletex {

/// How surface length accumulates along a patch. The share g(u) of the rows below u grows with the power mean,
/// exponent 1.25, of |dP/du| over v: with the mean, but more where some columns are stretched.
struct RowProfile {
  std::vector<double> u;      ///< increasing from 0 to 1
  std::vector<double> share;  ///< g(u), increasing from 0 to 1
  double length = 0;          ///< of the meridians, their mean over v; world units
};

/// Profile of a map: every triangle counts with its width in v at each u, exactly, in bins whose borders follow the
/// vertices.
/// \pre chart.u and chart.v are filled
RowProfile row_profile(const Chart& chart);

/// Profile of points on a regular grid in u: `positions` holds rows x columns points, row-major, row r at
/// u = r / (rows - 1), the columns at any angles.
RowProfile row_profile(std::span<const Vec3> positions, int rows, int columns);

/// g(u), linear between the entries.
double share_below(const RowProfile& profile, double u);

/// Where `height` rows are read: evenly in surface length, u_r = g^-1(r / (height - 1)).
std::vector<double> spread_rows_by_length(const RowProfile& profile, int height);
/// Evenly in u (the paper's recipe).
std::vector<double> spread_rows_uniformly(int height);

}  // namespace skeletex
