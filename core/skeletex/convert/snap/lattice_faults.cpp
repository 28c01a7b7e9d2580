// SPDX-License-Identifier: MIT
#include "skeletex/convert/snap/lattice_faults.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>

#include "skeletex/convert/snap/snap.h"
#include "skeletex/geometry/parallel.h"
#include "skeletex/geometry/point_triangle.h"

namespace skeletex {
namespace {

constexpr std::size_t kBlock = 1 << 10;
constexpr double kWorthALook = 0.15;      // of the limit, at the middle of a triangle: then other points are sampled
constexpr double kWorthMeasuring = 0.75;  // of the limit: estimates above it are measured
constexpr double kShareOfGrid = 0.005;    // of the regular grid's triangles, those with the highest estimates
constexpr std::size_t kLeastOfGrid = 2000;
constexpr double kGridWorthALook = 0.5;  // of the furthest middle of the regular grid
constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// Sampled points of a triangle, as shares of its first two sides: corners, quarters and middles of the sides, and
/// points between them and the middle.
constexpr std::array<std::array<double, 2>, 15> kPlaces{{{0, 0},
                                                         {1, 0},
                                                         {0, 1},
                                                         {0.25, 0},
                                                         {0.5, 0},
                                                         {0.75, 0},
                                                         {0, 0.25},
                                                         {0, 0.5},
                                                         {0, 0.75},
                                                         {0.75, 0.25},
                                                         {0.5, 0.5},
                                                         {0.25, 0.75},
                                                         {0.6, 0.2},
                                                         {0.2, 0.6},
                                                         {0.2, 0.2}}};

std::array<Vec3, 3> corners_of(const TriangleMesh& mesh, TriangleIndex triangle) {
  const Triangle& t = mesh.triangles[triangle];
  return {mesh.positions[t[0]], mesh.positions[t[1]], mesh.positions[t[2]]};
}

Vec3 area_vector(const std::array<Vec3, 3>& corners) {
  return (corners[1] - corners[0]).cross(corners[2] - corners[0]);
}

/// How far a side is from a surface that its ends lie on, by the normals there: the height at which the two planes meet
/// over it.
double bend_of_side(const Vec3& side, const Vec3& first_normal, const Vec3& second_normal) {
  const double first = std::abs(side.dot(first_normal)), second = std::abs(side.dot(second_normal));
  return first + second > 0 ? first * second / (first + second) : 0;
}

/// What can be told of a triangle by its corners alone.
struct Estimate {
  double distance = 0;  ///< infinite where not all corners are texels of VSM patches
  bool may_be_inverted = false;
};
Estimate estimate(const LatticeSurface& surface, const OriginalSurface& original, TriangleIndex triangle) {
  const std::array<Vec3, 3> corners = corners_of(surface.mesh, triangle);
  const std::array<int, 3> read = surface.read_by(triangle, original);
  const Vec3 own = area_vector(corners);
  Estimate result;
  double corner_distance = 0;
  for (int k = 0; k < 3; ++k) {
    const int next = (k + 1) % 3;
    if (read[k] < 0) {
      result.distance = kInfinity;
      continue;
    }
    const Vec3& normal = original.map_normals[read[k]];
    result.may_be_inverted = result.may_be_inverted || own.dot(normal) < 0;
    corner_distance = std::max(corner_distance, std::abs(normal.dot(corners[k] - original.map_triangles[read[k]][0])));
    if (read[next] >= 0)
      result.distance =
          std::max(result.distance, bend_of_side(corners[next] - corners[k], normal, original.map_normals[read[next]]));
  }
  result.distance += corner_distance;
  return result;
}

/// The point of the original nearest to a place, looked for near what a triangle's corners read first.
struct NearestPoint {
  double distance = kInfinity;
  Vec3 normal = Vec3::Zero();  ///< of its triangle, of any length
};
/// \param enough  what is so near need not be the nearest
NearestPoint find_nearest(const OriginalSurface& original, const std::array<int, 3>& read, const Vec3& place,
                          double enough) {
  NearestPoint nearest;
  for (int k = 0; k < 3; ++k) {
    if (read[k] < 0 || (k > 0 && read[k] == read[k - 1]) || (k == 2 && read[2] == read[0])) continue;
    const auto& [a, b, c] = original.map_triangles[read[k]];
    const double distance = offset_from_triangle(place, a, b, c).norm();
    if (distance < nearest.distance) nearest = {distance, original.map_normals[read[k]]};
    if (nearest.distance <= enough) return nearest;
  }
  const NearestTriangle found = find_nearest_triangle(original.mesh, original.tree, place, nearest.distance);
  if (found.triangle >= 0) nearest = {found.distance, area_vector(corners_of(original.mesh, found.triangle))};
  return nearest;
}

NearestPoint find_nearest_to_middle(const LatticeSurface& surface, const OriginalSurface& original,
                                    TriangleIndex triangle, double enough) {
  const auto [a, b, c] = corners_of(surface.mesh, triangle);
  return find_nearest(original, surface.read_by(triangle, original), (a + b + c) / 3, enough);
}

bool is_inverted(const LatticeSurface& surface, TriangleIndex triangle, const NearestPoint& nearest) {
  return area_vector(corners_of(surface.mesh, triangle)).dot(nearest.normal) < 0;
}

/// The distance of the furthest of a triangle's sampled points but its middle.
/// \param enough   distances up to it need not be exact
/// \param at_most  nothing is looked for beyond it
double furthest_place(const LatticeSurface& surface, const OriginalSurface& original, TriangleIndex triangle,
                      double enough, double at_most) {
  const auto [a, b, c] = corners_of(surface.mesh, triangle);
  const std::array<int, 3> read = surface.read_by(triangle, original);
  double furthest = 0;
  for (const auto& [s, t] : kPlaces) {
    const Vec3 place = a + s * (b - a) + t * (c - a);
    furthest = std::max(furthest, find_nearest(original, read, place, std::max(enough, furthest)).distance);
    if (furthest > at_most) break;
  }
  return furthest;
}

/// The triangles with the highest estimates, of those that are finite.
std::vector<int> highest(const std::vector<Estimate>& estimates) {
  std::vector<double> distances;
  distances.reserve(estimates.size());
  for (const Estimate& each : estimates)
    if (std::isfinite(each.distance)) distances.push_back(each.distance);
  const auto share = static_cast<std::size_t>(kShareOfGrid * static_cast<double>(distances.size()));
  const std::size_t count = std::max(kLeastOfGrid, share);
  double least = 0;
  if (count < distances.size()) {
    const auto last = distances.begin() + static_cast<std::ptrdiff_t>(count);
    std::nth_element(distances.begin(), last, distances.end(), std::greater<>());
    least = *last;
  }
  std::vector<int> triangles;
  for (std::size_t i = 0; i < estimates.size(); ++i)
    if (std::isfinite(estimates[i].distance) && estimates[i].distance > least) triangles.push_back(static_cast<int>(i));
  return triangles;
}

}  // namespace

OriginalSurface prepare_original(const TriangleMesh& mesh, const TriangleTree& tree, std::span<const Chart> charts,
                                 const LatticeFrame& frame) {
  OriginalSurface original{mesh, tree, {}, {}, {}, std::vector<std::vector<int>>(charts.size())};
  int first_point = 0;
  for (std::size_t bone = 0; bone < charts.size(); ++bone) {
    const Patch& patch = frame.model.patches[bone];
    if (is_height_field(patch.method)) continue;
    const Chart& chart = charts[bone];
    for (const auto& [a, b, c] : chart.triangles) {
      original.map_triangles.push_back({chart.positions[a], chart.positions[b], chart.positions[c]});
      original.map_normals.push_back(area_vector(original.map_triangles.back()).normalized());
    }
    const Rectangle& r = patch.rectangle;
    const std::vector<double> rows = rows_of(patch.row_u, chart.u);
    for (std::size_t i = 0; i < chart.positions.size(); ++i) {
      if (chart.kinds[i] != ChartVertex::kInner) continue;
      const int row = std::clamp(static_cast<int>(rows[i]), 1, r.height - 3),
                column = wrapped(static_cast<int>(std::floor(chart.v[i] * r.width)), r.width);
      const int quad = frame.numbers.first_quad[bone] + (row - 1) * r.width + column;
      original.vertices.push_back({first_point + static_cast<int>(i), quad, chart.positions[i]});
      original.quads[bone].push_back(quad);
    }
    first_point += static_cast<int>(chart.positions.size());
  }
  return original;
}

std::array<int, 3> LatticeSurface::read_by(TriangleIndex triangle, const OriginalSurface& original) const {
  std::array<int, 3> read{-1, -1, -1};
  for (int k = 0; k < 3; ++k) {
    const VertexIndex vertex = mesh.triangles[triangle][k];
    if (!frame.is_inner(vertex)) continue;
    const int number = map_triangles[frame.texels[vertex]];
    if (number < static_cast<int>(original.map_triangles.size())) read[k] = number;
  }
  return read;
}

RegularGridFaults measure_regular_grid(const LatticeSurface& surface, const OriginalSurface& original) {
  std::vector<Estimate> estimates(2 * static_cast<std::size_t>(surface.frame.numbers.quad_count));
  for_each_index(estimates.size(), kBlock,
                 [&](std::size_t i) { estimates[i] = estimate(surface, original, static_cast<int>(i)); });
  const std::vector<int> suspects = highest(estimates);
  std::vector<double> distances(suspects.size());
  for_each_index(suspects.size(), kBlock, [&](std::size_t i) {
    distances[i] = find_nearest_to_middle(surface, original, suspects[i], 0).distance;
  });
  RegularGridFaults faults;
  for (const double distance : distances) faults.furthest = std::max(faults.furthest, distance);
  const double middle = faults.furthest;
  for_each_index(suspects.size(), kBlock, [&](std::size_t i) {
    if (distances[i] >= kGridWorthALook * middle)
      distances[i] = std::max(distances[i], furthest_place(surface, original, suspects[i], middle, kInfinity));
  });
  for (const double distance : distances) faults.furthest = std::max(faults.furthest, distance);

  std::vector<int> candidates;
  for (std::size_t i = 0; i < estimates.size(); ++i)
    if (estimates[i].may_be_inverted) candidates.push_back(static_cast<int>(i));
  for (const TriangleIndex triangle : candidates)
    if (is_inverted(surface, triangle, find_nearest_to_middle(surface, original, triangle, 0)))
      faults.inverted.push_back(triangle);
  return faults;
}

std::vector<MeasuredTriangle> measure_triangles(const LatticeSurface& surface, const OriginalSurface& original,
                                                std::span<const int> triangles, double limit, double share) {
  std::vector<std::vector<MeasuredTriangle>> found(block_count(triangles.size(), kBlock));
  for_each_block(triangles.size(), kBlock, [&](std::size_t block, std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const TriangleIndex triangle = triangles[i];
      const Estimate estimated = estimate(surface, original, triangle);
      if (estimated.distance <= kWorthMeasuring * limit && !estimated.may_be_inverted) continue;
      const NearestPoint nearest =
          find_nearest_to_middle(surface, original, triangle, estimated.may_be_inverted ? 0 : kWorthALook * limit);
      MeasuredTriangle measured{triangle, nearest.distance,
                                estimated.may_be_inverted && is_inverted(surface, triangle, nearest)};
      if (measured.distance > kWorthALook * limit && measured.distance <= limit)
        measured.distance =
            std::max(measured.distance, furthest_place(surface, original, triangle, share * limit, limit));
      if (measured.distance > share * limit || measured.is_inverted) found[block].push_back(measured);
    }
  });
  std::vector<MeasuredTriangle> all;
  for (const auto& some : found) all.insert(all.end(), some.begin(), some.end());
  return all;
}

std::vector<int> nearest_to_far_vertices(const LatticeSurface& surface, const OriginalSurface& original,
                                         const TriangleTree& tree, std::span<const char> is_held, double limit) {
  std::vector<int> nearest(original.vertices.size(), -1);
  for_each_index(nearest.size(), kBlock, [&](std::size_t i) {
    const OriginalSurface::Vertex& vertex = original.vertices[i];
    if (is_held[vertex.number] != 0) return;
    for (const TriangleIndex triangle : {2 * vertex.quad, 2 * vertex.quad + 1}) {
      const auto [a, b, c] = corners_of(surface.mesh, triangle);
      if (offset_from_triangle(vertex.position, a, b, c).norm() <= limit) return;
    }
    const NearestTriangle found = find_nearest_triangle(surface.mesh, tree, vertex.position);
    if (found.distance > limit) nearest[i] = found.triangle;
  });
  std::erase(nearest, -1);
  return nearest;
}

}  // namespace skeletex
