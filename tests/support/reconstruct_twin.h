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
inline DisplacedPoint displace(const PatchRecord& patch, const RowRecord& row, const ColumnRecord& column, const Vec3& texel) {
  const auto vector = [](const float (&v)[3]) { return Vec3(v[0], v[1], v[2]); };
  const Vec3 o = vector(patch.axis), head = vector(patch.head), tail = head + patch.length * o;
  const Vec3 spoke = double(column.cosine) * vector(patch.s) + double(column.sine) * vector(patch.b);
  const double k = (1 - double(row.station)) * column.slope_head + double(row.station) * column.slope_tail;
  TangentFrame frame;
  frame.out = (double(row.cap_cos) * (spoke + k * o) + double(row.cap_sin) * o).normalized();
  frame.around = o.cross(spoke).normalized();
  frame.along = frame.out.cross(frame.around);
  frame.foot = head + double(row.station) * patch.length * o;
  const Vec3 point = decode_texel(frame, texel, head, tail);
  return {point, (point - frame.foot).norm(), texel.norm()};
}

/// Kernel triangulate_quads, one quad.
inline std::array<Triangle, 2> split_quad(const std::vector<Vec3>& p, int v00, int v01, int v10, int v11) {
  if ((p[v10] - p[v01]).squaredNorm() < 0.99999 * (p[v11] - p[v00]).squaredNorm()) return {Triangle{v00, v01, v10}, Triangle{v10, v01, v11}};
  return {Triangle{v00, v01, v11}, Triangle{v00, v11, v10}};
}

/// Kernels filter_rows and filter_columns, one new sample of one plane: `stride` between old samples.
inline double filter(const std::array<int, 4>& tap, const std::vector<float>& weights, const std::vector<float>& in, int first, int stride, int count) {
  double sum = 0;
  for (int i = 0; i < tap[1]; ++i) sum += double(weights[tap[2] + i]) * in[first + (tap[0] + i) % count * stride];
  return sum;
}

/// Kernel enter_tangent_space, one texel; the point in the bone's own axes.
inline Vec3 enter_tangent_space(const PatchRecord& patch, const RowRecord& row, const ColumnRecord& column, const Vec3& point) {
  const Vec3 o(0, 0, 1), spoke(column.cosine, column.sine, 0), tail(0, 0, patch.length);
  const double k = (1 - double(row.station)) * column.slope_head + double(row.station) * column.slope_tail;
  TangentFrame frame;
  frame.out = (double(row.cap_cos) * (spoke + k * o) + double(row.cap_sin) * o).normalized();
  frame.around = o.cross(spoke).normalized();
  frame.along = frame.out.cross(frame.around);
  frame.foot = double(row.station) * tail;
  return encode_texel(frame, point, Vec3::Zero(), tail);
}

}  // namespace skeletex::twin
