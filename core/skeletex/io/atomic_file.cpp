// SPDX-License-Identifier: MIT
#include "skeletex/io/atomic_file.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <cstring>
#include <ctime>
#include <utility>

#include "skeletex/model/error.h"

namespace skeletex {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kBuffer = 1 << 20;  // bytes
constexpr std::string_view kEnding = ".part";

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

/// A temporary file beside its target, locked while it lives, and removed unless it has been renamed.
class Temporary {
 public:
  explicit Temporary(fs::path path)
      : path_(std::move(path)), descriptor_(::open(path_.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666)) {
    if (descriptor_ < 0)
      path_.clear();
    else
      ::flock(descriptor_, LOCK_EX | LOCK_NB);
  }
  ~Temporary() {
    std::error_code ignored;
    if (!path_.empty()) fs::remove(path_, ignored);
    if (descriptor_ >= 0) ::close(descriptor_);
  }
  Temporary(const Temporary&) = delete;
  Temporary& operator=(const Temporary&) = delete;

  bool exists() const { return descriptor_ >= 0; }
  const fs::path& path() const { return path_; }
  void rename_to(const fs::path& target, std::error_code& error) {
    fs::rename(path_, target, error);
    if (!error) path_.clear();
  }

 private:
  fs::path path_;
  int descriptor_;
};

/// Removes a temporary file that nobody has locked: its process was killed.
void remove_if_left(const fs::path& path) {
  const int descriptor = ::open(path.c_str(), O_WRONLY | O_CLOEXEC);
  if (descriptor < 0) return;
  // Somebody else may be between making the file and locking it.
  struct ::stat status {};
  const bool is_new =
      ::fstat(descriptor, &status) != 0 || (status.st_size == 0 && std::time(nullptr) - status.st_mtime < 2);
  std::error_code ignored;
  if (!is_new && ::flock(descriptor, LOCK_EX | LOCK_NB) == 0) fs::remove(path, ignored);
  ::close(descriptor);
}

/// Removes what killed processes left of earlier attempts at a file.
void remove_leftovers(const fs::path& folder, const std::string& prefix) {
  std::error_code ignored;
  for (fs::directory_iterator at(folder, ignored), end; at != end; at.increment(ignored)) {
    const std::string name = at->path().filename().string();
    if (name.starts_with(prefix) && name.ends_with(kEnding) &&
        name.find_first_not_of("0123456789-", prefix.size()) == name.size() - kEnding.size())
      remove_if_left(at->path());
    if (ignored) return;
  }
}

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

  const std::string prefix = fmt::format(".{}.", target.filename().string());
  remove_leftovers(folder, prefix);
  static std::atomic<unsigned> counter{0};
  // The name is claimed here, so that an unwritable folder is reported the same way whoever writes.
  Temporary temporary(folder / fmt::format("{}{}-{}{}", prefix, ::getpid(), counter++, kEnding));
  if (!temporary.exists())
    throw IoError(fmt::format("{}: cannot write in {}: {}", path.string(), folder.string(), std::strerror(errno)));
  write(temporary.path());
  flush_to_disk(temporary.path(), path, O_RDWR);
  temporary.rename_to(target, error);
  if (error) throw IoError(fmt::format("{}: cannot write: {}", path.string(), error.message()));
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
