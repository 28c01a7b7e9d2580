// SPDX-License-Identifier: MIT
#pragma once
#include <filesystem>
#include <functional>
#include <string_view>

namespace skeletex {

/// Calls `write` with a temporary path beside `path`, flushes to disk and renames it to `path`. When anything throws
/// the temporary file is removed and `path` is as it was.
/// \throw IoError when the folder is missing or not writable, or the disk is full
void write_atomically(const std::filesystem::path& path, const std::function<void(const std::filesystem::path& temporary)>& write);
void write_text_atomically(const std::filesystem::path& path, std::string_view text);

}  // namespace skeletex
