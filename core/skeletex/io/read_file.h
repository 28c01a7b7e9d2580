// SPDX-License-Identifier: MIT
#pragma once
#include <filesystem>
#include <string>

namespace skeletex {

/// The bytes of a file.
/// \throw IoError naming the path: missing, a folder, not readable, or larger than `max_bytes`
std::string read_file(const std::filesystem::path& path, std::uintmax_t max_bytes = std::uintmax_t{8} << 30);

}  // namespace skeletex
