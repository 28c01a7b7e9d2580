// SPDX-License-Identifier: MIT
#pragma once
#include <cmath>

#include "skeletex/model/mesh_attributes.h"

namespace skeletex {

/// The picture's colour at a place, between pixels, in the bytes of its sRGB.
inline Vec3 picture_at(const ColourImage& image, const Eigen::Vector2f& uv) {
  const double x = static_cast<double>(uv.x()) * image.width - 0.5,
               y = (1 - static_cast<double>(uv.y())) * image.height - 0.5;
  const int column = static_cast<int>(std::floor(x)), row = static_cast<int>(std::floor(y));
  Vec3 sum = Vec3::Zero();
  for (int i = 0; i < 2; ++i)
    for (int j = 0; j < 2; ++j) {
      const double weight = (i == 0 ? 1 - (y - row) : y - row) * (j == 0 ? 1 - (x - column) : x - column);
      const std::uint8_t* const p =
          image.rgba.data() + 4 * (static_cast<std::size_t>(row + i) * image.width + (column + j));
      for (int k = 0; k < 3; ++k) sum[k] += weight * static_cast<double>(linear_from_srgb(p[k] / 255.f));
    }
  return sum;
}

}  // namespace skeletex
