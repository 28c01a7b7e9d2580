// SPDX-License-Identifier: MIT
#include "describe/manual.h"

#include <fmt/format.h>

#include <filesystem>
#include <memory>

#include "command.h"
#include "describe/argument.h"
#include "files.h"
#include "skeletex/io/atomic_file.h"
#include "skeletex/model/error.h"

namespace skeletex::cli {
namespace {

struct Arguments {
  std::string command, output;
};

void write_pages(const CLI::App& program, const std::filesystem::path& folder) {
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error) throw IoError(fmt::format("{}: the folder cannot be made: {}", folder.string(), error.message()));
  write_text_atomically(folder / manual_file(program, nullptr), manual_page(program, nullptr));
  for (const CLI::App* command : commands_of(program))
    write_text_atomically(folder / manual_file(program, command), manual_page(program, command));
}

}  // namespace

void add_manual_command(CLI::App& program) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App& command =
      *program.add_subcommand("manual", "Print a manual page for man, of the program or of a command, or write all");
  CLI::Option* name =
      command.add_option("COMMAND", arguments->command, "the command; without one, the program's own page");
  declare_output_folder(command, command.add_option("-o,--output", arguments->output,
                                                    "folder that all pages are written to: skeletex.1 and "
                                                    "skeletex-COMMAND.1 of each command"))
      ->type_name("FOLDER")
      ->excludes(name);
  command.footer(
      "Examples:\n"
      "  skeletex manual encode | man -l -\n"
      "  skeletex manual -o ~/.local/share/man/man1\n"
      "Installed packages bring all pages along: `man skeletex-encode`.");
  command.callback([arguments, &program] {
    if (!arguments->output.empty())
      write_pages(program, arguments->output);
    else
      print("",
            manual_page(program, arguments->command.empty() ? nullptr : program.get_subcommand(arguments->command)));
  });
}

}  // namespace skeletex::cli
