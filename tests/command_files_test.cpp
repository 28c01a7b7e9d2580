// SPDX-License-Identifier: MIT
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <sstream>

#include "command.h"
#include "files.h"
#include "support/scratch.h"

namespace skeletex::cli {
namespace {

namespace fs = std::filesystem;

/// A value that the parser takes for an option that must be there and names no file.
std::string any_value(const CLI::Option& option) {
  const std::string type = option.get_type_name();
  if (option.get_items_expected_max() == 0) return "";  // a flag
  if (type.find('|') != std::string::npos) return type.substr(0, type.find('|'));
  if (type.starts_with("A=B")) return "a=b";
  ADD_FAILURE() << "any_value does not know what to give " << option_name(option) << " of type " << type;
  return "1";
}

/// Goes through the declarations of all commands: what is added later is tested without a word here.
class CommandFiles : public ::testing::Test {
 protected:
  struct Checked {};  ///< thrown in place of running a command
  /// One for all tests, as declarations are kept as long as the process.
  static CLI::App& program() {
    static CLI::App app;
    static const bool is_ready = [] {
      add_commands(app);
      for (CLI::App* command : app.get_subcommands([](const CLI::App*) { return true; }))
        command->parse_complete_callback([command] {
          check_files(*command);
          throw Checked();
        });
      return true;
    }();
    EXPECT_TRUE(is_ready);
    return app;
  }
  static std::vector<CLI::App*> commands() {
    return program().get_subcommands([](const CLI::App*) { return true; });
  }
  /// \param given  options and their values; those that the command needs besides get values of their own
  std::vector<std::string> arguments(const CLI::App& command,
                                     std::vector<std::pair<const CLI::Option*, std::string>> given) {
    const auto is_given = [&](const CLI::Option* option) {
      return std::any_of(given.begin(), given.end(), [&](const auto& entry) { return entry.first == option; });
    };
    const auto file_of = [&](const CLI::Option* option) -> const FileOption* {
      for (const FileOption& file : files_of(command))
        if (file.option == option) return &file;
      return nullptr;
    };
    const auto give = [&](const CLI::Option* option) {
      if (is_given(option)) return;
      const FileOption* file = file_of(option);
      const std::string name =
          "own_" + std::to_string(given.size()) + (file && !file->endings.empty() ? file->endings[0] : "");
      given.emplace_back(option, file ? (folder_ / name).string() : any_value(*option));
    };
    for (std::size_t i = 0; i < given.size(); ++i)
      for (const CLI::Option* needed : given[i].first->get_needs()) give(needed);
    bool needs_positionals = false;
    const std::vector<const CLI::Option*> options = command.get_options();
    for (auto option = options.rbegin(); option != options.rend(); ++option) {
      needs_positionals |= (*option)->get_positional() && is_given(*option);  // those before it as well
      if ((*option)->get_required() || ((*option)->get_positional() && needs_positionals)) give(*option);
    }
    std::vector<std::string> words{command.get_name()}, positionals;
    for (const CLI::Option* option : options)
      for (const auto& [chosen, value] : given) {
        if (chosen != option) continue;
        if (option->get_lnames().empty()) {
          for (int i = 0; i < std::max(1, option->get_items_expected_min()); ++i)
            positionals.push_back(i == 0 ? value : (folder_ / ("more_" + std::to_string(i))).string());
        } else {
          words.push_back(option_name(*option));
          if (option->get_items_expected_max() > 0) words.push_back(value);
        }
      }
    words.insert(words.end(), positionals.begin(), positionals.end());
    return words;
  }
  /// What the parser says before the command does anything; empty: nothing.
  std::string complaint(std::vector<std::string> words) {
    std::reverse(words.begin(), words.end());
    try {
      program().parse(words);
    } catch (const CLI::ValidationError& error) {
      return error.what();
    } catch (const Checked&) {
      return "";
    } catch (const std::exception& error) {
      return std::string("another error: ") + error.what();
    }
    return "nothing was checked";
  }
  std::string content(const fs::path& path) {
    std::ostringstream text;
    text << std::ifstream(path).rdbuf();
    return text.str();
  }

  ScratchFolder folder_;
};

TEST_F(CommandFiles, NoOutputIsAnInputOrAnotherOutput) {
  const fs::path file = folder_ / "precious", symbolic = folder_ / "symbolic", hard = folder_ / "hard",
                 missing = folder_ / "missing", dangling = folder_ / "dangling";
  std::ofstream(file) << "a day's work";
  fs::create_symlink(file, symbolic);
  fs::create_hard_link(file, hard);
  fs::create_symlink(missing, dangling);
  const int files = folder_.file_count();
  const fs::path roundabout = folder_ / "." / "precious";
  int pairs = 0;
  for (const CLI::App* command : commands())
    for (const FileOption& output : files_of(*command)) {
      if (!output.is_output) continue;
      for (const FileOption& other : files_of(*command)) {
        if (&other == &output || output.option->get_excludes().count(const_cast<CLI::Option*>(other.option)) > 0)
          continue;
        ++pairs;
        for (const auto& [first, second] : {std::pair{file, file},
                                            {symbolic, file},
                                            {file, symbolic},
                                            {hard, file},
                                            {roundabout, file},
                                            {missing, missing},
                                            {dangling, missing}}) {
          const std::vector<std::string> words =
              arguments(*command, {{output.option, first.string()}, {other.option, second.string()}});
          const std::string said = complaint(words);
          EXPECT_TRUE(said.find(option_name(*output.option)) != std::string::npos &&
                      said.find(option_name(*other.option)) != std::string::npos)
              << command->get_name() << " " << option_name(*output.option) << " " << first << ", "
              << option_name(*other.option) << " " << second << ": \"" << said << '"';
        }
      }
    }
  EXPECT_GE(pairs, 40);
  EXPECT_EQ(content(file), "a day's work");
  EXPECT_EQ(folder_.file_count(), files);
}

TEST_F(CommandFiles, OutputsEndAsTheyAreWrittenAndOnlyTextGoesToStandardOutput) {
  int outputs = 0;
  for (const CLI::App* command : commands())
    for (const FileOption& output : files_of(*command)) {
      if (!output.is_output || output.is_folder) continue;
      const std::string streamed = complaint(arguments(*command, {{output.option, "-"}}));
      EXPECT_EQ(output.can_be_stream, streamed.empty())
          << command->get_name() << " " << option_name(*output.option) << ": " << streamed;
      if (output.endings.empty()) continue;
      ++outputs;
      const std::string said = complaint(arguments(*command, {{output.option, (folder_ / "result.doc").string()}}));
      for (const std::string& ending : output.endings)
        EXPECT_NE(said.find(ending), std::string::npos) << command->get_name() << ": " << said;
      for (const std::string& ending : output.endings)
        EXPECT_EQ(complaint(arguments(*command, {{output.option, (folder_ / ("result" + ending)).string()}})), "")
            << command->get_name();
      for (std::string ending : output.endings) {
        for (char& c : ending) c = static_cast<char>(std::toupper(static_cast<unsigned char>(c)));
        EXPECT_EQ(complaint(arguments(*command, {{output.option, (folder_ / ("result" + ending)).string()}})), "")
            << command->get_name();
      }
    }
  EXPECT_GE(outputs, 8);
  EXPECT_EQ(folder_.file_count(), 0);
}

TEST_F(CommandFiles, EveryCommandDeclaresItsFiles) {
  for (const CLI::App* command : commands())
    for (const CLI::Option* option : command->get_options()) {
      const std::string type = option->get_type_name();
      if (type.find("FILE") == std::string::npos && type.find("FOLDER") == std::string::npos) continue;
      EXPECT_TRUE(std::any_of(files_of(*command).begin(), files_of(*command).end(),
                              [&](const FileOption& file) { return file.option == option; }))
          << command->get_name() << " " << option_name(*option) << " names a file that it does not declare";
    }
}

TEST_F(CommandFiles, NumbersAreFiniteAndWithinTheirLimits) {
  // Options of a number have N, X, T, D, K, W or DEG as their type, lists of them "T,..".
  const std::vector<std::string> types{"N", "X", "T", "D", "K", "W", "DEG", "T,..", "W,W,.."};
  int options = 0;
  for (const CLI::App* command : commands())
    for (const CLI::Option* option : command->get_options()) {
      if (std::find(types.begin(), types.end(), option->get_type_name()) == types.end()) continue;
      ++options;
      for (const char* bad : {"nan", "inf", "-inf", "1e400", "", "1x", " 1"}) {
        const std::string said = complaint(arguments(*command, {{option, bad}}));
        EXPECT_NE(said.find(option_name(*option)), std::string::npos)
            << command->get_name() << " " << option_name(*option) << " \"" << bad << "\": " << said;
      }
    }
  EXPECT_GE(options, 30);
}

}  // namespace
}  // namespace skeletex::cli
