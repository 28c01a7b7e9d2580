// SPDX-License-Identifier: MIT
#pragma once
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "skeletex/geometry/mesh.h"

/// kernels/unfold.cl for one patch that fills its texture, over a flat surface with the normal z, in double.
namespace skeletex::twin {

struct Folds {
  std::vector<int> marks;
  int count = 0;
  bool is_close = false;  ///< a triangle is as good as on the threshold: rounding decides
};

inline Folds find_folds(const std::vector<Vec3>& points, int width, int height) {
  const auto at = [&](int column, int row) { return static_cast<std::size_t>(row) * width + (column + width) % width; };
  Folds folds{std::vector<int>(points.size(), 0), 0, false};
  for (int row = 0; row + 1 < height; ++row)
    for (int column = 0; column < width; ++column) {
      const std::array<Vec3, 4> q{points[at(column, row)], points[at(column + 1, row)], points[at(column + 1, row + 1)],
                                  points[at(column, row + 1)]};
      const auto is_turned = [&](int a, int b, int c) {
        const Vec3 n = (q[b] - q[a]).cross(q[c] - q[a]);
        const double beyond = n.z() - 0.1 * n.norm();
        folds.is_close |= std::abs(beyond) < 1e-5 * (q[b] - q[a]).norm() * (q[c] - q[a]).norm();
        return beyond < 0;
      };
      if (!(is_turned(0, 1, 2) | is_turned(0, 2, 3)) || !(is_turned(0, 1, 3) | is_turned(1, 2, 3))) continue;
      ++folds.count;
      for (int i = -1; i <= 2; ++i)
        for (int j = -1; j <= 2; ++j)
          if (row + i >= 1 && row + i <= height - 2) folds.marks[at(column + j, row + i)] = 1;
    }
  return folds;
}

/// The new offset of a texel from its neighbours' points.
inline Eigen::Vector2d relaxed(const std::vector<Vec3>& points, int width, int height, int column, int row,
                               const Eigen::Vector2d& offset) {
  const auto at = [&](int j, int r) { return points[static_cast<std::size_t>(r) * width + (j + width) % width]; };
  const Vec3 left = at(column - 1, row), right = at(column + 1, row), below = at(column, row - 1),
             above = at(column, row + 1);
  Eigen::Matrix<double, 3, 2> directions;
  directions << (right - left) / 2, (above - below) / 2;
  const Eigen::Matrix2d squares = directions.transpose() * directions;
  const Eigen::Matrix2d damped = squares + 0.01 * squares.trace() * Eigen::Matrix2d::Identity();
  const Eigen::Vector2d step =
      (damped.inverse() * directions.transpose() * ((left + right + below + above) / 4 - at(column, row)))
          .cwiseMax(-0.4)
          .cwiseMin(0.4);
  Eigen::Vector2d moved = (offset + step).cwiseMax(-1).cwiseMin(1);
  moved.y() = std::clamp(row + moved.y(), 0.3, height - 1 - 0.3) - row;
  return moved;
}

}  // namespace skeletex::twin
