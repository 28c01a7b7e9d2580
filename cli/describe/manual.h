// SPDX-License-Identifier: MIT
#pragma once
#include <CLI/CLI.hpp>
#include <string>

namespace skeletex::cli {

/// The manual page of the program, or of one of its commands, from the parser, for `man`.
/// \param command  nullptr: the program's own page
/// \return roff with the macros of man(7)
std::string manual_page(const CLI::App& program, const CLI::App* command);
/// "skeletex.1", or "skeletex-encode.1".
std::string manual_file(const CLI::App& program, const CLI::App* command);

}  // namespace skeletex::cli
