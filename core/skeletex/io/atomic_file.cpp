// SPDX-License-Identifier: MIT
#include "skeletex/io/atomic_file.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <cstring>

#include "skeletex/model/error.h"

namespace skeletex {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kBuffer = 1 << 20;  // bytes

void flush_to_disk(const fs::path& path, const fs::path& target, int flags) {
  const int descriptor = ::open(path.c_str(), flags | O_CLOEXEC);
  if (descriptor < 0) throw IoError(fmt::format("{}: cannot write: {}", target.string(), std::strerror(errno)));
  const int result = ::fsync(descriptor);
  const int code = errno;
  ::close(descriptor);
  // EINVAL: a file system that cannot flush (some network and virtual ones) is no reason to lose the file.
  if (result != 0 && code != EINVAL && code != ENOTSUP && code != EROFS)
    throw IoError(fmt::format("{}: cannot write: {}", target.string(), std::strerror(code)));
}

/// Removes the temporary file unless it has been renamed.
struct Remover {
  fs::path path;
  ~Remover() {
    std::error_code ignored;
    if (!path.empty()) fs::remove(path, ignored);
  }
};

}  // namespace

void write_atomically(const fs::path& path, const std::function<void(const fs::path&)>& write) {
  std::error_code error;
  if (path.filename().empty()) throw IoError(fmt::format("\"{}\" is not a file name", path.string()));
  fs::path target = path;
  if (fs::is_symlink(fs::symlink_status(path, error))) {
    target = fs::weakly_canonical(path, error);
    if (error) throw IoError(fmt::format("{}: cannot follow the link: {}", path.string(), error.message()));
  }
  const fs::file_status status = fs::status(target, error);
  if (fs::is_directory(status)) throw IoError(fmt::format("{} is a folder; name a file in it", path.string()));
  if (fs::exists(status) && !fs::is_regular_file(status)) {
    write(target);
    return;
  }
  const fs::path folder = target.has_parent_path() ? target.parent_path() : fs::path(".");
  if (!fs::is_directory(folder, error))
    throw IoError(fmt::format("{}: the folder {} does not exist; create it first", path.string(), folder.string()));

  static std::atomic<unsigned> counter{0};
  Remover temporary{folder / fmt::format(".{}.{}-{}.part", target.filename().string(), ::getpid(), counter++)};
  // Claim the name here, so that an unwritable folder is reported the same way whoever writes.
  const int claimed = ::open(temporary.path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
  if (claimed < 0) {
    const int code = errno;
    temporary.path.clear();
    throw IoError(fmt::format("{}: cannot write in {}: {}", path.string(), folder.string(), std::strerror(code)));
  }
  ::close(claimed);
  write(temporary.path);
  flush_to_disk(temporary.path, path, O_RDWR);
  fs::rename(temporary.path, target, error);
  if (error) throw IoError(fmt::format("{}: cannot write: {}", path.string(), error.message()));
  temporary.path.clear();
  flush_to_disk(folder, path, O_RDONLY | O_DIRECTORY);
}

void write_text_atomically(const fs::path& path, std::string_view text) {
  write_atomically(path, [&](const fs::path& temporary) {
    OutputFile file(temporary, path);
    file.write(text);
    file.close();
  });
}

OutputFile::OutputFile(const fs::path& temporary, const fs::path& target)
    : target_(target), buffer_(kBuffer), file_(std::fopen(temporary.c_str(), "wb")) {
  if (file_ == nullptr) fail();
  std::setvbuf(file_, buffer_.data(), _IOFBF, buffer_.size());
}

OutputFile::~OutputFile() {
  if (file_ != nullptr) std::fclose(file_);
}

void OutputFile::write(std::string_view bytes) {
  if (std::fwrite(bytes.data(), 1, bytes.size(), file_) != bytes.size()) fail();
}

std::uint64_t OutputFile::position() {
  const long position = std::ftell(file_);
  if (position < 0) fail();
  return static_cast<std::uint64_t>(position);
}

void OutputFile::seek(std::uint64_t position) {
  if (std::fseek(file_, static_cast<long>(position), SEEK_SET) != 0) fail();
}

void OutputFile::close() {
  std::FILE* file = file_;
  file_ = nullptr;
  if (std::fclose(file) != 0 || error_ != 0) fail();
}

void OutputFile::fail() {
  if (error_ == 0) error_ = errno;
  throw IoError(fmt::format("{}: cannot write: {}", target_.string(), std::strerror(error_)));
}

}  // namespace skeletex
