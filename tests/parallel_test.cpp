// SPDX-License-Identifier: MIT
#include "skeletex/geometry/parallel.h"

#include <gtest/gtest.h>

#include <chrono>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

namespace skeletex {
namespace {

TEST(ForEachBlock, HasEveryIndexOnce) {
  for (const std::size_t size : {0, 1, 7, 64, 1000})
    for (const std::size_t block_size : {1, 7, 64, 2000}) {
      std::vector<int> counts(size, 0), blocks(block_count(size, block_size), 0);
      for_each_block(size, block_size, [&](std::size_t block, std::size_t begin, std::size_t end) {
        EXPECT_EQ(begin, block * block_size);
        ++blocks[block];
        for (std::size_t i = begin; i < end; ++i) ++counts[i];
      });
      for_each_index(size, block_size, [&](std::size_t i) { ++counts[i]; });
      EXPECT_EQ(counts, std::vector<int>(size, 2));
      EXPECT_EQ(blocks, std::vector<int>(block_count(size, block_size), 1));
    }
}

TEST(ForEachBlock, ThrowsWhatABlockThrows) {
  try {
    for_each_block(100, 1, [](std::size_t block, std::size_t, std::size_t) {
      if (block == 40) throw std::runtime_error("block 40");
    });
    FAIL() << "nothing thrown";
  } catch (const std::runtime_error& error) {
    EXPECT_EQ(error.what(), std::string("block 40"));
  }
}

}  // namespace
}  // namespace skeletex
