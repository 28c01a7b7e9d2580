// SPDX-License-Identifier: MIT
#include "skeletex/model/memory.h"

#include <fmt/format.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <fstream>
#include <optional>

#include "skeletex/model/error.h"

namespace skeletex {
namespace {

constexpr double kGibibyte = 1 << 30;

/// The number that a file of the system begins with; nothing where there is none, as in "max".
std::optional<std::uint64_t> number_in(const std::string& path) {
  std::ifstream file(path);
  std::uint64_t number = 0;
  return file >> number ? std::optional(number) : std::nullopt;
}

/// What the machine can still give, swap included.
std::uint64_t machine_memory() {
  std::ifstream file("/proc/meminfo");
  std::string name, unit;
  std::uint64_t kibibytes = 0, sum = 0;
  while (file >> name >> kibibytes && std::getline(file, unit))
    if (name == "MemAvailable:" || name == "SwapFree:") sum += kibibytes * 1024;
  return sum > 0 ? sum : std::numeric_limits<std::uint64_t>::max();
}

/// What the control group of this process (version 2) and those above it leave.
std::uint64_t group_memory() {
  std::uint64_t least = std::numeric_limits<std::uint64_t>::max();
  std::ifstream file("/proc/self/cgroup");
  for (std::string line; std::getline(file, line);) {
    if (!line.starts_with("0::")) continue;
    for (std::string group = line.substr(3); !group.empty(); group.resize(group.find_last_of('/'))) {
      const std::string folder = "/sys/fs/cgroup" + (group == "/" ? std::string() : group);
      const auto most = number_in(folder + "/memory.max"), taken = number_in(folder + "/memory.current");
      if (most && taken) least = std::min(least, *most - std::min(*most, *taken));
      if (group == "/") break;
    }
  }
  return least;
}

}  // namespace

std::uint64_t free_addresses() {
  rlimit limit{};
  if (::getrlimit(RLIMIT_AS, &limit) != 0 || limit.rlim_cur == RLIM_INFINITY)
    return std::numeric_limits<std::uint64_t>::max();
  const std::uint64_t pages = number_in("/proc/self/statm").value_or(0);
  const std::uint64_t taken = pages * static_cast<std::uint64_t>(::sysconf(_SC_PAGESIZE));
  return limit.rlim_cur - std::min<std::uint64_t>(limit.rlim_cur, taken);
}

AvailableMemory available_memory() {
  AvailableMemory least{free_addresses(), "the limit of this shell (ulimit -v)"};
  if (const std::uint64_t group = group_memory(); group < least.bytes)
    least = {group, "the limit of this control group (memory.max)"};
  if (const std::uint64_t machine = machine_memory(); machine < least.bytes) least = {machine, "this machine"};
  return least;
}

void require_memory(double bytes, const std::string& work) {
  if (bytes < 0.25 * kGibibyte) return;
  const AvailableMemory available = available_memory();
  if (bytes <= static_cast<double>(available.bytes)) return;
  throw InputError(
      fmt::format("{} takes about {:.2g} GiB of memory, and {} leaves {:.2g}; ask for a smaller size, or "
                  "run it where there is more",
                  work, bytes / kGibibyte, available.limit, static_cast<double>(available.bytes) / kGibibyte));
}

}  // namespace skeletex
