// SPDX-License-Identifier: MIT
#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numbers>
#include <random>

#include "skeletex/math/portable.h"

namespace skeletex {
namespace {

/// The error in units in the last place of the true value.
double ulps(double found, long double exact) {
  const double near = std::abs(static_cast<double>(exact));
  const double unit = std::nextafter(near, std::numeric_limits<double>::infinity()) - near;
  return static_cast<double>(std::abs(found - exact) / unit);
}

TEST(PortableMath, StaysWithinItsBounds) {
  std::mt19937 random(1);
  std::uniform_real_distribution<double> angle(-20, 20), size(-1, 1), exponent(-3, 3);
  for (int i = 0; i < 200000; ++i) {
    const double a = angle(random), x = std::ldexp(size(random), i % 40 - 20), y = size(random), e = exponent(random);
    const double positive = std::abs(x) + 1e-12;
    EXPECT_LE(ulps(portable::sin(a), std::sin(static_cast<long double>(a))), 3.5) << a;
    EXPECT_LE(ulps(portable::cos(a), std::cos(static_cast<long double>(a))), 3.5) << a;
    EXPECT_LE(ulps(portable::atan2(y, x), std::atan2(static_cast<long double>(y), static_cast<long double>(x))), 3.5)
        << y << ' ' << x;
    EXPECT_LE(ulps(portable::log(positive), std::log(static_cast<long double>(positive))), 3.5) << positive;
    EXPECT_LE(ulps(portable::exp(a), std::exp(static_cast<long double>(a))), 1) << a;
    EXPECT_LE(
        ulps(portable::pow(positive, e), std::pow(static_cast<long double>(positive), static_cast<long double>(e))), 1)
        << positive << ' ' << e;
    if (HasFailure()) return;
  }
}

TEST(PortableMath, IsExactWhereTheValueIsANumber) {
  EXPECT_EQ(portable::sin(0), 0);
  EXPECT_EQ(portable::cos(0), 1);
  EXPECT_EQ(portable::atan2(0, 0), 0);
  EXPECT_EQ(portable::atan2(0, 2), 0);
  EXPECT_EQ(portable::atan2(0, -2), std::numbers::pi);
  EXPECT_EQ(portable::atan2(3, 0), std::numbers::pi / 2);
  EXPECT_EQ(portable::atan2(-3, 0), -std::numbers::pi / 2);
  EXPECT_EQ(portable::log(1), 0);
  EXPECT_EQ(portable::log(0), -std::numeric_limits<double>::infinity());
  EXPECT_EQ(portable::exp(0), 1);
  EXPECT_EQ(portable::pow(0, 2), 0);
  EXPECT_EQ(portable::pow(3, 4), 81);
}

/// The bits themselves: other ones on any processor break the promise.
TEST(PortableMath, IsTheSameBitsEverywhere) {
  std::uint64_t bits = 0;
  for (int i = 1; i <= 100000; ++i) {
    const double x = i * 0.0003;
    for (const double y : {portable::sin(x), portable::cos(x), portable::atan2(x - 15, 4.0), portable::log(x),
                           portable::exp(-x), portable::pow(x, 0.8)})
      bits = bits * 6364136223846793005U + std::bit_cast<std::uint64_t>(y);
  }
  EXPECT_EQ(bits, 10504981985280383742U);
}

}  // namespace
}  // namespace skeletex
