// SPDX-License-Identifier: MIT
#include "skeletex/io/read_file.h"

#include <fmt/format.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <memory>

#include "skeletex/model/error.h"

namespace skeletex {

std::string read_file(const std::filesystem::path& path, std::uintmax_t max_bytes) {
  std::error_code error;
  if (std::filesystem::is_directory(path, error))
    throw IoError(fmt::format("{} is a folder, not a file", path.string()));
  const std::unique_ptr<std::FILE, int (*)(std::FILE*)> file(std::fopen(path.c_str(), "rb"), std::fclose);
  if (!file) throw IoError(fmt::format("{}: cannot open: {}", path.string(), std::strerror(errno)));
  std::string bytes;
  const std::uintmax_t size =
      std::filesystem::file_size(path, error);  // an error for pipes, which are read all the same
  if (!error) {
    if (size > max_bytes)
      throw IoError(fmt::format("{}: {} bytes are more than the {} that this kind of file may have", path.string(),
                                size, max_bytes));
    bytes.reserve(size);
  }
  char block[1 << 16];
  std::size_t count;
  while ((count = std::fread(block, 1, sizeof block, file.get())) > 0) {
    bytes.append(block, count);
    if (bytes.size() > max_bytes) throw IoError(fmt::format("{}: more than {} bytes", path.string(), max_bytes));
  }
  if (std::ferror(file.get())) throw IoError(fmt::format("{}: cannot read: {}", path.string(), std::strerror(errno)));
  return bytes;
}

}  // namespace skeletex
