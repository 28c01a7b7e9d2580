// SPDX-License-Identifier: MIT
#pragma once
#include <CLI/CLI.hpp>
#include <string>
#include <vector>

namespace skeletex::cli {

/// A file that an option or positional of a command names. Commands declare all of theirs; check_files looks after
/// them.
struct FileOption {
  const CLI::Option* option = nullptr;
  bool is_output = false;
  bool is_folder = false;            ///< an output that is a folder
  bool can_be_stream = false;        ///< an output that may be "-", standard output
  std::vector<std::string> endings;  ///< of an output; empty: any
};

/// What the option names is read.
/// \return the option
CLI::Option* declare_input(CLI::App& command, CLI::Option* option);
/// What the option names is written.
/// \param endings  those that the command writes, the dot included; empty: any
CLI::Option* declare_output(CLI::App& command, CLI::Option* option, std::vector<std::string> endings);
CLI::Option* declare_output_folder(CLI::App& command, CLI::Option* option);
/// A text that may go to standard output as well.
CLI::Option* declare_text_output(CLI::App& command, CLI::Option* option);

/// In the order of their declaration.
const std::vector<FileOption>& files_of(const CLI::App& command);

/// \param ending  with its dot, in lower case; the path's may be in capitals
bool has_ending(const std::string& path, const std::string& ending);
/// Whether it is a model to read: .skx.exr, or a compact file.
bool is_model_path(const std::string& path);
/// As messages name it: "MESH", "--output".
std::string option_name(const CLI::Option& option);

/// Called once a command's options are known and before it does anything.
/// \throw CLI::ValidationError when an output is an input or another output, has an ending that the command does not
/// write, or is "-" where
///        that is not standard output; IoError when the folder of an output is missing or not writable
void check_files(const CLI::App& command);
/// The same for an output whose name the command makes of others, and which no option names.
void check_made_output(const CLI::App& command, const std::string& path);
/// Refuses an output that is a file which an input names in turn.
/// \param what  the file, in words
void check_named_input(const CLI::App& command, const std::string& path, const std::string& what);

/// Numbers of the command line: finite, nothing before or behind them, within limits. The message says the limits in
/// words.
CLI::Validator number_in(double lower, double upper);
CLI::Validator number_above(double lower);
CLI::Validator number_from(double lower);
CLI::Validator any_number();

}  // namespace skeletex::cli
