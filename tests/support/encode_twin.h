// SPDX-License-Identifier: MIT
// Plain versions of kernels/encode.cl, in double precision.
#pragma once
#include <Eigen/Geometry>
#include <cmath>
#include <vector>

#include "skeletex/convert/parameterize/chart.h"
#include "skeletex/model/frame.h"

namespace skeletex::twin {

/// cover_texels and read_surface: the surface point that a map puts at (u, turn), by trying every triangle and lift.
inline Vec3 surface_point(const Chart& chart, double u, double turn) {
  double best = -1e300;
  Vec3 point = Vec3::Zero();
  for (std::size_t t = 0; t < chart.triangles.size(); ++t) {
    std::array<double, 3> cu, cv;
    std::array<Vec3, 3> p;
    int pole = -1;
    for (int k = 0; k < 3; ++k) {
      const int vertex = chart.triangles[t][k];
      cu[k] = chart.u[vertex], cv[k] = chart.v[vertex] + chart.turns[t][k], p[k] = chart.positions[vertex];
      if (chart.kinds[vertex] == ChartVertex::kHeadPole || chart.kinds[vertex] == ChartVertex::kTailPole) pole = k;
    }
    for (int lift = -2; lift <= 2; ++lift) {
      const double v = turn + lift;
      double inside;
      Vec3 candidate;
      if (pole < 0) {
        const double d = (cu[1] - cu[0]) * (cv[2] - cv[0]) - (cu[2] - cu[0]) * (cv[1] - cv[0]);
        const double w1 = ((u - cu[0]) * (cv[2] - cv[0]) - (cu[2] - cu[0]) * (v - cv[0])) / d;
        const double w2 = ((cu[1] - cu[0]) * (v - cv[0]) - (u - cu[0]) * (cv[1] - cv[0])) / d;
        inside = std::min({w1, w2, 1 - w1 - w2});
        candidate = (1 - w1 - w2) * p[0] + w1 * p[1] + w2 * p[2];
      } else {
        const int a = (pole + 1) % 3, b = (pole + 2) % 3;
        const double lambda = (v - cv[a]) / (cv[b] - cv[a]);
        const double edge = cu[a] + lambda * (cu[b] - cu[a]);
        const double tau = (u - edge) / (cu[pole] - edge);
        inside = std::min({lambda, 1 - lambda, tau, 1 - tau});
        candidate = (1 - tau) * ((1 - lambda) * p[a] + lambda * p[b]) + tau * p[pole];
      }
      if (inside > best) best = inside, point = candidate;
    }
  }
  return point;
}

/// prefilter_positions on one patch of rows x columns points.
inline std::vector<Vec3> prefiltered(const std::vector<Vec3>& points, int rows, int columns) {
  std::vector<Vec3> result = points;
  for (int r = 1; r + 1 < rows; ++r)
    for (int j = 0; j < columns; ++j) {
      const Vec3& p = points[r * columns + j];
      const Vec3 &above = points[(r + 1) * columns + j], &below = points[(r - 1) * columns + j];
      const Vec3 &right = points[r * columns + (j + 1) % columns],
                 &left = points[r * columns + (j + columns - 1) % columns];
      const Vec3 normal = (right - left).cross(above - below);
      if (normal.squaredNorm() > 0)
        result[r * columns + j] -=
            normal * normal.dot(above + below + right + left - 4 * p) / normal.squaredNorm() / 16;
    }
  return result;
}

}  // namespace skeletex::twin
