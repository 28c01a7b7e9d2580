// SPDX-License-Identifier: MIT
#include "skeletex/analysis/surface_probe.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <numbers>

#include "skeletex/geometry/parallel.h"
#include "skeletex/geometry/point_triangle.h"
#include "skeletex/skeleton/check_skeleton.h"

namespace skeletex {
namespace {

constexpr std::size_t kBlock = 4096;

/// Solid angle of a triangle seen from a point (van Oosterom and Strackee 1983), positive when its back is seen.
double solid_angle(const Vec3& p, const Vec3& q, const Vec3& r, const Vec3& from) {
  const Vec3 a = p - from, b = q - from, c = r - from;
  const double x = a.norm(), y = b.norm(), z = c.norm();
  return 2 * std::atan2(a.dot(b.cross(c)), x * y * z + a.dot(b) * z + b.dot(c) * x + c.dot(a) * y);
}

}  // namespace

std::vector<double> SurfaceProbe::winding_numbers(std::span<const Vec3> points, bool is_closed) const {
  const std::size_t count = mesh_.triangles.size();
  std::vector<double> windings(points.size(), 0);
  if (is_closed) {
    static_assert(sizeof(Triangle) == 3 * sizeof(int));
    const std::span corners(mesh_.triangles.data()->data(), 3 * count);
    for_each_block(points.size(), 1, [&](std::size_t i, std::size_t, std::size_t) {
      windings[i] = winding_number(mesh_.positions, corners, points[i]);
    });
    return windings;
  }
  std::vector<std::vector<double>> sums(block_count(count, kBlock));
  for_each_block(count, kBlock, [&](std::size_t block, std::size_t begin, std::size_t end) {
    sums[block].assign(points.size(), 0);
    for (std::size_t t = begin; t < end; ++t) {
      const auto& [a, b, c] = mesh_.triangles[t];
      for (std::size_t i = 0; i < points.size(); ++i)
        sums[block][i] += solid_angle(mesh_.positions[a], mesh_.positions[b], mesh_.positions[c], points[i]);
    }
  });
  for (const auto& sum : sums)
    for (std::size_t i = 0; i < points.size(); ++i) windings[i] += sum[i] / (4 * std::numbers::pi);
  return windings;
}

NearestPoint SurfaceProbe::nearest(const Vec3& point) const {
  const std::size_t count = mesh_.triangles.size();
  struct Best {
    double squared = std::numeric_limits<double>::infinity();
    Vec3 offset = Vec3::Zero();
    std::size_t triangle = 0;
  };
  std::vector<Best> best(block_count(count, kBlock));
  for_each_block(count, kBlock, [&](std::size_t block, std::size_t begin, std::size_t end) {
    Best& nearest = best[block];
    for (std::size_t t = begin; t < end; ++t) {
      const auto& [i, j, k] = mesh_.triangles[t];
      const Vec3 &a = mesh_.positions[i], &b = mesh_.positions[j], &c = mesh_.positions[k];
      // No point of a triangle is further from one of its corners than the longer edge there; most triangles end here.
      const double extent = 1.000001 * std::sqrt(std::max((b - a).squaredNorm(), (c - a).squaredNorm())),
                   limit = extent + std::sqrt(nearest.squared);
      if ((a - point).squaredNorm() > limit * limit) continue;
      const Vec3 offset = offset_from_triangle(point, a, b, c);
      if (offset.squaredNorm() < nearest.squared) nearest = {offset.squaredNorm(), offset, t};
    }
  });
  const Best& winner =
      *std::min_element(best.begin(), best.end(), [](const Best& a, const Best& b) { return a.squared < b.squared; });
  return {std::sqrt(winner.squared), point - winner.offset,
          area_vector(mesh_, mesh_.triangles[winner.triangle]).normalized()};
}

std::vector<Crossing> SurfaceProbe::crossings(const Vec3& begin, const Vec3& end) const {
  const Vec3 way = end - begin;
  const std::size_t count = mesh_.triangles.size();
  std::vector<std::vector<Crossing>> found(block_count(count, kBlock));
  const Vec3 lower = begin.cwiseMin(end), upper = begin.cwiseMax(end);
  for_each_block(count, kBlock, [&](std::size_t block, std::size_t first, std::size_t last) {
    for (std::size_t t = first; t < last; ++t) {
      const auto& [i, j, k] = mesh_.triangles[t];
      const Vec3 &p = mesh_.positions[i], &q = mesh_.positions[j], &r = mesh_.positions[k];
      if ((p.cwiseMin(q).cwiseMin(r).array() > upper.array()).any() ||
          (p.cwiseMax(q).cwiseMax(r).array() < lower.array()).any())
        continue;
      const Vec3 a = p - begin, b = q - begin, c = r - begin;
      const double ab = way.dot(a.cross(b)), bc = way.dot(b.cross(c)), ca = way.dot(c.cross(a));
      if (!((ab >= 0 && bc >= 0 && ca >= 0) || (ab <= 0 && bc <= 0 && ca <= 0))) continue;
      const Vec3 normal = (q - p).cross(r - p);
      const double along = way.dot(normal);
      if (along == 0) continue;
      const double share = a.dot(normal) / along;
      if (share >= 0 && share <= 1) found[block].push_back({share, begin + share * way, along > 0});
    }
  });
  std::vector<Crossing> crossings;
  for (const auto& some : found) crossings.insert(crossings.end(), some.begin(), some.end());
  std::sort(crossings.begin(), crossings.end(), [](const Crossing& a, const Crossing& b) { return a.share < b.share; });
  // Through an edge or a vertex, all the triangles there are met in one place.
  const double same = 1e-9 * diagonal_;
  const auto is_same = [&](const Crossing& a, const Crossing& b) {
    return a.is_leaving == b.is_leaving && (a.point - b.point).norm() <= same;
  };
  crossings.erase(std::unique(crossings.begin(), crossings.end(), is_same), crossings.end());
  return crossings;
}

Vec3 SurfaceProbe::middle_of_body(const Vec3& surface_point, const Vec3& inward) const {
  const double start = 1e-6 * diagonal_;
  const std::vector<Crossing> hits = crossings(surface_point + start * inward, surface_point + 2 * diagonal_ * inward);
  const auto exit = std::find_if(hits.begin(), hits.end(), [](const Crossing& c) { return c.is_leaving; });
  return exit == hits.end() ? Vec3(surface_point + 0.01 * diagonal_ * inward)
                            : Vec3(0.5 * (surface_point + exit->point));
}

}  // namespace skeletex
