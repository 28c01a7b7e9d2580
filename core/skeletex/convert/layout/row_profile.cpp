// SPDX-License-Identifier: MIT
#include "skeletex/convert/layout/row_profile.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "skeletex/math/portable.h"

namespace skeletex {
namespace {

/// Part of g that grows with u instead of length, so that g is strictly increasing even where nothing is.
constexpr double kUniformPart = 1e-4;

/// The mean |dP/du| would be 1, the least error of flat triangles over a square lattice 3 (errors grow with the square
/// of a row's length, the area that has them with the length). But 3 spends rows on the few most stretched
/// columns; 1.25 keeps the mean error and lowers the maximum (docs/steps/layout.md).
constexpr double kExponent = 1.25;
double power_of(double density) { return density * std::sqrt(std::sqrt(density)); }

/// A width that rises linearly from `low` to `middle`, falls to `high`, and has the total `area`.
struct Hat {
  double low, middle, high, area;
  double rise = middle > low ? area / ((high - low) * (middle - low)) : 0;
  double fall = high > middle ? area / ((high - low) * (high - middle)) : 0;

  double integral_to(double u) const {
    if (u <= low) return 0;
    if (u >= high) return area;
    return u < middle ? rise * (u - low) * (u - low) : area - fall * (high - u) * (high - u);
  }
};

/// Integrals over bins of u, of |dP/du| and of its power.
struct Bins {
  std::vector<double> borders, length, power;

  explicit Bins(std::vector<double> bin_borders)
      : borders(std::move(bin_borders)), length(borders.size() - 1, 0), power(borders.size() - 1, 0) {}
  /// \param density_power  density ^ kExponent; a triangle lies in many bins
  void add(std::size_t bin, double measure, double density, double density_power) {
    length[bin] += density * measure;
    power[bin] += density_power * measure;
  }
};

RowProfile finish(Bins bins) {
  RowProfile profile;
  std::vector<double> gain(bins.length.size());
  double total = 0;
  for (std::size_t i = 0; i < gain.size(); ++i) {
    const double span = bins.borders[i + 1] - bins.borders[i];
    gain[i] = span * portable::pow(bins.power[i] / span, 1 / kExponent);
    total += gain[i];
    profile.length += bins.length[i];
  }
  profile.u = std::move(bins.borders);
  profile.share = {0};
  for (std::size_t i = 0; i < gain.size(); ++i)
    profile.share.push_back(profile.share.back() + (1 - kUniformPart) * (total > 0 ? gain[i] / total : 0) +
                            kUniformPart * (profile.u[i + 1] - profile.u[i]));
  return profile;
}

struct Corner {
  double u, v;
  Vec3 p;
};

/// Bin borders: quantiles of the vertices' u, so that squeezed regions are resolved, and a regular grid.
std::vector<double> bin_borders(const Chart& chart) {
  constexpr int kBins = 2048;
  std::vector<double> sorted;
  for (std::size_t i = 0; i < chart.u.size(); ++i)
    if (chart.kinds[i] == ChartVertex::kInner) sorted.push_back(chart.u[i]);
  std::sort(sorted.begin(), sorted.end());
  std::vector<double> borders;
  for (int i = 0; i <= 64; ++i) borders.push_back(i / 64.0);
  const std::size_t step = std::max<std::size_t>(1, sorted.size() / kBins);
  for (std::size_t i = 0; i < sorted.size(); i += step) borders.push_back(std::clamp(sorted[i], 0.0, 1.0));
  std::sort(borders.begin(), borders.end());
  borders.erase(std::unique(borders.begin(), borders.end()), borders.end());
  return borders;
}

/// Adds `density` (length per u) times a width over [low, high] that peaks at `middle`.
void add_hat(Bins& bins, double low, double middle, double high, double area, double density) {
  if (!(high > low) || !(area > 0)) return;
  std::size_t bin = std::upper_bound(bins.borders.begin(), bins.borders.end(), low) - bins.borders.begin();
  bin = bin == 0 ? 0 : bin - 1;
  const double density_power = power_of(density);
  const Hat hat{low, middle, high, area};
  // A triangle can be squeezed so much in the map that these leave the range of numbers.
  if (!std::isfinite(density_power) || !std::isfinite(hat.rise) || !std::isfinite(hat.fall)) return;
  double before = hat.integral_to(bins.borders[bin]);
  for (; bin < bins.length.size() && bins.borders[bin] < high; ++bin) {
    const double after = hat.integral_to(bins.borders[bin + 1]);
    bins.add(bin, after - before, density, density_power);
    before = after;
  }
}

/// The trapezoid of a pole over the opposite edge, in slices of the edge: a parallelogram-free sum of boxes.
void add_pole_triangle(Bins& bins, const Corner& pole, const Corner& a, const Corner& b) {
  constexpr int kSlices = 4;
  for (int i = 0; i < kSlices; ++i) {
    const double lambda = (i + 0.5) / kSlices;
    const double u = a.u + lambda * (b.u - a.u), width = std::abs(b.v - a.v) / kSlices;
    const double length = (pole.p - (a.p + lambda * (b.p - a.p))).norm();
    const double low = std::min(u, pole.u), high = std::max(u, pole.u);
    if (!(high > low)) continue;
    // A constant width is the sum of a rising and a falling ramp.
    add_hat(bins, low, low, high, width * (high - low) / 2, length / (high - low));
    add_hat(bins, low, high, high, width * (high - low) / 2, length / (high - low));
  }
}

void add_triangle(Bins& bins, const std::array<Corner, 3>& c) {
  const double du1 = c[1].u - c[0].u, dv1 = c[1].v - c[0].v, du2 = c[2].u - c[0].u, dv2 = c[2].v - c[0].v;
  const double determinant = du1 * dv2 - du2 * dv1;
  if (determinant == 0) return;
  const double density = ((c[1].p - c[0].p) * dv2 - (c[2].p - c[0].p) * dv1).norm() / std::abs(determinant);
  std::array<double, 3> u{c[0].u, c[1].u, c[2].u};
  std::sort(u.begin(), u.end());
  add_hat(bins, u[0], u[1], u[2], std::abs(determinant) / 2, density);
}

}  // namespace

RowProfile row_profile(const Chart& chart) {
  Bins bins(bin_borders(chart));
  for (std::size_t t = 0; t < chart.triangles.size(); ++t) {
    std::array<Corner, 3> c;
    int pole = -1;
    for (int k = 0; k < 3; ++k) {
      const VertexIndex vertex = chart.triangles[t][k];
      c[k] = {chart.u[vertex], chart.v[vertex] + chart.turns[t][k], chart.positions[vertex]};
      if (is_pole(chart.kinds[vertex])) pole = k;
    }
    if (pole >= 0)
      add_pole_triangle(bins, c[pole], c[(pole + 1) % 3], c[(pole + 2) % 3]);
    else
      add_triangle(bins, c);
  }
  return finish(std::move(bins));
}

RowProfile row_profile(std::span<const Vec3> positions, int rows, int columns) {
  std::vector<double> u(rows);
  for (int r = 0; r < rows; ++r) u[r] = static_cast<double>(r) / (rows - 1);
  Bins bins(std::move(u));
  for (int r = 0; r + 1 < rows; ++r)
    for (int j = 0; j < columns; ++j) {
      const double density = (positions[(r + 1) * columns + j] - positions[r * columns + j]).norm() * (rows - 1);
      bins.add(r, 1.0 / ((rows - 1) * columns), density, power_of(density));
    }
  return finish(std::move(bins));
}

double share_below(const RowProfile& profile, double u) {
  const auto above = std::upper_bound(profile.u.begin() + 1, profile.u.end() - 1, u);
  const std::size_t i = above - profile.u.begin();
  const double span = profile.u[i] - profile.u[i - 1];
  return profile.share[i - 1] +
         (span > 0 ? (u - profile.u[i - 1]) / span : 0) * (profile.share[i] - profile.share[i - 1]);
}

std::vector<double> spread_rows_by_length(const RowProfile& profile, int height) {
  std::vector<double> rows(height);
  std::size_t bin = 0;
  for (int r = 1; r + 1 < height; ++r) {
    const double share = profile.share.back() * r / (height - 1);
    while (bin + 2 < profile.u.size() && profile.share[bin + 1] < share) ++bin;
    const double span = profile.share[bin + 1] - profile.share[bin];
    rows[r] =
        profile.u[bin] + (profile.u[bin + 1] - profile.u[bin]) * (span > 0 ? (share - profile.share[bin]) / span : 0.5);
  }
  rows.front() = 0;
  rows.back() = 1;
  return rows;
}

std::vector<double> spread_rows_uniformly(int height) {
  std::vector<double> rows(height);
  for (int r = 0; r < height; ++r) rows[r] = static_cast<double>(r) / (height - 1);
  return rows;
}

}  // namespace skeletex
