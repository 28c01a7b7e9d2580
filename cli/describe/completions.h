// SPDX-License-Identifier: MIT
#pragma once
#include <CLI/CLI.hpp>
#include <string>
#include <vector>

namespace skeletex::cli {

/// Those that completions can be made for.
const std::vector<std::string>& shells();

/// A script with which the shell completes commands, options, their words and files, from the parser.
/// \param shell  one of shells()
std::string completions(const CLI::App& program, const std::string& shell);

}  // namespace skeletex::cli
