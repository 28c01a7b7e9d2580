// SPDX-License-Identifier: MIT
#include <fmt/format.h>
#include <unistd.h>

#include <cmath>
#include <cstdio>
#include <filesystem>
#include <memory>

#include "command.h"
#include "files.h"
#include "program_path.h"
#include "progress_bar.h"
#include "runner/run_experiment.h"
#include "skeletex/io/json_file.h"
#include "skeletex/io/read_file.h"
#include "skeletex/io/same_file.h"
#include "skeletex/model/error.h"
#include "table.h"

namespace skeletex::cli {
namespace {

namespace fs = std::filesystem;

struct Arguments {
  std::string config, output = "results", device, json, mesh, skeleton;
  std::vector<std::string> settings, only, models;
  bool is_quick = false, is_resumed = false, are_failures_allowed = false;
  int jobs = 1, shard = 1, shards = 1;
  double timeout = 0, memory = 0;
};

struct CollectArguments {
  std::vector<std::string> folders;
  std::string output, json;
  bool are_failures_allowed = false;
};

struct ReplayArguments {
  std::string record, output, device, json;
  double tolerance = 0.02;
  int jobs = 1;
};

std::string duration(double seconds) {
  const long whole = std::lround(seconds);
  return whole >= 3600 ? fmt::format("{} h {} min", whole / 3600, whole / 60 % 60)
         : whole >= 60 ? fmt::format("{} min {} s", whole / 60, whole % 60)
                       : fmt::format("{} s", whole);
}

/// A run's rows as a table, and why items failed.
std::string rows_text(const Experiment& experiment, const RunSummary& summary) {
  std::vector<std::string> head{experiment.name};
  for (const auto& [column, place] : experiment.columns) head.push_back(column);
  Table table(head);
  std::string reasons;
  for (const OrderedJson& row : summary.results.at("rows")) {
    std::vector<std::string> cells{row.at("key").get<std::string>()};
    for (const auto& [column, place] : experiment.columns) {
      const OrderedJson& value = row.at("columns").at(column);
      cells.push_back(value.is_null()           ? "-"
                      : value.is_number_float() ? fmt::format("{:.4g}", value.get<double>())
                      : value.is_string()       ? value.get<std::string>()
                                                : value.dump());
    }
    table.add(std::move(cells));
    if (row.at("status") == "failed")
      reasons += fmt::format("failed: {}: {}\n", row.at("key").get<std::string>(), row.at("reason").get<std::string>());
  }
  return table.text() + reasons;
}

std::string outcomes_text(const RunSummary& summary) {
  std::string text;
  for (const auto& [outcome, count] : summary.results.at("outcomes").items())
    text += fmt::format("{}{} {}", text.empty() ? "" : ", ", count.get<int>(), outcome);
  return text.empty() ? "no items" : text;
}

/// \throw CLI::ValidationError
void read_shard(const std::string& text, Arguments& arguments) {
  int end = 0;
  if (std::sscanf(text.c_str(), "%d/%d%n", &arguments.shard, &arguments.shards, &end) != 2 ||
      end != static_cast<int>(text.size()) || arguments.shard < 1 || arguments.shards < arguments.shard)
    throw CLI::ValidationError("--shard",
                               fmt::format("\"{}\" is no part; give I/N with 1 <= I <= N, such as 3/8", text));
}

RunSummary run_with_bar(const Experiment& experiment, RunOptions options) {
  ProgressBar bar;
  bar.show(experiment.name, 0);
  options.program = program_path();
  options.progress = [&](int done, int total, const std::string& key, double seconds_left) {
    bar.show(fmt::format("{} {}/{} {}, {} left", experiment.name, done, total, key, duration(seconds_left)),
             static_cast<double>(done) / total);
  };
  return run_experiment(experiment, options);
}

ExperimentChanges changes_from(const OrderedJson& source) {
  ExperimentChanges changes;
  changes.settings = source.at("settings").get<std::vector<std::string>>();
  changes.only = source.at("only").get<std::vector<std::string>>();
  changes.is_quick = source.at("quick").get<bool>();
  for (const auto& model : source.at("models"))
    changes.models.push_back({model.at("name").get<std::string>(), model.at("mesh").get<std::string>(),
                              model.at("skeleton").get<std::string>(), "", nlohmann::json(model.at("view"))});
  return changes;
}

/// What a run writes may not be what it reads: its config, and the meshes and skeletons of its models.
void check_results(const CLI::App& command, const Experiment& experiment, const fs::path& folder) {
  for (const char* name : {"results.json", "results.csv", "record.json"}) {
    const std::string path = (folder / name).string();
    check_made_output(command, path);
    for (const ModelConfig& model : experiment.models)
      for (const fs::path& input : {model.mesh, model.skeleton})
        if (!input.empty() && is_same_file(input, path))
          throw CLI::ValidationError("--output",
                                     fmt::format("{} of model {} would be replaced by the results; name another folder",
                                                 input.string(), model.name));
  }
}

void run(const Arguments& arguments, const CLI::App& command) {
  OrderedJson source{{"config", ""},
                     {"settings", arguments.settings},
                     {"only", arguments.only},
                     {"quick", arguments.is_quick},
                     {"models", OrderedJson::array()}};
  if (arguments.timeout > 0) source["settings"].push_back(fmt::format("limits.seconds={}", arguments.timeout));
  if (arguments.memory > 0) source["settings"].push_back(fmt::format("limits.memory_mb={}", arguments.memory));
  const auto add_model = [&](const ModelConfig& model) {
    source["models"].push_back({{"name", model.name},
                                {"mesh", model.mesh.string()},
                                {"skeleton", model.skeleton.string()},
                                {"view", OrderedJson(model.view)}});
  };
  if (!arguments.mesh.empty())
    add_model({fs::path(arguments.mesh).stem().string(), arguments.mesh, arguments.skeleton, "", nlohmann::json()});
  for (const std::string& model : arguments.models)
    add_model(
        find_model(model, has_ending(model, ".json") ? "." : fs::path(arguments.config).parent_path() / "experiments"));
  Json report = Json::array();
  int failed = 0;
  for (const fs::path& file : experiment_files(arguments.config)) {
    source["config"] = file.string();
    Experiment experiment = read_experiment(file, changes_from(source));
    RunOptions options{.program = "",
                       .folder = fs::path(arguments.output) / experiment.name,
                       .is_resumed = arguments.is_resumed,
                       .jobs = arguments.jobs,
                       .shard = arguments.shard,
                       .shards = arguments.shards,
                       .device = arguments.device,
                       .source = source,
                       .progress = {}};
    check_results(command, experiment, options.folder);
    const RunSummary summary = run_with_bar(experiment, options);
    failed += summary.failed;
    print(arguments.json, fmt::format("{}{} ({} kept): {}\n\n", rows_text(experiment, summary), outcomes_text(summary),
                                      summary.kept, options.folder.string()));
    report.push_back({{"experiment", experiment.name},
                      {"folder", options.folder.string()},
                      {"done", summary.done},
                      {"kept", summary.kept},
                      {"failed", summary.failed},
                      {"outcomes", summary.results.at("outcomes")}});
  }
  write_json(arguments.json, report);
  if (failed > 0 && !arguments.are_failures_allowed) throw CLI::RuntimeError(kExitBad);
}

void collect(const CollectArguments& arguments) {
  const std::vector<fs::path> folders(arguments.folders.begin(), arguments.folders.end());
  if (folders.size() > 1 && arguments.output.empty())
    throw CLI::ValidationError("--output", "is needed for several folders: name another one, which gets all results");
  const fs::path out = arguments.output.empty() ? folders[0] : fs::path(arguments.output);
  const auto [experiment, summary] = collect_shards(folders, out);
  print(arguments.json,
        fmt::format("{}{}: {}\n", rows_text(experiment, summary), outcomes_text(summary), out.string()));
  write_json(arguments.json, {{"experiment", experiment.name},
                              {"folder", out.string()},
                              {"done", summary.done},
                              {"failed", summary.failed},
                              {"outcomes", summary.results.at("outcomes")}});
  if (summary.failed > 0 && !arguments.are_failures_allowed) throw CLI::RuntimeError(kExitBad);
}

void replay(const ReplayArguments& arguments, const CLI::App& command) {
  const fs::path path =
      fs::is_directory(arguments.record) ? fs::path(arguments.record) / "record.json" : fs::path(arguments.record);
  const auto load = [](const fs::path& file) {
    const std::string text = read_file(file);
    parse_json(text, file.string());
    return OrderedJson::parse(text);
  };
  const OrderedJson record = load(path), expected = load(path.parent_path() / "results.json");
  if (!record.is_object() || !record.contains("source") || !record.at("source").is_object())
    throw IoError(path.string() + ": no record of a run; it lacks \"source\"");
  const OrderedJson& source = record.at("source");
  const Experiment experiment = read_experiment(source.at("config").get<std::string>(), changes_from(source));
  const fs::path folder = arguments.output.empty() ? path.parent_path() / "replay" : fs::path(arguments.output);
  if (is_same_file(folder, path.parent_path().empty() ? "." : path.parent_path()))
    throw CLI::ValidationError(
        "--output", fmt::format("\"{}\" holds RECORD, which would be lost; name another folder", folder.string()));
  check_results(command, experiment, folder);
  const RunSummary summary = run_with_bar(experiment, {.program = "",
                                                       .folder = folder,
                                                       .is_resumed = false,
                                                       .jobs = arguments.jobs,
                                                       .shard = 1,
                                                       .shards = 1,
                                                       .device = arguments.device,
                                                       .source = source,
                                                       .progress = {}});
  const std::vector<std::string> differences = compare_results(expected, summary.results, arguments.tolerance);
  std::string text;
  for (const std::string& difference : differences) text += difference + '\n';
  print(arguments.json,
        fmt::format("{}{}: {} rows, {} differences above {:.2g} %: {}\n", text, experiment.name,
                    summary.results.at("rows").size(), differences.size(), 100 * arguments.tolerance, folder.string()));
  write_json(arguments.json, {{"experiment", experiment.name},
                              {"rows", summary.results.at("rows").size()},
                              {"differences", differences},
                              {"folder", folder.string()}});
  if (!differences.empty()) throw CLI::RuntimeError(kExitBad);
}

}  // namespace

void add_run_command(CLI::App& program) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App& command = *program.add_subcommand("run", "Run an experiment, or a list of them, from its JSON");
  declare_input(command, command.add_option("CONFIG", arguments->config,
                                            "experiment or list: .json (configs/experiments, configs/paper.json)"))
      ->required();
  declare_output_folder(
      command, command.add_option("-o,--output", arguments->output, "results go to FOLDER/NAME (default: results)"))
      ->type_name("FOLDER");
  command.add_option("--set", arguments->settings, "change a value of the experiment: sweep.size=[64,128]")
      ->type_name("KEY=VALUE")
      ->take_all();
  command.add_flag("--quick", arguments->is_quick, "the experiment's own quick settings");
  command.add_flag("--resume", arguments->is_resumed,
                   "keep items that the same commit has done with the same commands and inputs");
  command.add_option("--jobs", arguments->jobs, "items at a time; timings want 1")
      ->check(number_in(1, 256))
      ->type_name("N");
  command
      .add_option_function<std::string>(
          "--shard", [arguments](const std::string& text) { read_shard(text, *arguments); },
          "only part I of N of the items; `skeletex collect` joins the parts")
      ->type_name("I/N");
  command.add_option("--timeout", arguments->timeout, "seconds that an item may take")
      ->check(number_above(0))
      ->type_name("SECONDS");
  command.add_option("--memory", arguments->memory, "addresses that each process of an item may take (ulimit -v)")
      ->check(number_above(0))
      ->type_name("MB");
  command.add_flag("--allow-failures", arguments->are_failures_allowed,
                   "failed items are results: end with 0 all the same");
  command.add_option("--only", arguments->only, "only this model of the experiment's")->type_name("MODEL")->take_all();
  command
      .add_option("--model", arguments->models,
                  "this model instead: a name, or a .json with name, mesh, skeleton, view")
      ->type_name("MODEL")
      ->take_all();
  CLI::Option* mesh =
      declare_input(command, command.add_option("--mesh", arguments->mesh, "your own mesh instead, with --skeleton"))
          ->type_name("FILE");
  CLI::Option* skeleton = declare_input(command, command.add_option("--skeleton", arguments->skeleton, "its skeleton"))
                              ->type_name("FILE")
                              ->needs(mesh);
  mesh->needs(skeleton);
  add_device_option(command, arguments->device);
  add_json_option(command, arguments->json);
  command.footer(
      "Examples:\n"
      "  skeletex run configs/experiments/fidelity.json --only bear --set sweep.size=[64,128]\n"
      "  skeletex run configs/experiments/fidelity.json --mesh my.obj --skeleton my.skeleton.json -o mine\n"
      "  skeletex run configs/paper.json --quick --resume\n"
      "  skeletex run configs/experiments/fidelity.json --shard 1/2; .. --shard 2/2; skeletex collect "
      "results/fidelity\n"
      "Writes results.json, results.csv, record.json and items/. A failed item is recorded and does not stop the rest; "
      "then the exit code is 1.");
  command.callback([arguments, &command] { run(*arguments, command); });
}

void add_collect_command(CLI::App& program) {
  auto arguments = std::make_shared<CollectArguments>();
  CLI::App& command = *program.add_subcommand("collect", "Join the results of all shards of an experiment");
  declare_input(command, command.add_option("FOLDER", arguments->folders,
                                            "where shards have written to: results/NAME, of each machine"))
      ->required();
  declare_output_folder(command, command.add_option("-o,--output", arguments->output,
                                                    "another folder, for all results (default: FOLDER, if only one)"))
      ->type_name("FOLDER");
  command.add_flag("--allow-failures", arguments->are_failures_allowed,
                   "failed items are results: end with 0 all the same");
  add_json_option(command, arguments->json);
  command.footer(
      "Example:\n"
      "  skeletex collect a/fidelity b/fidelity -o results/fidelity\n"
      "Writes results.json, results.csv and record.json as one run would have.");
  command.callback([arguments] { collect(*arguments); });
}

void add_replay_command(CLI::App& program) {
  auto arguments = std::make_shared<ReplayArguments>();
  CLI::App& command = *program.add_subcommand("replay", "Run an experiment again from its record and compare");
  declare_input(command, command.add_option("RECORD", arguments->record, "record.json of a run, or its folder"))
      ->required();
  declare_output_folder(command, command.add_option("-o,--output", arguments->output,
                                                    "folder of the new run (default: replay, beside the record)"))
      ->type_name("FOLDER");
  command
      .add_option("--tolerance", arguments->tolerance,
                  "relative difference of numbers that counts as the same (default: 0.02)")
      ->check(number_from(0))
      ->type_name("X");
  command.add_option("--jobs", arguments->jobs, "items at a time")->check(number_in(1, 256))->type_name("N");
  add_device_option(command, arguments->device);
  add_json_option(command, arguments->json);
  command.footer(
      "Example:\n  skeletex replay results/fidelity\nTimes and memory (columns that end in _ms, _s, _mb) are not "
      "compared.");
  command.callback([arguments, &command] { replay(*arguments, command); });
}

}  // namespace skeletex::cli
