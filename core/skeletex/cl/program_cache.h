// SPDX-License-Identifier: MIT
#pragma once
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace skeletex {

/// Compiled programs on disk, so that a program starts without its driver's compiler. PoCL keeps compiled kernels of its
/// own, but still parses every source at every start (some 50 ms a program on two cores; from here 5 ms).
/// The variable SKELETEX_CACHE_DIR names the folder; set to "off" or to nothing there is no cache. Unset:
/// $XDG_CACHE_HOME/skeletex, else $HOME/.cache/skeletex.
/// \return the folder, which need not exist yet; empty: no cache
std::filesystem::path program_cache_folder();

/// The entry of a key (source, options, device and driver in one text). An entry that is missing, cut short, altered
/// or of another key is as if it were not there.
std::optional<std::vector<unsigned char>> load_program_binary(const std::filesystem::path& folder, const std::string& key);

/// Writes an entry under a temporary name and renames it, so that processes can share a folder. Entries beyond
/// the 256 newest are removed.
/// \return false when it could not be written; a cache is never a reason to fail
bool save_program_binary(const std::filesystem::path& folder, const std::string& key, const std::vector<unsigned char>& binary);

}  // namespace skeletex
