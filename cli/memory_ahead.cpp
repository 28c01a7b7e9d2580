// SPDX-License-Identifier: MIT
#include "memory_ahead.h"

#include "skeletex/geometry/parallel.h"

namespace skeletex::cli {
namespace {

constexpr std::size_t kPage = 4096;
constexpr std::size_t kBlock =
    8 << 20;  // less than what the allocator would give back to the system (keep_freed_memory)

}  // namespace

MemoryAhead::MemoryAhead(std::size_t bytes) {
  while (blocks_.size() * kBlock < bytes) blocks_.push_back(std::make_unique_for_overwrite<char[]>(kBlock));
  touching_ = run_beside([&] {
    for (const auto& block : blocks_)
      for (std::size_t i = 0; i < kBlock && !is_needed_; i += kPage) static_cast<volatile char*>(block.get())[i] = 0;
  });
}

MemoryAhead::~MemoryAhead() {
  is_needed_ = true;
  touching_.wait();
}

}  // namespace skeletex::cli
