// SPDX-License-Identifier: MIT
#include <fmt/format.h>
#include <spdlog/pattern_formatter.h>
#include <spdlog/sinks/stdout_color_sinks.h>
#include <spdlog/spdlog.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <memory>
#include <new>

#include "command.h"
#include "help_formatter.h"
#include "skeletex/io/suggestion.h"
#include "skeletex/model/error.h"
#include "skeletex/model/memory.h"

namespace skeletex::cli {
namespace {

/// Reports a mistyped command or option with the nearest name before the parser, whose message has none.
/// \param chosen  the command's name, as soon as it is known
void check_names(const CLI::App& program, int argc, char** argv, std::string& chosen) {
  const CLI::App* app = &program;
  for (int i = 1; i < argc; ++i) {
    const std::string argument = argv[i];
    if (argument == "--") return;
    if (argument.starts_with("--")) {
      const std::string name = argument.substr(0, argument.find('='));
      std::vector<std::string> names;
      for (const CLI::Option* option : app->get_options())
        for (const std::string& known : option->get_lnames()) names.push_back("--" + known);
      if (std::find(names.begin(), names.end(), name) == names.end())
        throw CLI::ExtrasError(fmt::format("unknown option {}{}", name, did_you_mean(name, names)),
                               CLI::ExitCodes::ExtrasError);
    } else if (app == &program && !argument.starts_with('-')) {
      check_command(program, argument);
      app = program.get_subcommand(argument);
      chosen = argument + ' ';
    }
  }
}

/// The text of a message, printable: names in it come from files.
class PrintableText : public spdlog::custom_flag_formatter {
 public:
  void format(const spdlog::details::log_msg& message, const std::tm&, spdlog::memory_buf_t& out) override {
    const std::string text = printable({message.payload.data(), message.payload.size()});
    out.append(text.data(), text.data() + text.size());
  }
  std::unique_ptr<custom_flag_formatter> clone() const override { return std::make_unique<PrintableText>(); }
};

int run(int argc, char** argv) {
  CLI::App program("A closed triangle mesh and its skeleton as one displacement texture, and back.", "skeletex");
  program.set_version_flag("-v,--version", std::string("skeletex ") + SKELETEX_VERSION);
  program.require_subcommand(1);
  program.formatter(std::make_shared<HelpFormatter>());
  add_commands(program);
  program.footer(
      "`skeletex help COMMAND` tells more. Exit codes: 0 done, 1 input or run, 2 usage.\n"
      "Examples:\n"
      "  skeletex encode bear.off bear.skeleton.json -o bear.skx.exr\n"
      "  skeletex reconstruct bear.skx.exr -o bear.ply\n"
      "  skeletex metro bear.off bear.ply");
  std::string chosen;
  try {
    check_names(program, argc, argv, chosen);
    program.parse(argc, argv);
  } catch (const CLI::RuntimeError& end) {
    return end.get_exit_code();
  } catch (const CLI::ParseError& error) {
    if (error.get_exit_code() == 0) return program.exit(error);  // help and version
    spdlog::error("{}\nsee skeletex {}--help", error.what(), chosen);
    return kExitUsage;
  } catch (const Error& error) {
    spdlog::error("{}", error.what());
    return kExitBad;
  } catch (const std::bad_alloc&) {
    const AvailableMemory left = available_memory();
    spdlog::error("out of memory: {} leaves {} MiB; give it more, or ask for a smaller size", left.limit,
                  left.bytes >> 20);
    return kExitBad;
  } catch (const std::exception& error) {
    spdlog::error("unexpected: {}", error.what());
    return kExitBad;
  }
  if (std::fflush(stdout) != 0 || std::ferror(stdout)) {
    spdlog::error("standard output cannot be written; is the disk full?");
    return kExitBad;
  }
  return 0;
}

}  // namespace
}  // namespace skeletex::cli

int main(int argc, char** argv) {
  auto log = spdlog::stderr_color_mt("skeletex");
  auto pattern = std::make_unique<spdlog::pattern_formatter>();
  // On a terminal a message takes the place of the progress bar.
  pattern->add_flag<skeletex::cli::PrintableText>('*').set_pattern(
      std::string(::isatty(STDERR_FILENO) != 0 ? "\r\033[K" : "") + "%^%l:%$ %*");
  log->set_formatter(std::move(pattern));
  spdlog::set_default_logger(log);
  return skeletex::cli::run(argc, argv);
}
