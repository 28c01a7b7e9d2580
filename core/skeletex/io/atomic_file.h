// SPDX-License-Identifier: MIT
#pragma once
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <functional>
#include <string_view>
#include <vector>

namespace skeletex {

/// Calls `write` with a temporary path beside `path`, flushes to disk and renames it to `path`. When anything throws
/// the temporary file is removed and `path` is as it was. Where the process is killed it stays, and the next call for
/// `path` removes it. A symbolic link is followed; a device or a pipe is written
/// in place.
/// \throw IoError when the folder is missing or not writable, or the disk is full
void write_atomically(const std::filesystem::path& path,
                      const std::function<void(const std::filesystem::path& temporary)>& write);
void write_text_atomically(const std::filesystem::path& path, std::string_view text);

/// A file being written, every call checked: for use inside write_atomically.
class OutputFile {
 public:
  /// \param temporary  the file that is written
  /// \param target     the name that error messages give it
  OutputFile(const std::filesystem::path& temporary, const std::filesystem::path& target);
  ~OutputFile();
  OutputFile(const OutputFile&) = delete;
  OutputFile& operator=(const OutputFile&) = delete;

  void write(std::string_view bytes);
  std::uint64_t position();
  void seek(std::uint64_t position);
  /// Must be called: a full disk may show only here, as may an earlier failure that somebody in between swallowed.
  /// \throw IoError
  void close();

 private:
  [[noreturn]] void fail();
  std::filesystem::path target_;
  std::vector<char> buffer_;  ///< large: some writers hand over a line at a time
  std::FILE* file_;
  int error_ = 0;  ///< errno of the first failure
};

}  // namespace skeletex
