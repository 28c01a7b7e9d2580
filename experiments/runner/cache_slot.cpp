// SPDX-License-Identifier: MIT
#include "cache_slot.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <cstring>

#include "skeletex/model/error.h"

namespace skeletex {

namespace fs = std::filesystem;

CacheSlot::CacheSlot() {
  const char* given = std::getenv("POCL_CACHE_DIR");
  const fs::path base =
      given && *given ? fs::path(given) : fs::temp_directory_path() / fmt::format("skeletex-pocl-{}", ::getuid());
  for (int slot = 0; lock_ < 0; ++slot) {
    path_ = base / fmt::format("job-{}", slot);
    std::error_code code;
    fs::create_directories(path_, code);
    const int file = ::open((base / fmt::format("job-{}.lock", slot)).c_str(), O_CREAT | O_RDWR | O_CLOEXEC, 0644);
    if (file >= 0 && ::flock(file, LOCK_EX | LOCK_NB) == 0) {
      lock_ = file;
    } else {
      const int reason = errno;
      if (file >= 0) ::close(file);
      if (file < 0 || reason != EWOULDBLOCK)
        throw IoError(fmt::format("{}: no folder for compiled kernels can be had: {}", base.string(),
                                  code ? code.message() : std::strerror(reason)));
    }
  }
}

CacheSlot::~CacheSlot() { ::close(lock_); }

}  // namespace skeletex
