// SPDX-License-Identifier: MIT
#pragma once
#include <string>
#include <string_view>

#include "skeletex/compact/compact_model.h"

namespace skeletex {

/// The version of the compact format that this library reads and writes.
inline constexpr int kCompactVersion = 2;

/// The bytes of a compact file (docs/compact.md).
std::string compact_bytes(const CompactModel& model);
/// Its payload: what LZMA compresses.
std::string compact_payload(const CompactModel& model);

/// Whether a file's first bytes are those of a compact file.
bool is_compact(std::string_view first_bytes);

/// What may be missing of a file.
enum class PrefixRule {
  kWhole,   ///< nothing: the checksum must be right
  kPrefix,  ///< finer levels: the file is the first bytes of one
};
/// \param where  the file, for messages
/// \throw IoError that names the reason: no compact file, another version, damaged or truncated
CompactModel read_compact(std::string_view bytes, const std::string& where, PrefixRule rule = PrefixRule::kWhole);

}  // namespace skeletex
