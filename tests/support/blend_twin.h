// SPDX-License-Identifier: MIT
#pragma once
#include <cmath>
#include <span>

#include "blend_structs.h"
#include "skeletex/geometry/mesh.h"

namespace skeletex::twin {

/// One source of kernel blend_texels at one place.
struct BlendRead {
  BlendSource source;
  BlendSourceRow row;
  double column;     ///< any lift
  double slope = 0;  ///< of the result's frame there
  double rise = 0;   ///< what is added to the slope of the source's frame
  double axial = 0;
};

/// Kernel blend_texels, one texel: the weighted sum over its sources.
inline Vec3 blend(std::span<const BlendRead> reads, const std::vector<float>& slopes, const std::vector<float>& along,
                  const std::vector<float>& around, const std::vector<float>& out) {
  Vec3 sum = Vec3::Zero();
  for (const BlendRead& read : reads) {
    const double column = read.column - read.source.width * std::floor(read.column / read.source.width);
    const int left = static_cast<int>(column) % read.source.width, right = (left + 1) % read.source.width;
    const int below = std::min(static_cast<int>(read.row.row), read.source.height - 2);
    const double x = column - std::floor(column), y = double(read.row.row) - below;
    const auto texel = [&](int row, int j) {
      const int at = read.source.begin + row * read.source.stride + j;
      return Vec3(read.source.sign * along[at], read.source.sign * around[at], out[at]);
    };
    const Vec3 value = (1 - y) * ((1 - x) * texel(below, left) + x * texel(below, right)) +
                       y * ((1 - x) * texel(below + 1, left) + x * texel(below + 1, right));
    double angle = 0;
    if (read.source.slope_begin >= 0) {
      const auto own = [&](int end) {
        const std::size_t first = 2 * read.source.slope_begin + end;
        return (1 - x) * slopes[first + 2 * left] + x * slopes[first + 2 * right];
      };
      angle = std::atan((1 - read.axial) * own(0) + read.axial * own(1) + read.rise) - std::atan(read.slope);
    }
    sum += double(read.row.weight) * Vec3(std::cos(angle) * value[0] + std::sin(angle) * value[2], value[1],
                                          std::cos(angle) * value[2] - std::sin(angle) * value[0]);
  }
  return sum;
}

}  // namespace skeletex::twin
