// SPDX-License-Identifier: MIT
#pragma once
#include <filesystem>

namespace skeletex {

/// A folder for PoCL's compiled kernels that no other process uses as long as this one lives: the first free one of a
/// few that all runs on this machine share, so that kernels are compiled once for each.
class CacheSlot {
 public:
  /// \throw IoError when none can be made
  CacheSlot();
  ~CacheSlot();
  CacheSlot(const CacheSlot&) = delete;
  CacheSlot& operator=(const CacheSlot&) = delete;
  const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
  int lock_ = -1;
};

}  // namespace skeletex
