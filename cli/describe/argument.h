// SPDX-License-Identifier: MIT
#pragma once
#include <CLI/CLI.hpp>
#include <string>
#include <vector>

namespace skeletex::cli {

/// An option or a positional of a command, as the parser has it.
struct Argument {
  enum class Paths { kNone, kFile, kFolder };

  std::vector<std::string> names;  ///< "-o", "--output", ..; of a positional its one name, "MODEL"
  std::string value;               ///< what an option takes, "FILE"; of a flag and a positional empty
  std::string description;         ///< with its default, as in the help
  std::string group;               ///< of the help
  std::vector<std::string> words;  ///< that it may be; empty: anything
  Paths paths = Paths::kNone;      ///< what it names
  bool is_positional = false, is_required = false, is_repeated = false;
};

/// In the order of the help.
std::vector<Argument> arguments_of(const CLI::App& command);
/// In the order of the help.
std::vector<const CLI::App*> commands_of(const CLI::App& program);
/// `text` with `to` in every place of `from`.
std::string replaced(std::string text, const std::string& from, const std::string& to);

}  // namespace skeletex::cli
