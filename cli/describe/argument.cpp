// SPDX-License-Identifier: MIT
#include "describe/argument.h"

#include "command.h"
#include "files.h"
#include "help_formatter.h"

namespace skeletex::cli {

std::vector<Argument> arguments_of(const CLI::App& command) {
  std::vector<Argument> arguments;
  for (const CLI::Option* option : command.get_options()) {
    Argument argument;
    argument.is_positional = option->get_positional();
    for (const std::string& name : option->get_snames()) argument.names.push_back('-' + name);
    for (const std::string& name : option->get_lnames()) argument.names.push_back("--" + name);
    if (argument.is_positional) argument.names = {option->get_name(true)};
    if (!argument.is_positional && option->get_items_expected_max() > 0)
      argument.value = option->get_type_name().empty() ? "VALUE" : option->get_type_name();
    argument.description = describe(*option);
    argument.group = option->get_group();
    argument.words = words_of(*option);
    for (const FileOption& file : files_of(command))
      if (file.option == option) argument.paths = file.is_folder ? Argument::Paths::kFolder : Argument::Paths::kFile;
    argument.is_required = option->get_required();
    argument.is_repeated =
        option->get_items_expected_max() > 1 || option->get_multi_option_policy() == CLI::MultiOptionPolicy::TakeAll;
    arguments.push_back(std::move(argument));
  }
  return arguments;
}

std::vector<const CLI::App*> commands_of(const CLI::App& program) {
  return program.get_subcommands([](const CLI::App*) { return true; });
}

std::string replaced(std::string text, const std::string& from, const std::string& to) {
  for (std::size_t at = 0; (at = text.find(from, at)) != std::string::npos; at += to.size())
    text.replace(at, from.size(), to);
  return text;
}

}  // namespace skeletex::cli
