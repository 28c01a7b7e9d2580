// SPDX-License-Identifier: MIT
#include "files.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <charconv>
#include <cmath>
#include <filesystem>
#include <limits>
#include <map>

#include "command.h"
#include "skeletex/io/same_file.h"

namespace skeletex::cli {
namespace {

namespace fs = std::filesystem;

std::map<const CLI::App*, std::vector<FileOption>>& declarations() {
  static std::map<const CLI::App*, std::vector<FileOption>> all;
  return all;
}

CLI::Option* declare(CLI::App& command, CLI::Option* option, FileOption file) {
  file.option = option;
  declarations()[&command].push_back(std::move(file));
  return option;
}

/// A file that the command line names, with the option that names it.
struct NamedFile {
  const FileOption* declaration = nullptr;
  std::string name, path;
};

std::vector<NamedFile> named_files(const CLI::App& command) {
  std::vector<NamedFile> files;
  for (const FileOption& file : files_of(command)) {
    const CLI::Option& option = *file.option;
    std::vector<std::string> paths = option.results();
    if (paths.empty() && file.is_output && !option.get_default_str().empty()) paths.push_back(option.get_default_str());
    for (const std::string& path : paths)
      if (!path.empty()) files.push_back({&file, option_name(option), path});
  }
  return files;
}

void check_ending(const NamedFile& file) {
  const std::vector<std::string>& endings = file.declaration->endings;
  if (endings.empty() || std::any_of(endings.begin(), endings.end(),
                                     [&](const std::string& ending) { return has_ending(file.path, ending); }))
    return;
  std::string list;
  for (std::size_t i = 0; i < endings.size(); ++i)
    list += (i == 0 ? "" : i + 1 == endings.size() ? " or " : ", ") + endings[i];
  throw CLI::ValidationError(file.name,
                             fmt::format("\"{}\" must end in {}, which says what is written", file.path, list));
}

bool is_stream(const NamedFile& file) { return file.path == "-" && file.declaration->is_output; }

void check_apart(const NamedFile& output, const NamedFile& other) {
  if (is_stream(output) || is_stream(other) || !is_same_file(output.path, other.path)) return;
  throw CLI::ValidationError(
      output.name, fmt::format("\"{}\" is also {}, which would be lost; name another file", output.path,
                               other.declaration == output.declaration ? "named a second time"
                                                                       : other.name + " \"" + other.path + '"'));
}

void check_folder(const NamedFile& output) {
  std::error_code error;
  if (fs::exists(output.path, error) && !fs::is_directory(output.path, error))
    throw CLI::ValidationError(output.name, fmt::format("\"{}\" is a file, not a folder", output.path));
}

CLI::Validator number(const std::string& words, double lower, double upper, bool is_lower_in) {
  return CLI::Validator(
      [=](const std::string& text) -> std::string {
        double value = 0;
        const char* const begin = text.data() + (text.starts_with('+') ? 1 : 0);
        const auto [rest, code] = std::from_chars(begin, text.data() + text.size(), value);
        const bool is_number = code == std::errc() && rest == text.data() + text.size() && std::isfinite(value);
        if (is_number && (is_lower_in ? value >= lower : value > lower) && value <= upper) return {};
        return fmt::format("\"{}\" is not {}", text, words);
      },
      "");
}

constexpr double kMostNumber = 1e15;

}  // namespace

CLI::Option* declare_input(CLI::App& command, CLI::Option* option) { return declare(command, option, {}); }

CLI::Option* declare_output(CLI::App& command, CLI::Option* option, std::vector<std::string> endings) {
  FileOption file;
  file.is_output = true;
  file.endings = std::move(endings);
  return declare(command, option, std::move(file));
}

CLI::Option* declare_output_folder(CLI::App& command, CLI::Option* option) {
  FileOption file;
  file.is_output = file.is_folder = true;
  return declare(command, option, std::move(file));
}

CLI::Option* declare_text_output(CLI::App& command, CLI::Option* option) {
  FileOption file;
  file.is_output = file.can_be_stream = true;
  return declare(command, option, std::move(file));
}

const std::vector<FileOption>& files_of(const CLI::App& command) { return declarations()[&command]; }

bool has_ending(const std::string& path, const std::string& ending) {
  std::string lower = path;
  for (char& c : lower) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return lower.ends_with(ending);
}

bool is_model_path(const std::string& path) { return has_ending(path, ".exr") || has_ending(path, ".skx"); }

std::string option_name(const CLI::Option& option) {
  return option.get_lnames().empty() ? option.get_name(true) : "--" + option.get_lnames().front();
}

void check_files(const CLI::App& command) {
  const std::vector<NamedFile> files = named_files(command);
  for (const NamedFile& output : files) {
    if (!output.declaration->is_output) continue;
    if (output.path == "-" && !output.declaration->can_be_stream)
      throw CLI::ValidationError(output.name, "\"-\" is not a file; standard output is for --json alone");
    for (const NamedFile& other : files)
      if (&other != &output) check_apart(output, other);
  }
  for (const NamedFile& output : files) {
    if (!output.declaration->is_output || is_stream(output)) continue;
    check_ending(output);
    if (output.declaration->is_folder)
      check_folder(output);
    else
      check_output(output.path);
  }
}

void check_made_output(const CLI::App& command, const std::string& path) {
  for (const NamedFile& file : named_files(command))
    if (!file.declaration->is_folder && !is_stream(file) && is_same_file(file.path, path))
      throw CLI::ValidationError(
          file.name,
          fmt::format("\"{}\" would be replaced by {}, one of the outputs; name another file", file.path, path));
}

void check_named_input(const CLI::App& command, const std::string& path, const std::string& what) {
  for (const NamedFile& file : named_files(command))
    if (file.declaration->is_output && !file.declaration->is_folder && !is_stream(file) &&
        is_same_file(file.path, path))
      throw CLI::ValidationError(file.name,
                                 fmt::format("\"{}\" is {}, which would be lost; name another file", file.path, what));
}

CLI::Validator number_in(double lower, double upper) {
  return number(fmt::format("a number from {:g} to {:g}", lower, upper), lower, upper, true);
}
CLI::Validator number_above(double lower) {
  return number(fmt::format("a number above {:g}", lower), lower, kMostNumber, false);
}
CLI::Validator number_from(double lower) {
  return number(fmt::format("a number of at least {:g}", lower), lower, kMostNumber, true);
}
CLI::Validator any_number() { return number("a number", -kMostNumber, kMostNumber, true); }

}  // namespace skeletex::cli
