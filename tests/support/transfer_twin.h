// SPDX-License-Identifier: MIT
#pragma once
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>

#include "skeletex/edit/transfer/place_part.h"

namespace skeletex::twin {

inline double faded(double rows, double width, bool is_linear) {
  if (rows <= 0) return 1;
  if (!(rows < width)) return 0;
  return is_linear ? 1 - rows / width : std::pow(std::cos(std::numbers::pi / 2 * rows / width), 2);
}

/// Kernel read_source, one point.
/// \param source  points by vertex
/// \param at  receives the source's column
inline Vec3 read(const TransferPatch& patch, const TransferRow& row, const TransferColumn& column,
                 const std::function<Vec3(int)>& source, double& at) {
  const double lifted = column.head_column + row.axial * (column.tail_column - column.head_column);
  at = lifted - patch.width * std::floor(lifted / patch.width);
  double from = std::clamp<double>(column.row_begin + column.row_step * double(row.row), 0.0, patch.height - 1.0);
  if (patch.sign < 0) from = patch.height - 1 - from;
  const int left = int(at) % patch.width, right = (left + 1) % patch.width,
            below = std::min(int(from), patch.height - 2);
  const double x = at - std::floor(at), y = from - below;
  const auto point = [&](int i, int k) { return source(patch.begin + i * patch.width + k); };
  return (1 - y) * ((1 - x) * point(below, left) + x * point(below, right)) +
         y * ((1 - x) * point(below + 1, left) + x * point(below + 1, right));
}

/// Kernel place_part, one point.
/// \param source, target  points by vertex
inline Vec3 place(const TransferPatch& patch, const TransferRow& row, const TransferColumn& column, int j,
                  const std::function<Vec3(int)>& source, const std::function<Vec3(int)>& target,
                  const std::function<double(int, int, bool, int)>& correction) {
  double at = 0;
  Vec3 p = read(patch, row, column, source, at);

  // Polar: the angle counts from the source's and goes on from the own one, the other way round where the bone is
  // reversed.
  const double own = 2 * std::numbers::pi * j / row.width, read = 2 * std::numbers::pi * at / patch.width;
  const double distance = std::hypot(p.x(), p.y()), angle = own + patch.sign * (std::atan2(p.y(), p.x()) - read);
  double along = patch.sign < 0 ? patch.source_length - p.z() : p.z();
  along = patch.length_offset + patch.length_scale * along +
          ((1 - row.axial) * column.head_shear + row.axial * column.tail_shear) * distance * std::cos(angle - own);
  p = Vec3(row.scale * distance * std::cos(angle), row.scale * distance * std::sin(angle), along);
  p += (patch.lean_end - along) * Vec3(patch.lean_s, patch.lean_b, 0);

  const double rows[2] = {std::max(0.0, row.row - double(column.first_row)),
                          std::max(0.0, double(column.last_row) - row.row)};
  const double widths[2] = {patch.head_width, patch.tail_width};
  if (patch.target_begin >= 0) {
    const double kept =
        std::min(1.0, faded(rows[0], widths[0], patch.is_linear) + faded(rows[1], widths[1], patch.is_linear));
    return (1 - kept) * p + kept * target(patch.target_begin + row.row * row.width + j);
  }
  for (const int end : {0, 1})
    for (int band = 0; band < SKELETEX_TRANSFER_BANDS; ++band)
      for (int axis = 0; axis < 3; ++axis)
        p[axis] += faded(rows[end], widths[end] * std::pow(0.7, band), patch.is_linear) *
                   (correction(end, band, false, axis) + rows[end] * correction(end, band, true, axis));
  return p;
}

}  // namespace skeletex::twin
