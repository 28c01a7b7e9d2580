// SPDX-License-Identifier: MIT
#pragma once
#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "skeletex/geometry/mesh.h"

namespace skeletex::twin {

/// The corners of a quad's triangle as (right, up), by the quad's diagonal: the order of the kernels of fit.cl.
inline std::array<std::array<int, 2>, 3> triangle_corners(bool is_second, int triangle) {
  constexpr std::array<int, 2> k0{0, 0}, k1{1, 0}, k2{1, 1}, k3{0, 1};
  if (is_second) return triangle == 0 ? std::array{k0, k1, k3} : std::array{k1, k2, k3};
  return triangle == 0 ? std::array{k0, k1, k2} : std::array{k0, k2, k3};
}

/// Distance from a point to a triangle: the nearest of its plane's foot, if inside, and of its three sides.
inline double distance_to_triangle(const Vec3& p, const Vec3& a, const Vec3& b, const Vec3& c) {
  const auto to_side = [&](const Vec3& from, const Vec3& to) {
    const Vec3 side = to - from;
    const double t = side.squaredNorm() > 0 ? std::clamp((p - from).dot(side) / side.squaredNorm(), 0.0, 1.0) : 0;
    return (from + t * side - p).norm();
  };
  double best = std::min({to_side(a, b), to_side(b, c), to_side(c, a)});
  const Vec3 n = (b - a).cross(c - a);
  if (n.squaredNorm() > 0) {
    const Vec3 foot = p - (p - a).dot(n) / n.squaredNorm() * n;
    const auto is_left = [&](const Vec3& from, const Vec3& to) { return (to - from).cross(foot - from).dot(n) >= 0; };
    if (is_left(a, b) && is_left(b, c) && is_left(c, a)) best = std::min(best, (foot - p).norm());
  }
  return best;
}

/// `point(column, row)` gives the lattice.
template <class Points>
double nearest_in_quad(const Points& point, int column, int row, bool is_second, const Vec3& p) {
  double best = std::numeric_limits<double>::infinity();
  for (const int t : {0, 1}) {
    const auto c = triangle_corners(is_second, t);
    best = std::min(
        best, distance_to_triangle(p, point(column + c[0][0], row + c[0][1]), point(column + c[1][0], row + c[1][1]),
                                   point(column + c[2][0], row + c[2][1])));
  }
  return best;
}

/// The least-squares system of one patch, dense: unknown 3 (row width + column) + axis. Rows 0 and height-1 do not
/// move.
class FitSystem {
 public:
  FitSystem(int width, int height)
      : width_(width),
        height_(height),
        matrix_(Eigen::MatrixXd::Zero(3 * width * height, 3 * width * height)),
        side_(Eigen::VectorXd::Zero(3 * width * height)) {}

  /// area / (|residual| + least) x (residual + normal . weighted moves)^2
  void add(const Vec3& normal, double residual, double area, double least, int column, int row,
           const std::array<std::array<int, 2>, 3>& corners, const std::array<double, 3>& weights) {
    Eigen::VectorXd line = Eigen::VectorXd::Zero(side_.size());
    for (int k = 0; k < 3; ++k)
      line.segment<3>(first(column + corners[k][0], row + corners[k][1])) += weights[k] * normal;
    const double weight = area / (std::abs(residual) + least);
    matrix_ += weight * line * line.transpose();
    side_ -= weight * residual * line;
  }

  Eigen::VectorXd solve(double damping, double springs) const {
    const auto entry = [&](int j, int row) {
      if (row < 1 || row > height_ - 2) return 0.0;
      return matrix_.block<3, 3>(first(j, row), first(j, row)).trace() / 3;
    };
    Eigen::MatrixXd full = matrix_;
    for (int row = 1; row + 1 < height_; ++row)
      for (int j = 0; j < width_; ++j) {
        const auto own = Eigen::seqN(first(j, row), 3);
        full(own, own) += damping * entry(j, row) * Eigen::Matrix3d::Identity();
        for (const auto& [dx, dy] : {std::array{1, 0}, std::array{-1, 0}, std::array{0, 1}, std::array{0, -1}}) {
          const double spring = 0.5 * springs * (entry(j, row) + entry(j + dx, row + dy));
          full(own, own) += spring * Eigen::Matrix3d::Identity();
          full(own, Eigen::seqN(first(j + dx, row + dy), 3)) -= spring * Eigen::Matrix3d::Identity();
        }
      }
    const int inner = 3 * width_ * (height_ - 2), begin = 3 * width_;
    Eigen::VectorXd result = Eigen::VectorXd::Zero(side_.size());
    result.segment(begin, inner) = full.block(begin, begin, inner, inner).ldlt().solve(side_.segment(begin, inner));
    return result;
  }

 private:
  int first(int column, int row) const { return 3 * (row * width_ + (column % width_ + width_) % width_); }
  int width_, height_;
  Eigen::MatrixXd matrix_;
  Eigen::VectorXd side_;
};

}  // namespace skeletex::twin
