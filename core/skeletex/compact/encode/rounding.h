// SPDX-License-Identifier: MIT
#pragma once
#include <cmath>

namespace skeletex {

inline int rounded(double x) { return static_cast<int>(std::lround(x)); }
/// \param rounding  0.5 rounds to the nearest; less leaves more numbers at the smaller magnitude, which takes fewer
/// bits
inline int rounded_towards_zero(double x, double rounding) {
  const int magnitude = static_cast<int>(std::floor(std::abs(x) + rounding));
  return x < 0 ? -magnitude : magnitude;
}

}  // namespace skeletex
