// SPDX-License-Identifier: MIT
#include "work_folder.h"

#include <fmt/format.h>
#include <unistd.h>

#include <cstdlib>
#include <string>

#include "skeletex/model/error.h"

namespace skeletex {

namespace fs = std::filesystem;

WorkFolder::WorkFolder() {
  std::string pattern = (fs::temp_directory_path() / "skeletex-XXXXXX").string();
  if (!::mkdtemp(pattern.data()))
    throw IoError(
        fmt::format("{}: no folder for intermediate files can be made there", fs::temp_directory_path().string()));
  path_ = pattern;
}

WorkFolder::~WorkFolder() {
  std::error_code ignored;
  fs::remove_all(path_, ignored);
}

}  // namespace skeletex
