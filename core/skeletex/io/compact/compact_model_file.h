// SPDX-License-Identifier: MIT
#pragma once
#include <filesystem>
#include <optional>

#include "skeletex/compact/compact_model.h"
#include "skeletex/model/texture.h"

namespace skeletex {

/// Whether a file's first bytes are those of a compact model (.skx).
/// \return false where it cannot be read
bool is_compact_file(const std::filesystem::path& path);

struct CompactFileOptions {
  std::optional<std::size_t> bytes;  ///< read no more of the file, for a coarser model
  std::optional<int> size;           ///< the texture's longer side is at least that, and less than twice as long
};
/// What a compact file holds.
/// \throw IoError that names the reason: damaged, truncated, of a newer version
CompactModel read_compact_file(const std::filesystem::path& path);
/// The model of a compact file at the size that it names, or at another one.
/// \throw IoError that names the reason: damaged, truncated, of a newer version; InputError: too large for the memory
SkeletexModel read_compact_model(const std::filesystem::path& path, const CompactFileOptions& options = {});

}  // namespace skeletex
