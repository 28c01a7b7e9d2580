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

/// The source below a line that changes with source and options: the caches of some drivers overlook the options.
std::string marked_source(const std::string& options, const std::string& source);

/// A pattern as clEnqueueFillBuffer takes it: the longest that OpenCL allows and that divides the buffer's size, as
/// PoCL writes one after the other.
struct FillPattern {
  std::array<std::byte, 128> bytes;
  std::size_t size = 0;
};
FillPattern longest_pattern(const void* pattern, std::size_t pattern_bytes, std::size_t buffer_bytes);

/// Why PoCL finds no device or compiles nothing, where that is its folder of compiled kernels: PoCL itself says
/// something else. Empty where the folder can be written, and tried with a few files.
std::string fault_of_kernel_cache();

/// PoCL takes the memory of a buffer at its first use and ends the program where there is none. Where addresses are
/// limited (ulimit -v), buffers of CPU devices are therefore refused before that.
/// \throw DeviceError
void require_addresses(const ClDeviceInfo& device, std::size_t bytes);
/// Whether they are limited, so that a buffer should be used as soon as it is made.
bool has_limited_addresses(const ClDeviceInfo& device);

}  // namespace skeletex::workarounds
