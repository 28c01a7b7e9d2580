// SPDX-License-Identifier: MIT
#include "skeletex/reconstruct/layers/turn_normals.h"

#include <cmath>

#include "skeletex/geometry/best_rotation.h"
#include "skeletex/geometry/parallel.h"

namespace skeletex {
namespace {

constexpr std::size_t kBlock = 1 << 10;
constexpr int kRings = 2;  // of triangles whose turns a vertex takes the mean of

/// The axes of a triangle at one of its corners: its normal, and two directions in it that turn with its edges.
/// Zero where the triangle has no area.
Eigen::Matrix3d axes(std::span<const Vec3> p, const Triangle& t, int corner) {
  const Vec3 first = p[t[(corner + 1) % 3]] - p[t[corner]], second = p[t[(corner + 2) % 3]] - p[t[corner]];
  const Vec3 normal = first.cross(second);
  if (!(normal.norm() > 0)) return Eigen::Matrix3d::Zero();
  Eigen::Matrix3d result;
  result.col(2) = normal.normalized();
  // The bisector turns evenly between both edges, whatever their lengths.
  result.col(0) = (first.normalized() + second.normalized()).normalized();
  result.col(1) = result.col(2).cross(result.col(0));
  return result;
}

double angle(std::span<const Vec3> p, const Triangle& t, int corner) {
  const Vec3 first = p[t[(corner + 1) % 3]] - p[t[corner]], second = p[t[(corner + 2) % 3]] - p[t[corner]];
  return std::atan2(first.cross(second).norm(), first.dot(second));
}

/// Per vertex the sum over the triangles around it.
std::vector<Eigen::Matrix3d> summed(const std::vector<Triangle>& triangles,
                                    const std::vector<Eigen::Matrix3d>& moments) {
  std::vector<Eigen::Matrix3d> sums(moments.size(), Eigen::Matrix3d::Zero());
  for (const Triangle& t : triangles) {
    const Eigen::Matrix3d sum = moments[t[0]] + moments[t[1]] + moments[t[2]];
    for (const int v : t) sums[v] += sum;
  }
  return sums;
}

}  // namespace

std::vector<Vec3> turn_normals(const TriangleMesh& before, std::span<const Vec3> normals, std::span<const Vec3> after) {
  const std::size_t count = normals.size();
  std::vector<char> has_moved(count, 0);
  std::vector<Eigen::Matrix3d> moments(count, Eigen::Matrix3d::Zero());
  for (const Triangle& t : before.triangles) {
    const bool is_same = before.positions[t[0]] == after[t[0]] && before.positions[t[1]] == after[t[1]] &&
                         before.positions[t[2]] == after[t[2]];
    for (int corner = 0; corner < 3; ++corner) {
      has_moved[t[corner]] = has_moved[t[corner]] || !is_same;
      moments[t[corner]] += std::sqrt(angle(before.positions, t, corner) * angle(after, t, corner)) *
                            axes(after, t, corner) * axes(before.positions, t, corner).transpose();
    }
  }
  for (int ring = 0; ring < kRings; ++ring) moments = summed(before.triangles, moments);
  std::vector<Vec3> turned(normals.begin(), normals.end());
  for_each_index(count, kBlock, [&](std::size_t v) {
    if (has_moved[v]) turned[v] = (best_rotation(moments[v]) * normals[v]).normalized();
  });
  return turned;
}

}  // namespace skeletex
