// SPDX-License-Identifier: MIT
#include "describe/completions.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>

#include "command.h"
#include "describe/argument.h"

namespace skeletex::cli {
namespace {

using Paths = Argument::Paths;

std::string joined(const std::vector<std::string>& words) { return fmt::format("{}", fmt::join(words, " ")); }

/// In single quotes, as the shell `bash` or `zsh` reads it.
std::string shell_quoted(const std::string& text) { return '\'' + replaced(text, "'", R"('\'')") + '\''; }
std::string fish_quoted(const std::string& text) {
  return '\'' + replaced(replaced(text, "\\", "\\\\"), "'", "\\'") + '\'';
}

/// The positionals of a command (`is_positional`) or its options.
std::vector<Argument> some_of(const CLI::App& command, bool is_positional) {
  std::vector<Argument> arguments = arguments_of(command);
  std::erase_if(arguments, [&](const Argument& argument) { return argument.is_positional != is_positional; });
  return arguments;
}

std::vector<std::string> option_names(const CLI::App& command, bool has_value_only) {
  std::vector<std::string> names;
  for (const Argument& option : some_of(command, false))
    if (!has_value_only || !option.value.empty()) names.insert(names.end(), option.names.begin(), option.names.end());
  return names;
}

/// What completes a value: a statement of the shell.
std::string bash_value(const Argument& argument) {
  if (argument.paths != Paths::kNone) return argument.paths == Paths::kFolder ? "paths=d" : "paths=f";
  return argument.words.empty() ? ":" : "words=" + shell_quoted(joined(argument.words));
}

std::string bash_completions(const CLI::App& program) {
  std::string options, valued, values, positionals;
  for (const CLI::App* command : commands_of(program)) {
    const std::string& name = command->get_name();
    options += fmt::format("        {}) words={} ;;\n", name, shell_quoted(joined(option_names(*command, false))));
    valued +=
        fmt::format("      {}) valued={} ;;\n", name, shell_quoted(' ' + joined(option_names(*command, true)) + ' '));
    for (const Argument& option : some_of(*command, false)) {
      if (option.value.empty()) continue;
      std::vector<std::string> patterns;
      for (const std::string& spelled : option.names) patterns.push_back(shell_quoted(name + ' ' + spelled));
      values += fmt::format("    {}) {} ;;\n", fmt::join(patterns, "|"), bash_value(option));
    }
    int place = 0;
    for (const Argument& positional : some_of(*command, true))
      positionals +=
          fmt::format("        {}) {} ;;\n",
                      positional.is_repeated ? shell_quoted(name + ' ') + '*' : fmt::format("'{} {}'", name, place++),
                      bash_value(positional));
  }
  return fmt::format(R"(# Completions of skeletex for bash, made by `skeletex completions bash`.
_skeletex() {{
  local current=${{COMP_WORDS[COMP_CWORD]}} previous=${{COMP_WORDS[COMP_CWORD-1]}} command=${{COMP_WORDS[1]}}
  local words='' paths='' valued='' i place=0
  COMPREPLY=()
  # bash takes --option=value apart.
  [[ $current == = ]] && current=''
  [[ $previous == = ]] && previous=${{COMP_WORDS[COMP_CWORD-2]}}
  if ((COMP_CWORD == 1)); then
    mapfile -t COMPREPLY < <(compgen -W {} -- "$current")
    return
  fi
  case "$command $previous" in
{}    *)
      if [[ $current == -* ]]; then
        case $command in
{}        esac
      else
        case $command in
{}        esac
        for ((i = 2; i < COMP_CWORD; i++)); do
          if [[ ${{COMP_WORDS[i]}} != -* ]]; then
            ((place++))
          elif [[ ${{COMP_WORDS[i + 1]}} == = ]]; then
            ((i += 2))
          elif [[ $valued == *" ${{COMP_WORDS[i]}} "* ]]; then
            ((i++))
          fi
        done
        case "$command $place" in
{}        esac
      fi
      ;;
  esac
  if [[ $paths ]]; then
    compopt -o filenames 2>/dev/null
    mapfile -t COMPREPLY < <(compgen -$paths -- "$current")
  else
    mapfile -t COMPREPLY < <(compgen -W "$words" -- "$current")
  fi
}}
complete -F _skeletex skeletex
)",
                     shell_quoted(joined(command_names(program)) + ' ' + joined(option_names(program, false))), values,
                     options, replaced(valued, "      ", "        "), positionals);
}

/// Text within a specification of _arguments.
std::string zsh_text(std::string text) {
  for (const char* special : {"\\", "[", "]", ":"}) text = replaced(text, special, std::string("\\") + special);
  return text;
}

std::string zsh_value(const Argument& argument) {
  if (argument.paths != Paths::kNone) return argument.paths == Paths::kFolder ? "_files -/" : "_files";
  return argument.words.empty() ? " " : '(' + joined(argument.words) + ')';
}

/// The specifications of a command's arguments, each on a line of its own.
std::string zsh_arguments(const CLI::App& command, const std::string& indent) {
  std::string text;
  for (const Argument& option : some_of(command, false))
    for (const std::string& name : option.names) {
      const std::string others = option.is_repeated ? "*" : '(' + joined(option.names) + ')';
      std::string spec = others + name + (!option.value.empty() && name.starts_with("--") ? "=" : "") + '[' +
                         zsh_text(option.description) + ']';
      if (!option.value.empty()) spec += ':' + zsh_text(option.value) + ':' + zsh_value(option);
      text += " \\\n" + indent + shell_quoted(spec);
    }
  int place = 0;
  for (const Argument& positional : some_of(command, true))
    text += " \\\n" + indent +
            shell_quoted(fmt::format("{}:{}:{}", positional.is_repeated ? "*" : std::to_string(++place),
                                     zsh_text(positional.names[0]), zsh_value(positional)));
  return text;
}

std::string zsh_completions(const CLI::App& program) {
  std::string names, arguments;
  for (const CLI::App* command : commands_of(program)) {
    names += "        " + shell_quoted(command->get_name() + ':' + zsh_text(command->get_description())) + '\n';
    arguments += fmt::format("        {})\n          _arguments{}\n          ;;\n", command->get_name(),
                             zsh_arguments(*command, "            "));
  }
  return fmt::format(R"(#compdef skeletex
# Completions of skeletex for zsh, made by `skeletex completions zsh`.
_skeletex() {{
  local context state state_descr line
  local -A opt_args
  local -a commands
  _arguments -C{} \
    '1:command:->command' \
    '*::argument:->argument' && return
  case $state in
    command)
      commands=(
{}      )
      _describe command commands
      ;;
    argument)
      case $words[1] in
{}      esac
      ;;
  esac
}}
_skeletex "$@"
)",
                     zsh_arguments(program, "    "), names, arguments);
}

/// A line `complete` for one argument of a command.
std::string fish_line(const std::string& condition, const Argument& argument) {
  std::string line = "complete -c skeletex -n " + fish_quoted(condition);
  for (const std::string& name : argument.names)
    if (!argument.is_positional) line += name.starts_with("--") ? " -l " + name.substr(2) : " -s " + name.substr(1);
  if (argument.paths != Paths::kNone)
    line += argument.paths == Paths::kFolder ? " -x -a '(__fish_complete_directories)'"
            : argument.is_positional         ? " -F"
                                             : " -r -F";
  else if (!argument.words.empty())
    line += std::string(argument.is_positional ? "" : " -x") + " -a " + fish_quoted(joined(argument.words));
  else if (argument.is_positional)
    return "";
  else if (!argument.value.empty())
    line += " -x";
  if (!argument.is_positional) line += " -d " + fish_quoted(argument.description);
  return line + '\n';
}

std::string fish_completions(const CLI::App& program) {
  std::string text = R"(# Completions of skeletex for fish, made by `skeletex completions fish`.
function __skeletex_runs
  set -l words (commandline -opc)
  test "$words[2]" = "$argv[1]"
end
complete -c skeletex -f
)";
  const std::string no_command = "__skeletex_runs ''";
  for (const Argument& option : some_of(program, false)) text += fish_line(no_command, option);
  for (const CLI::App* command : commands_of(program))
    text += fmt::format("complete -c skeletex -n {} -a {} -d {}\n", fish_quoted(no_command), command->get_name(),
                        fish_quoted(command->get_description()));
  for (const CLI::App* command : commands_of(program))
    for (const Argument& argument : arguments_of(*command))
      text += fish_line("__skeletex_runs " + command->get_name(), argument);
  return text;
}

}  // namespace

const std::vector<std::string>& shells() {
  static const std::vector<std::string> all{"bash", "zsh", "fish"};
  return all;
}

std::string completions(const CLI::App& program, const std::string& shell) {
  return shell == "bash"  ? bash_completions(program)
         : shell == "zsh" ? zsh_completions(program)
                          : fish_completions(program);
}

}  // namespace skeletex::cli
