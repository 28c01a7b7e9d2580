// SPDX-License-Identifier: MIT
#pragma once
#include <filesystem>

namespace skeletex {

/// A folder for intermediate files, of its own, that goes with its owner.
class WorkFolder {
 public:
  /// \throw IoError when the system's folder for such files does not take it
  WorkFolder();
  ~WorkFolder();
  WorkFolder(const WorkFolder&) = delete;
  WorkFolder& operator=(const WorkFolder&) = delete;
  const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
};

}  // namespace skeletex
