// SPDX-License-Identifier: MIT
#include "skeletex/device/workarounds.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <functional>
#include <limits>

#include "skeletex/model/error.h"
#include "skeletex/model/memory.h"

namespace skeletex::workarounds {

std::size_t row_items(const ClDeviceInfo& device) {
  return device.type == "cpu" ? 1 : std::min<std::size_t>(128, device.max_work_group_size);
}

std::string marked_source(const std::string& options, const std::string& source) {
  return fmt::format("// {:016x}\n{}", std::hash<std::string>{}(options + source), source);
}

FillPattern longest_pattern(const void* pattern, std::size_t pattern_bytes, std::size_t buffer_bytes) {
  FillPattern result;
  const bool is_repeated = result.bytes.size() % pattern_bytes == 0 && buffer_bytes % result.bytes.size() == 0;
  result.size = is_repeated ? result.bytes.size() : pattern_bytes;
  for (std::size_t i = 0; i < result.size; i += pattern_bytes)
    std::memcpy(result.bytes.data() + i, pattern, pattern_bytes);
  return result;
}

namespace {

/// As PoCL chooses it.
std::filesystem::path kernel_cache() {
  const auto variable = [](const char* name) -> std::filesystem::path {
    const char* value = std::getenv(name);
    return value ? value : "";
  };
  if (const auto own = variable("POCL_CACHE_DIR"); !own.empty()) return own;
  if (const auto caches = variable("XDG_CACHE_HOME"); !caches.empty()) return caches / "pocl" / "kcache";
  return variable("HOME") / ".cache" / "pocl" / "kcache";
}

}  // namespace

std::string fault_of_kernel_cache() {
  constexpr std::size_t kNeeded = std::size_t{4} << 20;  // bytes: a program of the largest kernels
  const std::filesystem::path folder = kernel_cache();
  std::string reason;
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (!std::filesystem::is_directory(folder)) {
    reason = error ? error.message() : "it is not a folder";
  } else {
    std::string name = (folder / "skeletex-XXXXXX").string();
    const int file = ::mkstemp(name.data());
    if (file < 0) {
      reason = std::strerror(errno);
    } else {
      if (const int code = ::posix_fallocate(file, 0, kNeeded); code != 0) reason = std::strerror(code);
      ::close(file);
      ::unlink(name.c_str());
    }
  }
  if (reason.empty()) return {};
  return fmt::format(
      "PoCL cannot write its compiled kernels to {}: {}; make room there, or set POCL_CACHE_DIR to a "
      "folder that can be written",
      folder.string(), reason);
}

bool has_limited_addresses(const ClDeviceInfo& device) {
  return device.type == "cpu" && free_addresses() != std::numeric_limits<std::uint64_t>::max();
}

void require_addresses(const ClDeviceInfo& device, std::size_t bytes) {
  constexpr std::uint64_t kSpare = std::uint64_t{192} << 20;  // for compiling kernels, and for what the host takes
  if (!has_limited_addresses(device)) return;
  const std::uint64_t free = free_addresses();
  if (bytes + kSpare > free)
    throw DeviceError(
        fmt::format("{} needs {} MiB more, and the limit of this shell (ulimit -v) leaves {}; raise it, or "
                    "ask for a smaller size",
                    device.name, (bytes + kSpare) >> 20, free >> 20));
}

}  // namespace skeletex::workarounds
