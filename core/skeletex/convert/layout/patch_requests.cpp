// SPDX-License-Identifier: MIT
#include "skeletex/convert/layout/patch_requests.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

namespace skeletex {
namespace {

/// How far a side ratio may leave that of girth to length, as a factor: where a patch bends in one direction alone.
constexpr double kMostOff = 2;
/// The root of a patch's error counts as at most this many times that of an even map. More texels do not help what a
/// map has squeezed to a point, and the other patches need theirs.
constexpr double kMostUneven = 20;

/// A triangle on the surface and in the map, whose area is in columns x rows; both areas doubled.
struct MappedTriangle {
  Vec3 normal;  ///< unit
  double area = 0, map_area = 0;
  bool is_at_pole = false;
};

}  // namespace

double ExpectedError::best_ratio() const { return std::sqrt(around / along); }

double ExpectedError::least() const { return 2 * (std::sqrt(around * along) + both); }

double ExpectedError::with_ratio(double columns_per_row) const {
  return around / columns_per_row + along * columns_per_row + 2 * both;
}

ExpectedError expected_error(const Chart& chart, const RowProfile* profile) {
  std::vector<double> rows(chart.u.size());
  for (std::size_t i = 0; i < rows.size(); ++i) rows[i] = profile ? share_below(*profile, chart.u[i]) : chart.u[i];
  const auto column_of = [&](std::size_t t, int corner) {
    return chart.v[chart.triangles[t][corner]] + chart.turns[t][corner];
  };
  std::vector<MappedTriangle> triangles(chart.triangles.size());
  for (std::size_t t = 0; t < triangles.size(); ++t) {
    const auto& [a, b, c] = chart.triangles[t];
    const Vec3 across = (chart.positions[b] - chart.positions[a]).cross(chart.positions[c] - chart.positions[a]);
    const double area = across.norm();
    triangles[t] = {area > 0 ? Vec3(across / area) : Vec3::Zero(), area,
                    std::abs((column_of(t, 1) - column_of(t, 0)) * (rows[c] - rows[a]) -
                             (column_of(t, 2) - column_of(t, 0)) * (rows[b] - rows[a])),
                    is_pole(chart.kinds[a]) || is_pole(chart.kinds[b]) || is_pole(chart.kinds[c])};
  }
  ExpectedError error;
  double surface = 0;
  for (const MappedTriangle& triangle : triangles) surface += triangle.area / 2;
  for (int h = 0; h < static_cast<int>(chart.half_edges.twins.size()); ++h) {
    const int twin = chart.half_edges.twins[h];
    if (twin < h) continue;  // boundaries, and the other half of an edge
    const MappedTriangle &one = triangles[h / 3], &other = triangles[twin / 3];
    const int t = h / 3, from = h % 3, to = (from + 1) % 3, a = chart.triangles[t][from], b = chart.triangles[t][to];
    const double length = (chart.positions[b] - chart.positions[a]).norm(), map_area = one.map_area + other.map_area;
    if (one.is_at_pole || other.is_at_pole || !(map_area > 0) || !(length > 0) || !(one.area > 0) || !(other.area > 0))
      continue;
    // Of the dihedral angle the chord: the same for small ones, and no function to call.
    const double stretch = (one.area + other.area) / map_area,
                 weight = (one.normal - other.normal).norm() * stretch * stretch / length;
    if (!std::isfinite(weight)) continue;  // squeezed out of the range of numbers
    error.even += (one.normal - other.normal).norm() * length * surface;
    const double columns = std::abs(column_of(t, to) - column_of(t, from)), along = std::abs(rows[b] - rows[a]);
    error.around += weight * along * along, error.along += weight * columns * columns,
        error.both += weight * columns * along;
  }
  return error;
}

std::vector<PatchRequest> patch_requests(std::span<const PatchSource> sources, TexelShare share) {
  std::vector<PatchRequest> requests(sources.size());
  for (std::size_t i = 0; i < sources.size(); ++i)
    requests[i] = {share == TexelShare::kArea ? sources[i].area : sources[i].triangles,
                   sources[i].area / (sources[i].length * sources[i].length)};
  if (share != TexelShare::kError) return requests;

  std::vector<double> roots(sources.size(), 0);  // of errors
  for (std::size_t i = 0; i < sources.size(); ++i) {
    if (!sources[i].error) continue;
    const ExpectedError& error = *sources[i].error;
    const double usual = requests[i].columns_per_row;
    if (error.around > 0 || error.along > 0)
      requests[i].columns_per_row = std::clamp(error.best_ratio(), usual / kMostOff, usual * kMostOff);
    roots[i] =
        std::sqrt(std::min(kMostUneven * kMostUneven * error.even, error.with_ratio(requests[i].columns_per_row)));
  }
  double triangles = 0, root = 0;  // of patches that have both
  for (std::size_t i = 0; i < sources.size(); ++i)
    if (roots[i] > 0) triangles += sources[i].triangles, root += roots[i];
  for (std::size_t i = 0; i < sources.size(); ++i)
    requests[i].share = std::sqrt(sources[i].triangles * (roots[i] > 0    ? roots[i] / root
                                                          : triangles > 0 ? sources[i].triangles / triangles
                                                                          : 1));
  return requests;
}

}  // namespace skeletex
