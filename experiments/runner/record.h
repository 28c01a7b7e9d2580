// SPDX-License-Identifier: MIT
#pragma once
#include "experiment.h"

namespace skeletex {

/// Where and with what a run was made: git state, compiler, libraries, machine, OpenCL device and driver.
OrderedJson describe_build_and_machine(const std::string& device_selector);

/// FNV-1a (64 bit) of a file's bytes, as "fnv1a64:hex".
/// \throw IoError
std::string hash_file(const std::filesystem::path& path);
/// The same of a text.
std::string hash_text(std::string_view text);

}  // namespace skeletex
