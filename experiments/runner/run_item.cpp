// SPDX-License-Identifier: MIT
#include "run_item.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <csignal>

#include "json_files.h"
#include "process.h"
#include "results.h"
#include "skeletex/io/atomic_file.h"
#include "skeletex/model/error.h"
#include "work_folder.h"

namespace skeletex {
namespace {

namespace fs = std::filesystem;

/// Exit code of programs whose command line is not understood.
constexpr int kUsageError = 2;

std::string program_of(const Step& step, const RunOptions& options) {
  if (step.tool.empty()) return options.program;
  const fs::path beside = fs::path(options.program).parent_path() / step.tool;
  return fs::is_regular_file(beside) ? beside.string() : step.tool;
}

/// Writes the files of the item's own, {view} and {config}.
/// \return their paths by these names, and those of {work} and {out}
std::map<std::string, std::string> make_files(const Experiment& experiment, const Item& item, const fs::path& work,
                                              const fs::path& results) {
  std::map<std::string, std::string> more{{"work", work.string()}, {"out", results.string()}};
  if (item.model < 0) return more;
  const ModelConfig& model = experiment.models[item.model];
  const OrderedJson view = model.view.is_null() ? OrderedJson::object() : OrderedJson(model.view);
  more["view"] = (work / "view.json").string();
  write_json_file(more["view"], view);
  more["config"] = (work / "model.json").string();
  OrderedJson config{{"name", model.name}, {"mesh", fs::absolute(model.mesh).string()}};
  if (!model.skeleton.empty()) config["skeleton"] = fs::absolute(model.skeleton).string();
  config.update({{"credits", model.credits}, {"view", view}});
  write_json_file(more["config"], config);
  return more;
}

/// How a step ended: outcome and reason, both "" where it ended as it should.
struct Ending {
  std::string outcome, reason;
};

Ending ending_of(const Step& step, const ProcessResult& process, const ItemLimits& limits) {
  if (process.is_out_of_time)
    return {"out of time", fmt::format("took longer than {} s, within step {}", limits.seconds, step.name)};
  if (process.exit_code == step.exit_code) return {};
  const bool is_signal = process.exit_code > 128;
  std::string reason = is_signal                ? fmt::format("ended by signal {}", process.exit_code - 128)
                       : process.errors.empty() ? fmt::format("exit code {}", process.exit_code)
                                                : process.errors;
  if (tells_of_memory(process.errors)) return {"out of memory", process.errors};
  // Nobody but the system kills a step, and it does for want of memory.
  if (process.exit_code == 128 + SIGKILL) return {"out of memory", std::move(reason)};
  if (is_signal) return {"crashed", std::move(reason)};
  if (process.exit_code == 0) return {"wrong", fmt::format("succeeded; exit code {} is right", step.exit_code)};
  // A mistake in the experiment is no fault of the model.
  if (process.exit_code == kUsageError) return {"wrong", std::move(reason)};
  return {"refused", std::move(reason)};
}

/// Runs the steps of an item one by one and gathers what they report.
struct StepRunner {
  const Experiment& experiment;
  const Item& item;
  const RunOptions& options;
  const std::map<std::string, std::string>&more, &environment;
  fs::path work;
  std::string log;
  double seconds, peak_memory_mb;
  OrderedJson steps;

  Ending run(const Step& step) {
    std::vector<std::string> arguments = fill_arguments(experiment, item, step.run, more);
    const fs::path report = work / (step.name + ".json");
    if (step.tool.empty()) {
      arguments.insert(arguments.end(), {"--json", report.string()});
      if (!options.device.empty()) arguments.insert(arguments.end(), {"--device", options.device});
    }
    const std::string program = program_of(step, options);
    ProcessResult process;
    Ending ending;
    try {
      const double most = experiment.limits.seconds;
      process = run_process(program, arguments, environment, work / "errors.txt",
                            {most > 0 ? std::max(most - seconds, 1e-3) : 0, experiment.limits.memory_mb});
      ending = ending_of(step, process, experiment.limits);
    } catch (const Error& error) {
      ending = {"refused", error.what()};
    }
    log += fmt::format("{}: {} {}\n{}{}{}: exit code {} after {:.3f} s, {:.0f} MB\n", step.name, program,
                       fmt::join(arguments, " "), process.errors, process.errors.empty() ? "" : "\n", step.name,
                       process.exit_code, process.seconds, process.peak_memory_mb);
    seconds += process.seconds;
    peak_memory_mb = std::max(peak_memory_mb, process.peak_memory_mb);
    OrderedJson reported = read_json_file(report).value_or(OrderedJson::object());
    steps[step.name] = reported.is_object() ? std::move(reported) : OrderedJson{{"result", std::move(reported)}};
    steps[step.name]["process"] = {{"seconds", process.seconds}, {"peak_memory_mb", process.peak_memory_mb}};
    if (step.exit_code != 0) steps[step.name]["process"]["errors"] = process.errors;
    if (!ending.outcome.empty()) return ending;
    for (const auto& [name, file] : step.file_sizes) {
      std::error_code code;
      const std::uintmax_t size = fs::file_size(fill_arguments(experiment, item, {file}, more)[0], code);
      steps[step.name][name] = code ? OrderedJson() : OrderedJson(size);
    }
    return ending;
  }
};

}  // namespace

bool tells_of_memory(const std::string& errors) {
  const auto holds = [&](const char* part) { return errors.find(part) != std::string::npos; };
  return holds("out of memory") || holds("of memory, and") || holds("(ulimit -v) leaves") || holds("bad_alloc") ||
         holds("Cannot allocate memory") || holds("MemoryError");
}

OrderedJson run_item(const Experiment& experiment, const Item& item, const RunOptions& options,
                     const OrderedJson& signature, const std::map<std::string, std::string>& environment) {
  const WorkFolder work;
  const std::map<std::string, std::string> more = make_files(experiment, item, work.path(), options.folder);
  OrderedJson result{{"key", item.key},
                     {"model", item.model < 0 ? OrderedJson() : OrderedJson(experiment.models[item.model].name)}};
  for (const auto& [name, label] : item.parameters) result["parameters"][name] = label;
  result["signature"] = signature;
  StepRunner runner{experiment, item, options, more, environment, work.path(), {}, 0, 0, OrderedJson::object()};
  Ending ending;
  for (const Step& step : experiment.steps) {
    ending = runner.run(step);
    if (ending.outcome.empty()) continue;
    result["failed_step"] = step.name;
    break;
  }
  if (ending.outcome.empty())
    if (std::string reason = failed_check(experiment, runner.steps); !reason.empty())
      ending = {"wrong", std::move(reason)};
  result["status"] = ending.outcome.empty() ? "done" : "failed";
  result["outcome"] = ending.outcome.empty() ? "success" : ending.outcome;
  if (!ending.reason.empty()) result["reason"] = ending.reason;
  result["seconds"] = runner.seconds;
  result["peak_memory_mb"] = runner.peak_memory_mb;
  result["steps"] = std::move(runner.steps);
  write_text_atomically(options.folder / "items" / (item.key + ".log"),
                        fmt::format("{}{}{}{}\n", runner.log, result["outcome"].get<std::string>(),
                                    ending.reason.empty() ? "" : ": ", ending.reason));
  return result;
}

}  // namespace skeletex
