// SPDX-License-Identifier: MIT
#pragma once
#include <filesystem>
#include <initializer_list>

namespace skeletex {

/// Whether two paths lead to one file: by device and inode, links followed; files that are not there yet by their path.
bool is_same_file(const std::filesystem::path& a, const std::filesystem::path& b);

/// For programs with few files.
/// \throw InputError when an output, if it is named, is one of the inputs
void check_not_an_input(const std::filesystem::path& output, std::initializer_list<std::filesystem::path> inputs);

}  // namespace skeletex
