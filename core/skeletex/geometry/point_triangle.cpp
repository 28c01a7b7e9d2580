// SPDX-License-Identifier: MIT
#include "skeletex/geometry/point_triangle.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <limits>

namespace skeletex {
namespace {

/// Vector from the nearest point of the segment from 0 to `edge` to `p`.
Vec3 offset_from_edge(const Vec3& p, const Vec3& edge) {
  const double squared = edge.squaredNorm();
  if (!(squared > 0)) return p;
  return p - std::clamp(p.dot(edge) / squared, 0.0, 1.0) * edge;
}

}  // namespace

Vec3 offset_from_triangle(const Vec3& p, const Vec3& a, const Vec3& b, const Vec3& c) {
  const Vec3 ab = b - a, ac = c - a, ap = p - a;
  const Vec3 normal = ab.cross(ac);
  const double squared = normal.squaredNorm(), longest = ab.squaredNorm() * ac.squaredNorm();
  Vec3 best;
  double best_squared = std::numeric_limits<double>::infinity();
  const auto consider = [&](const Vec3& offset) {
    if (offset.squaredNorm() < best_squared) {
      best = offset;
      best_squared = offset.squaredNorm();
    }
  };
  if (squared > 0) {
    double v = 0, w = 0;
    Vec3 offset = ap;
    // A sliver's foot is inaccurate at first: once more from there, and its edges may still be nearer.
    constexpr double kSliverSine = 1e-4;
    const bool is_sliver = !(squared > kSliverSine * kSliverSine * longest);
    for (int round = 0; round < (is_sliver ? 2 : 1); ++round) {
      v += offset.cross(ac).dot(normal) / squared;
      w += ab.cross(offset).dot(normal) / squared;
      offset = ap - v * ab - w * ac;
      if (!(v >= 0 && w >= 0 && v + w <= 1)) continue;
      if (!is_sliver) return offset;
      consider(offset);
    }
  }
  consider(offset_from_edge(ap, ab));
  consider(offset_from_edge(ap, ac));
  consider(offset_from_edge(p - b, c - b));
  return best;
}

}  // namespace skeletex
