// SPDX-License-Identifier: MIT
#pragma once
#include <CLI/CLI.hpp>
#include <string>

namespace skeletex::cli {

/// Help with an option's words and default on its line, and descriptions wrapped at 100 columns.
class HelpFormatter : public CLI::Formatter {
 public:
  HelpFormatter();
  std::string make_option(const CLI::Option* option, bool is_positional) const override;
  std::string make_subcommand(const CLI::App* command) const override;
};

/// The description of an option with its default, or that it is required.
std::string describe(const CLI::Option& option);

}  // namespace skeletex::cli
