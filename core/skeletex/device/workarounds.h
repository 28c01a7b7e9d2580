// SPDX-License-Identifier: MIT
#pragma once
#include <array>
#include <cstddef>
#include <string>

#include "skeletex/device/context.h"

/// What the project does because of how a single OpenCL driver behaves, each with its reason.
namespace skeletex::workarounds {

/// Work-items of a group where the caller leaves it open. PoCL compiles a kernel for each size of group. Left to
/// itself it chooses the size by the number of work-items, and so compiles again for every mesh.
inline constexpr std::size_t kGroupSize = 64;

/// Work-items of a group where a kernel has one group per row of a lattice. On a CPU it is one, which loops over the
/// columns: PoCL makes vector instructions of a loop whose step the compiler knows.
std::size_t row_items(const ClDeviceInfo& device);

/// False for Oclgrind, which runs one kernel at a time, whatever queues there are.
bool can_run_concurrently(const ClDeviceInfo& device);

/// The source below a line that changes with source and options: the caches of some drivers overlook the options.
std::string marked_source(const std::string& options, const std::string& source);

/// A pattern as clEnqueueFillBuffer takes it: the longest that OpenCL allows and that divides the buffer's size, as
/// PoCL writes one after the other.
struct FillPattern {
  std::array<std::byte, 128> bytes;
  std::size_t size = 0;
};
FillPattern longest_pattern(const void* pattern, std::size_t pattern_bytes, std::size_t buffer_bytes);

}  // namespace skeletex::workarounds
