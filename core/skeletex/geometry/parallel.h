// SPDX-License-Identifier: MIT
#pragma once
#include <algorithm>
#include <atomic>
#include <cstddef>
#include <exception>
#include <future>
#include <mutex>
#include <thread>
#include <utility>
#include <vector>
#ifdef __linux__
#include <sched.h>
#endif

namespace skeletex {

/// The one that the calling thread is on now; -1: not known.
inline int current_processor() {
#ifdef __linux__
  return sched_getcpu();
#else
  return -1;
#endif
}

/// Has the calling thread go on on another processor than a given one, as long as it may. A new thread can be put on
/// the processor of the one that made it, and Linux takes up to tens of milliseconds to move one of two threads to a
/// processor that is idle meanwhile.
inline void leave_processor([[maybe_unused]] int processor) {
#ifdef __linux__
  cpu_set_t allowed, others;
  if (processor < 0 || processor >= CPU_SETSIZE || sched_getaffinity(0, sizeof allowed, &allowed) != 0) return;
  others = allowed;
  CPU_CLR(processor, &others);
  if (CPU_COUNT(&others) == 0 || sched_setaffinity(0, sizeof others, &others) != 0) return;
  sched_setaffinity(0, sizeof allowed, &allowed);
#endif
}

/// As many as there are when it is first asked for: the system library opens a file for every answer.
inline std::size_t processor_count() {
  static const std::size_t count = std::max(1u, std::thread::hardware_concurrency());
  return count;
}

/// Calls act() on a thread of its own. The future's destructor waits for it.
template <class Act>
auto run_beside(Act act) {
  return std::async(std::launch::async, [processor = current_processor(), act = std::move(act)]() mutable {
    leave_processor(processor);
    return act();
  });
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
  const int processor = current_processor();
  std::vector<std::jthread> others;
  for (std::size_t i = 1; i < threads; ++i)
    others.emplace_back([&] {
      leave_processor(processor);
      work();
    });
  work();
  others.clear();
  if (failure) std::rethrow_exception(failure);
}

/// Number of blocks that for_each_block makes.
inline std::size_t block_count(std::size_t size, std::size_t block_size) {
  return (size + block_size - 1) / block_size;
}

}  // namespace skeletex
