// SPDX-License-Identifier: MIT
// The plain twin of kernels/metro.cl: every triangle, every candidate for the nearest point, in long double.
#pragma once
#include <Eigen/Geometry>
#include <limits>

#include "skeletex/geometry/mesh.h"

namespace skeletex {

inline long double twin_distance_to_triangle(const Vec3& point, const Vec3& first, const Vec3& second,
                                             const Vec3& third) {
  using Real3 = Eigen::Matrix<long double, 3, 1>;
  const Real3 p = point.cast<long double>();
  const Real3 corners[3] = {first.cast<long double>(), second.cast<long double>(), third.cast<long double>()};
  long double best = std::numeric_limits<long double>::infinity();
  const Real3 normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
  bool is_above_inside = normal.norm() > 0;
  for (int k = 0; k < 3; ++k) {
    const Real3 &a = corners[k], &b = corners[(k + 1) % 3];
    best = std::min(best, (p - a).norm());
    const long double along = (p - a).dot(b - a), squared = (b - a).squaredNorm();
    if (along > 0 && along < squared) best = std::min(best, (p - a - along / squared * (b - a)).norm());
    if (normal.dot((b - a).cross(p - a)) < 0) is_above_inside = false;
  }
  if (is_above_inside) best = std::min(best, std::abs(normal.normalized().dot(p - corners[0])));
  return best;
}

inline long double twin_distance_to_mesh(const TriangleMesh& mesh, const Vec3& p) {
  long double best = std::numeric_limits<long double>::infinity();
  for (const auto& [a, b, c] : mesh.triangles)
    best = std::min(best, twin_distance_to_triangle(p, mesh.positions[a], mesh.positions[b], mesh.positions[c]));
  return best;
}

}  // namespace skeletex
