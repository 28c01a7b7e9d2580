// SPDX-License-Identifier: MIT
#include "describe/manual.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <sstream>

#include "describe/argument.h"

namespace skeletex::cli {
namespace {

/// Text in which nothing is a request or an escape of roff.
std::string plain(const std::string& text) {
  const std::string escaped = replaced(replaced(text, "\\", "\\e"), "-", "\\-");
  return escaped.starts_with('.') || escaped.starts_with('\'') ? "\\&" + escaped : escaped;
}

std::string bold(const std::string& text) { return "\\fB" + plain(text) + "\\fR"; }
std::string italic(const std::string& text) { return "\\fI" + plain(text) + "\\fR"; }

std::string page_name(const CLI::App& program, const CLI::App* command) {
  return command ? program.get_name() + '-' + command->get_name() : program.get_name();
}

std::string capitals(std::string text) {
  for (char& c : text) c = static_cast<char>(std::toupper(static_cast<unsigned char>(c)));
  return text;
}

std::string heading(const CLI::App& program, const CLI::App* command) {
  const std::string name = page_name(program, command);
  std::string description = command ? command->get_description() : program.get_description();
  if (description.ends_with('.')) description.pop_back();
  return fmt::format(".TH \"{}\" 1 \"\" \"{}\" \"Skeletex\"\n.SH NAME\n{} \\- {}\n", plain(capitals(name)),
                     plain(program.version()), plain(name), plain(description));
}

std::string synopsis(const CLI::App& program, const CLI::App* command) {
  std::string text = ".SH SYNOPSIS\n" + bold(program.get_name());
  if (!command) return text + ' ' + italic("COMMAND") + " ...\n";
  text += ' ' + bold(command->get_name());
  for (const Argument& argument : arguments_of(*command)) {
    if (!argument.is_positional && !argument.is_required) continue;
    std::string one = argument.is_positional ? italic(argument.names[0])
                                             : bold(argument.names.front()) + ' ' + italic(argument.value);
    if (argument.is_repeated) one += " ...";
    text += argument.is_required ? ' ' + one : " [" + one + ']';
  }
  return text + " [" + italic("OPTIONS") + "]\n";
}

std::string entry(const Argument& argument) {
  std::string head;
  for (const std::string& name : argument.names)
    head += (head.empty() ? "" : ", ") + (argument.is_positional ? italic(name) : bold(name));
  if (!argument.value.empty()) head += ' ' + italic(argument.value);
  return ".TP\n" + head + '\n' + plain(argument.description) + '\n';
}

/// Positionals and options, each group of the help under a heading of its own.
std::string arguments_text(const CLI::App& app) {
  const std::vector<Argument> arguments = arguments_of(app);
  std::vector<std::string> groups;
  std::string positionals, options;
  for (const Argument& argument : arguments)
    if (argument.is_positional)
      positionals += entry(argument);
    else if (std::find(groups.begin(), groups.end(), argument.group) == groups.end())
      groups.push_back(argument.group);
  for (const std::string& group : groups) {
    if (groups.size() > 1 && group != "Options") options += ".SS " + plain(group) + '\n';
    for (const Argument& argument : arguments)
      if (!argument.is_positional && argument.group == group) options += entry(argument);
  }
  return (positionals.empty() ? "" : ".SH ARGUMENTS\n" + positionals) + ".SH OPTIONS\n" + options;
}

/// The end of the help: indented lines are examples, the others notes.
std::string footer(const std::string& text) {
  std::string examples, notes;
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);)
    if (line.starts_with("  "))
      examples += plain(line.substr(2)) + '\n';
    else if (line != "Examples:")
      notes += ".PP\n" + plain(line) + '\n';
  if (!examples.empty()) examples = ".SH EXAMPLES\n.nf\n" + examples + ".fi\n";
  return (notes.empty() ? "" : ".SH NOTES\n" + notes) + examples;
}

}  // namespace

std::string manual_file(const CLI::App& program, const CLI::App* command) { return page_name(program, command) + ".1"; }

std::string manual_page(const CLI::App& program, const CLI::App* command) {
  std::string text = heading(program, command) + synopsis(program, command);
  if (!command) {
    text += ".SH COMMANDS\nEach has a page of its own, " + bold("skeletex-COMMAND") + "(1).\n";
    for (const CLI::App* one : commands_of(program))
      text += ".TP\n" + bold(one->get_name()) + '\n' + plain(one->get_description()) + '\n';
  }
  text += arguments_text(command ? *command : program) + footer(command ? command->get_footer() : program.get_footer());
  if (command) text += ".SH SEE ALSO\n" + bold(program.get_name()) + "(1)\n";
  return text;
}

}  // namespace skeletex::cli
