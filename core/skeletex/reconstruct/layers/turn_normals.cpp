// SPDX-License-Identifier: MIT
#include "skeletex/reconstruct/layers/turn_normals.h"

#include <Eigen/Geometry>
#include <Eigen/LU>

#include "skeletex/geometry/parallel.h"

namespace skeletex {
namespace {

constexpr std::size_t kBlock = 1 << 12;

/// Twice the area of a triangle times the inverse transpose of its map; zero where it has no area before or after.
Eigen::Matrix3d inverse_transpose(const TriangleMesh& before, const Triangle& t, std::span<const Vec3> after) {
  const auto edges = [&t](std::span<const Vec3> p) {
    Eigen::Matrix3d edge;
    edge.col(0) = p[t[1]] - p[t[0]];
    edge.col(1) = p[t[2]] - p[t[0]];
    edge.col(2) = edge.col(0).cross(edge.col(1));
    return edge;
  };
  Eigen::Matrix3d from = edges(before.positions), to = edges(after);
  const double from_area = from.col(2).norm(), to_area = to.col(2).norm();
  if (!(from_area > 0 && to_area > 0)) return Eigen::Matrix3d::Zero();
  from.col(2) /= from_area, to.col(2) /= to_area;
  // The map is to from^-1; the inverse of `to` has its crossed columns as rows.
  Eigen::Matrix3d to_inverse;
  to_inverse.row(0) = to.col(1).cross(to.col(2)) / to_area;
  to_inverse.row(1) = to.col(2).cross(to.col(0)) / to_area;
  to_inverse.row(2) = to.col(2);
  return from_area * (from * to_inverse).transpose();
}

}  // namespace

std::vector<Vec3> turn_normals(const TriangleMesh& before, std::span<const Vec3> normals, std::span<const Vec3> after) {
  std::vector<char> has_moved(before.triangles.size());
  std::vector<Eigen::Matrix3d> maps(before.triangles.size());
  for_each_block(before.triangles.size(), kBlock, [&](std::size_t, std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const Triangle& t = before.triangles[i];
      for (const int v : t) has_moved[i] = has_moved[i] || before.positions[v] != after[v];
      maps[i] = inverse_transpose(before, t, after);
    }
  });
  std::vector<Vec3> turned(normals.size(), Vec3::Zero());
  std::vector<char> turns(normals.size(), 0);
  for (std::size_t i = 0; i < before.triangles.size(); ++i)
    for (const int v : before.triangles[i]) {
      turned[v] += maps[i] * normals[v];
      turns[v] = turns[v] || has_moved[i];
    }
  for (std::size_t v = 0; v < normals.size(); ++v) {
    const double length = turned[v].norm();
    turned[v] = turns[v] && length > 0 ? Vec3(turned[v] / length) : normals[v];
  }
  return turned;
}

}  // namespace skeletex
