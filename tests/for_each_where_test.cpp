// SPDX-License-Identifier: MIT
#include "skeletex/geometry/for_each_where.h"

#include <gtest/gtest.h>

#include <random>
#include <vector>

namespace skeletex {
namespace {

TEST(ForEachWhere, CallsForAllThatHoldInOrderWhateverTheirNumber) {
  std::mt19937 random(1);
  for (const std::size_t size : {0, 1, 31, 32, 33, 64, 95, 1000})
    for (const double share : {0.0, 0.01, 0.5, 1.0}) {
      std::bernoulli_distribution holds(share);
      std::vector<float> values(size);
      std::vector<std::size_t> expected, got;
      for (std::size_t i = 0; i < size; ++i) {
        values[i] = holds(random) ? 1.5f : 1;
        if (values[i] > 1) expected.push_back(i);
      }
      for_each_where(
          std::span<const float>(values), [](float value) { return value > 1; },
          [&](std::size_t i) { got.push_back(i); });
      EXPECT_EQ(got, expected) << size << " values, " << share;
    }
}

TEST(ForEachWhere, FindsALastOneByItself) {
  for (const std::size_t size : {1, 32, 33, 100}) {
    std::vector<int> values(size, 0);
    values.back() = 1;
    std::vector<std::size_t> got;
    for_each_where(
        std::span<const int>(values), [](int value) { return value != 0; }, [&](std::size_t i) { got.push_back(i); });
    EXPECT_EQ(got, std::vector{size - 1});
  }
}

}  // namespace
}  // namespace skeletex
