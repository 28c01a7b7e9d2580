// SPDX-License-Identifier: MIT
#include "describe/completions.h"

#include <memory>

#include "command.h"
#include "files.h"
#include "skeletex/io/atomic_file.h"

namespace skeletex::cli {
namespace {

struct Arguments {
  std::string shell, output = "-";
};

}  // namespace

void add_completions_command(CLI::App& program) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App& command = *program.add_subcommand(
      "completions", "Print a script with which a shell completes commands, options, their words and files");
  take_one_of(*command.add_option("SHELL", arguments->shell, "the shell: bash, zsh or fish")->required(), shells());
  declare_text_output(command, command.add_option("-o,--output", arguments->output,
                                                  "write it to this file (default: -, standard output)"))
      ->type_name("FILE|-");
  command.footer(
      "Examples:\n"
      "  source <(skeletex completions bash)\n"
      "  skeletex completions fish -o ~/.config/fish/completions/skeletex.fish\n"
      "  skeletex completions zsh -o ~/.zfunc/_skeletex\n"
      "Installed packages bring all three along. That of zsh goes into a folder of $fpath.");
  command.callback([arguments, &program] {
    const std::string script = completions(program, arguments->shell);
    if (arguments->output == "-")
      print("", script);
    else
      write_text_atomically(arguments->output, script);
  });
}

}  // namespace skeletex::cli
