// SPDX-License-Identifier: MIT
#include "skeletex/device/workarounds.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <functional>

namespace skeletex::workarounds {

std::size_t row_items(const ClDeviceInfo& device) {
  return device.type == "cpu" ? 1 : std::min<std::size_t>(128, device.max_work_group_size);
}

bool can_run_concurrently(const ClDeviceInfo& device) { return device.platform != "Oclgrind"; }

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

}  // namespace skeletex::workarounds
