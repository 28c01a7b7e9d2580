// SPDX-License-Identifier: MIT
#pragma once
#include <Eigen/Geometry>
#include <array>
#include <cmath>
#include <vector>

#include "skeletex/model/frame.h"

namespace skeletex::twin {

struct DisplacedPoint {
  Vec3 point;
  double reach = 0;  ///< distance from the foot
  double size = 0;   ///< length of the texel
};

/// Kernel displace, one texel: the frame spelt out as vectors, the capsule as cylinder and spheres (paper appendix A).
inline DisplacedPoint displace(const PatchRecord& patch, const RowRecord& row, const ColumnRecord& column,
                               const Vec3& texel) {
  const auto vector = [](const float(&v)[3]) { return Vec3(v[0], v[1], v[2]); };
  const Vec3 o = vector(patch.axis), head = vector(patch.head), tail = head + patch.length * o;
  const Vec3 radial = double(column.cosine) * vector(patch.s) + double(column.sine) * vector(patch.b);
  const double k = (1 - double(row.axial)) * column.slope_head + double(row.axial) * column.slope_tail;
  TangentFrame frame;
  frame.out = (double(row.cap_cos) * (radial + k * o) + double(row.cap_sin) * o).normalized();
  frame.around = o.cross(radial).normalized();
  frame.along = frame.out.cross(frame.around);
  frame.foot = head + double(row.axial) * patch.length * o;
  const Vec3 point = decode_texel(frame, texel, head, tail);
  return {point, (point - frame.foot).norm(), texel.norm()};
}

/// Kernel triangulate by the nearer diagonal, one quad of a patch: whether its diagonal from (row, column + 1) to
/// (row + 1, column) is taken. `vertex(row, column)` gives the points of inner rows; `is_clear` says whether single
/// precision can tell.
template <class Vertices>
bool takes_second_diagonal(const Vertices& vertex, int row, int column, int height, bool& is_clear) {
  const auto point = [&](int r, int j) -> Vec3 {
    if (r < 1) return 2 * vertex(1, j) - vertex(2, j);
    if (r > height - 2) return 2 * vertex(height - 2, j) - vertex(height - 3, j);
    return vertex(r, j);
  };
  Vec3 centre = Vec3::Zero();
  const double weights[4] = {-1.0 / 16, 9.0 / 16, 9.0 / 16, -1.0 / 16};
  for (int i = 0; i < 4; ++i)
    for (int k = 0; k < 4; ++k) centre += weights[i] * weights[k] * point(row - 1 + i, column - 1 + k);
  const Vec3 a = point(row, column), b = point(row, column + 1), c = point(row + 1, column),
             d = point(row + 1, column + 1);
  const Vec3 normal = (d - a).cross(c - b).normalized();
  const double blur = 3e-7 * centre.lpNorm<1>() + 1e-4 * (d - a).norm();
  const double first = (std::abs((0.5 * (a + d) - centre).dot(normal)) + 0.9 * blur) * (d - a).squaredNorm();
  const double second = (std::abs((0.5 * (b + c) - centre).dot(normal)) + blur) * (c - b).squaredNorm();
  is_clear = std::abs(second - first) > 2 * blur * std::max((d - a).squaredNorm(), (c - b).squaredNorm());
  return second < first;
}

/// The same by the smoother diagonal.
template <class Vertices>
bool takes_smoother_diagonal(const Vertices& vertex, int row, int column, int height, bool& is_clear) {
  // A quad's two triangles by its diagonal: each holds two of the sides 0 (below), 1 (right), 2 (above), 3 (left).
  const auto normal_at = [&](int r, int j, int diagonal, int side) {
    const Vec3 q[4] = {vertex(r, j), vertex(r, j + 1), vertex(r + 1, j + 1), vertex(r + 1, j)};
    const int begin = side, end = (side + 1) % 4;
    // The apex: of the other two corners the one on the diagonal.
    const int apex = (end + 1) % 4 % 2 == diagonal ? (end + 1) % 4 : (end + 2) % 4;
    return Vec3((q[end] - q[begin]).cross(q[apex] - q[begin]).normalized());
  };
  const int neighbours[4][2] = {{row - 1, column}, {row, column + 1}, {row + 1, column}, {row, column - 1}};
  double costs[2];
  for (const int diagonal : {0, 1}) {
    costs[diagonal] = normal_at(row, column, diagonal, 0).dot(normal_at(row, column, diagonal, 2)) < 0 ? 9 : 0;
    for (int side = 0; side < 4; ++side) {
      const auto [r, j] = neighbours[side];
      if (r < 1 || r > height - 3) continue;
      const Vec3 own = normal_at(row, column, diagonal, side);
      const Vec3 first = normal_at(r, j, 0, (side + 2) % 4), second = normal_at(r, j, 1, (side + 2) % 4);
      costs[diagonal] += std::min((own - first).norm(), (own - second).norm());
    }
  }
  const double blur =
      1e-6 * vertex(row, column).template lpNorm<1>() / (vertex(row + 1, column + 1) - vertex(row, column)).norm();
  const double margin = 10 * blur + 1e-5;
  const bool is_nearer = takes_second_diagonal(vertex, row, column, height, is_clear);
  const bool is_second = costs[1] < 0.8 * costs[0], is_first = costs[0] < 0.8 * costs[1];
  is_clear = std::abs(costs[1] - 0.8 * costs[0]) > margin && std::abs(costs[0] - 0.8 * costs[1]) > margin &&
             (is_second || is_first || is_clear);
  return is_second || (!is_first && is_nearer);
}

/// Kernels filter_rows and filter_columns, one new sample of one plane: `stride` between old samples.
inline double filter(const std::array<int, 4>& tap, const std::vector<float>& weights, const std::vector<float>& in,
                     int first, int stride, int count) {
  double sum = 0;
  for (int i = 0; i < tap[1]; ++i) sum += double(weights[tap[2] + i]) * in[first + (tap[0] + i) % count * stride];
  return sum;
}

/// Kernel limit_fit, one point: `edges` are the sampled lattice's edges from there to before, after, left and right.
inline Vec3 limit_fit(const Vec3& sampled, const Vec3& fitted, const std::array<Vec3, 4>& edges, double share) {
  const double most =
      share * std::max(std::min(edges[0].norm(), edges[1].norm()), std::min(edges[2].norm(), edges[3].norm()));
  const Vec3 move = fitted - sampled;
  return move.norm() > most ? Vec3(sampled + most / move.norm() * move) : fitted;
}

/// Kernel enter_tangent_space, one texel; the point in the bone's own axes.
inline Vec3 enter_tangent_space(const PatchRecord& patch, const RowRecord& row, const ColumnRecord& column,
                                const Vec3& point) {
  const Vec3 o(0, 0, 1), radial(column.cosine, column.sine, 0), tail(0, 0, patch.length);
  const double k = (1 - double(row.axial)) * column.slope_head + double(row.axial) * column.slope_tail;
  TangentFrame frame;
  frame.out = (double(row.cap_cos) * (radial + k * o) + double(row.cap_sin) * o).normalized();
  frame.around = o.cross(radial).normalized();
  frame.along = frame.out.cross(frame.around);
  frame.foot = double(row.axial) * tail;
  return encode_texel(frame, point, Vec3::Zero(), tail);
}

}  // namespace skeletex::twin
