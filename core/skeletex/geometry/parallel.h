// SPDX-License-Identifier: MIT
#pragma once
#include <algorithm>
#include <atomic>
#include <cstddef>
#include <exception>
#include <mutex>
#include <thread>
#include <utility>
#include <vector>

namespace skeletex {

/// Processors of the machine. Counted once, as the system library opens a file for every answer.
inline std::size_t processor_count() {
  static const std::size_t count = std::max(1u, std::thread::hardware_concurrency());
  return count;
}

/// Calls act(block, begin, end) for consecutive blocks of [0, size) on all processors. Blocks depend on the sizes
/// alone, so results kept per block and combined in their order are the same whatever the number of threads.
/// The first exception that a block throws is thrown again here.
template <class Act>
void for_each_block(std::size_t size, std::size_t block_size, const Act& act) {
  const std::size_t blocks = (size + block_size - 1) / block_size;
  const std::size_t threads = std::min(blocks, processor_count());
  std::atomic<std::size_t> next{0};
  std::exception_ptr failure;
  std::mutex failure_mutex;
  const auto work = [&] {
    try {
      for (std::size_t block = next++; block < blocks; block = next++)
        act(block, block * block_size, std::min(size, (block + 1) * block_size));
    } catch (...) {
      const std::lock_guard lock(failure_mutex);
      if (!failure) failure = std::current_exception();
      next = blocks;
    }
  };
  std::vector<std::jthread> others;
  for (std::size_t i = 1; i < threads; ++i) others.emplace_back(work);
  work();
  others.clear();
  if (failure) std::rethrow_exception(failure);
}

/// Calls act(i) for every i of [0, size) on all processors, each of which takes so many at a time. Exceptions are those
/// of for_each_block.
template <class Act>
void for_each_index(std::size_t size, std::size_t block_size, const Act& act) {
  for_each_block(size, block_size, [&](std::size_t, std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) act(i);
  });
}
/// One at a time.
template <class Act>
void for_each_index(std::size_t size, const Act& act) {
  for_each_index(size, 1, act);
}

/// Number of blocks that for_each_block makes.
inline std::size_t block_count(std::size_t size, std::size_t block_size) {
  return (size + block_size - 1) / block_size;
}

}  // namespace skeletex
