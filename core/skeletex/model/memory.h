// SPDX-License-Identifier: MIT
#pragma once
#include <cstdint>
#include <limits>
#include <string>

namespace skeletex {

/// What this process can still take of memory, and what limits it.
struct AvailableMemory {
  std::uint64_t bytes = std::numeric_limits<std::uint64_t>::max();
  std::string limit;  ///< for messages: "the limit of this shell (ulimit -v)"
};

/// Bytes of addresses that this process may still take; the largest number where there is no limit (ulimit -v).
std::uint64_t free_addresses();
/// The least that addresses, control group and machine leave.
AvailableMemory available_memory();

/// Asked before work that takes much, so that it is refused rather than ended by the system on its way.
/// \param bytes  an estimate; what is below a quarter of a GiB is never refused
/// \param work   for the message: "encoding to 4096 x 4096 texels"
/// \throw InputError when there is less
void require_memory(double bytes, const std::string& work);

}  // namespace skeletex
