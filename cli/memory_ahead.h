// SPDX-License-Identifier: MIT
#pragma once
#include <atomic>
#include <cstddef>
#include <future>
#include <memory>
#include <vector>

namespace skeletex::cli {

/// Takes memory from the system beside what is done until it is needed, and then gives it to the allocator: the system
/// clears each page when it is first touched, and a virtual machine may have to ask its host for it first, which
/// together can take as long as a stage itself.
class MemoryAhead {
 public:
  explicit MemoryAhead(std::size_t bytes);
  /// Gives it to the allocator, whether all of it is there yet or not.
  ~MemoryAhead();
  MemoryAhead(const MemoryAhead&) = delete;
  MemoryAhead& operator=(const MemoryAhead&) = delete;

 private:
  std::vector<std::unique_ptr<char[]>> blocks_;
  std::atomic<bool> is_needed_ = false;
  std::future<void> touching_;
};

}  // namespace skeletex::cli
