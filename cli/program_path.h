// SPDX-License-Identifier: MIT
#pragma once
#include <filesystem>
#include <string>

namespace skeletex::cli {

/// The file of this program.
inline std::string program_path() { return std::filesystem::read_symlink("/proc/self/exe").string(); }

}  // namespace skeletex::cli
