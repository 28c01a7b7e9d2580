// SPDX-License-Identifier: MIT
#include <memory>

#include "command.h"

namespace skeletex::cli {

void add_help_command(CLI::App& program) {
  auto name = std::make_shared<std::string>();
  CLI::App& command = *program.add_subcommand("help", "Tell about a command, as its --help does, or about the program");
  command.add_option("COMMAND", *name, "the command; without one, the program is told about");
  command.footer("Examples:\n  skeletex help encode");
  command.callback([name, &program] {
    const CLI::App& about = name->empty() ? program : *program.get_subcommand(*name);
    const std::string words = name->empty() ? program.get_name() : program.get_name() + ' ' + *name;
    print("", program.get_formatter()->make_help(&about, words, CLI::AppFormatMode::Normal));
  });
}

}  // namespace skeletex::cli
