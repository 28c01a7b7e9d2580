// SPDX-License-Identifier: MIT
#pragma once
#include "experiment.h"

namespace skeletex {

/// The checkout that the working folder is in: {"commit", "changed_files"}, the latter the number of files that differ
/// from the commit or are not in it. Both are "" outside of a checkout.
OrderedJson describe_checkout();

/// With what a run was made: compiler, libraries, machine, OpenCL device and driver.
OrderedJson describe_build_and_machine(const std::string& device_selector);

/// FNV-1a (64 bit) of a file's bytes, as "fnv1a64:hex".
/// \throw IoError
std::string hash_file(const std::filesystem::path& path);
/// The same of a text.
std::string hash_text(std::string_view text);

}  // namespace skeletex
