// SPDX-License-Identifier: MIT
#include "help_formatter.h"

#include <sstream>

namespace skeletex::cli {
namespace {

constexpr std::size_t kIndent = 26, kWidth = 100;

std::string entry(const std::string& name, const std::string& description) {
  std::string text = "  " + name;
  std::size_t column = text.size();
  if (column + 2 > kIndent) {
    text += '\n';
    column = 0;
  }
  text.append(kIndent - column, ' ');
  column = kIndent;
  std::istringstream words(description);
  bool is_first = true;
  for (std::string word; words >> word; is_first = false) {
    if (!is_first && column + 1 + word.size() > kWidth) {
      text += '\n' + std::string(kIndent, ' ');
      column = kIndent;
    } else if (!is_first) {
      text += ' ';
      ++column;
    }
    text += word;
    column += word.size();
  }
  return text + '\n';
}

}  // namespace

std::string describe(const CLI::Option& option) {
  std::string description = option.get_description();
  const std::string standard = option.get_default_str();
  if (!standard.empty() && standard != "[]" && option.get_type_size() > 0)
    description += " (default: " + standard + ")";
  if (!option.get_positional() && option.get_required()) description += " (required)";
  return description;
}

HelpFormatter::HelpFormatter() { column_width(kIndent); }

std::string HelpFormatter::make_option(const CLI::Option* option, bool is_positional) const {
  std::string name = is_positional ? option->get_name(true) : option->get_name(false, true);
  if (!is_positional && option->get_type_size() > 0 && !option->get_type_name().empty())
    name += ' ' + option->get_type_name();
  return entry(name, describe(*option));
}

std::string HelpFormatter::make_subcommand(const CLI::App* command) const {
  return entry(command->get_name(), command->get_description());
}

}  // namespace skeletex::cli
