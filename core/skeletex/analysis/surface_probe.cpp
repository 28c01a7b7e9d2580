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
    for_each_index(points.size(), [&](std::size_t i) {
      std::vector<int> corners;  // of the triangles that the ray along z may meet
      const Vec3 end(points[i].x(), points[i].y(), std::numeric_limits<double>::infinity());
      for_each_triangle_near(tree_, points[i], end, [&](int t) {
        corners.insert(corners.end(), mesh_.triangles[t].begin(), mesh_.triangles[t].end());
      });
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
  const Triangle& t = mesh_.triangles[find_nearest_triangle(mesh_, tree_, point).triangle];
  const Vec3 offset = offset_from_triangle(point, mesh_.positions[t[0]], mesh_.positions[t[1]], mesh_.positions[t[2]]);
  return {offset.norm(), point - offset, area_vector(mesh_, t).normalized()};
}

std::vector<Crossing> SurfaceProbe::crossings(const Vec3& begin, const Vec3& end) const {
  const Vec3 way = end - begin;
  const Vec3 lower = begin.cwiseMin(end), upper = begin.cwiseMax(end);
  std::vector<int> near;
  for_each_triangle_near(tree_, lower, upper, [&](int t) { near.push_back(t); });
  std::sort(near.begin(), near.end());
  std::vector<Crossing> crossings;
  for (const TriangleIndex triangle : near) {
    const auto& [i, j, k] = mesh_.triangles[triangle];
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
    if (share >= 0 && share <= 1) crossings.push_back({share, begin + share * way, along > 0});
  }
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
