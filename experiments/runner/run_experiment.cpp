// SPDX-License-Identifier: MIT
#include "run_experiment.h"

#include <fmt/chrono.h>
#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <ctime>
#include <mutex>
#include <optional>
#include <set>
#include <thread>

#include "process.h"
#include "record.h"
#include "skeletex/io/atomic_file.h"
#include "skeletex/io/read_file.h"
#include "skeletex/model/error.h"
#include "work_folder.h"

namespace skeletex {
namespace {

namespace fs = std::filesystem;

void write_json_file(const fs::path& path, const OrderedJson& json) {
  write_text_atomically(path, json.dump(1, ' ', false, OrderedJson::error_handler_t::replace) + "\n");
}

std::optional<OrderedJson> read_json_file(const fs::path& path) {
  std::error_code ignored;
  if (!fs::exists(path, ignored)) return std::nullopt;
  OrderedJson json = OrderedJson::parse(read_file(path), nullptr, false);
  return json.is_discarded() ? std::nullopt : std::optional(std::move(json));
}

/// The value at "encode.bones.0.area", null where there is none.
OrderedJson value_at(const OrderedJson& json, const std::string& place) {
  const OrderedJson* at = &json;
  for (std::size_t begin = 0; begin <= place.size();) {
    const std::size_t dot = std::min(place.find('.', begin), place.size());
    const std::string key = place.substr(begin, dot - begin);
    if (at->is_object() && at->contains(key))
      at = &at->at(key);
    else if (at->is_array() && !key.empty() && std::all_of(key.begin(), key.end(), ::isdigit) &&
             std::stoul(key) < at->size())
      at = &at->at(std::stoul(key));
    else
      return nullptr;
    begin = dot + 1;
  }
  return *at;
}

/// What an item's result depends on: the version of this program, its commands, with the work and result folders left
/// open, and its inputs.
OrderedJson signature_of(const Experiment& experiment, const Item& item, const OrderedJson& checkout,
                         const std::map<fs::path, std::string>& hashes) {
  OrderedJson commands = OrderedJson::array();
  for (const Step& step : experiment.steps)
    commands.push_back(
        {{"tool", step.tool},
         {"run", fill_arguments(experiment, item, step.run,
                                {{"work", "<work>"}, {"out", "<out>"}, {"view", "<view>"}, {"config", "<config>"}})}});
  OrderedJson inputs = OrderedJson::object();
  if (item.model >= 0)
    for (const fs::path& path : {experiment.models[item.model].mesh, experiment.models[item.model].skeleton})
      inputs[path.filename().string()] = hashes.at(path);
  return {{"commit", checkout.at("commit")},
          {"is_clean", checkout.at("changed_files") == "0"},
          {"commands", commands},
          {"inputs", inputs}};
}

std::string program_of(const Step& step, const RunOptions& options) {
  if (step.tool.empty()) return options.program;
  const fs::path beside = fs::path(options.program).parent_path() / step.tool;
  return fs::is_regular_file(beside) ? beside.string() : step.tool;
}

// NOLINTNEXTLINE(readability-function-cognitive-complexity): one branch for each way in which a step can end
OrderedJson run_item(const Experiment& experiment, const Item& item, const RunOptions& options,
                     const OrderedJson& signature, const std::map<std::string, std::string>& environment) {
  const WorkFolder work;
  std::map<std::string, std::string> more{{"work", work.path().string()}, {"out", options.folder.string()}};
  OrderedJson result{{"key", item.key},
                     {"model", item.model < 0 ? OrderedJson() : OrderedJson(experiment.models[item.model].name)}};
  for (const auto& [name, label] : item.parameters) result["parameters"][name] = label;
  result["signature"] = signature;
  if (item.model >= 0) {
    const ModelConfig& model = experiment.models[item.model];
    more["view"] = (work.path() / "view.json").string();
    write_json_file(more["view"], model.view.is_null() ? OrderedJson::object() : OrderedJson(model.view));
    more["config"] = (work.path() / "model.json").string();
    write_json_file(more["config"], {{"name", model.name},
                                     {"mesh", fs::absolute(model.mesh).string()},
                                     {"skeleton", fs::absolute(model.skeleton).string()},
                                     {"credits", model.credits},
                                     {"view", model.view.is_null() ? OrderedJson::object() : OrderedJson(model.view)}});
  }
  result["status"] = "done";
  double seconds = 0, peak = 0;
  OrderedJson steps = OrderedJson::object();
  for (const Step& step : experiment.steps) {
    std::vector<std::string> arguments = fill_arguments(experiment, item, step.run, more);
    const fs::path report = work.path() / (step.name + ".json");
    if (step.tool.empty()) {
      arguments.insert(arguments.end(), {"--json", report.string()});
      if (!options.device.empty()) arguments.insert(arguments.end(), {"--device", options.device});
    }
    ProcessResult process;
    std::string reason;
    try {
      process = run_process(program_of(step, options), arguments, environment, work.path() / "errors.txt");
      if (process.exit_code != step.exit_code)
        reason = process.exit_code > 128  ? fmt::format("ended by signal {}", process.exit_code - 128)
                 : process.errors.empty() ? fmt::format("exit code {}", process.exit_code)
                                          : process.errors;
    } catch (const Error& error) {
      reason = error.what();
    }
    seconds += process.seconds;
    peak = std::max(peak, process.peak_memory_mb);
    OrderedJson reported = read_json_file(report).value_or(OrderedJson::object());
    steps[step.name] = reported.is_object() ? std::move(reported) : OrderedJson{{"result", std::move(reported)}};
    steps[step.name]["process"] = {{"seconds", process.seconds}, {"peak_memory_mb", process.peak_memory_mb}};
    if (step.exit_code != 0) steps[step.name]["process"]["errors"] = process.errors;
    if (!reason.empty()) {
      result["status"] = "failed";
      result["failed_step"] = step.name;
      result["reason"] = reason;
      break;
    }
    for (const auto& [name, file] : step.file_sizes) {
      std::error_code code;
      const std::uintmax_t size = fs::file_size(fill_arguments(experiment, item, {file}, more)[0], code);
      steps[step.name][name] = code ? OrderedJson() : OrderedJson(size);
    }
  }
  result["seconds"] = seconds;
  result["peak_memory_mb"] = peak;
  result["steps"] = std::move(steps);
  return result;
}

OrderedJson row_of(const Experiment& experiment, const OrderedJson& item) {
  OrderedJson row{{"key", item.at("key")},
                  {"model", item.at("model")},
                  {"parameters", item.value("parameters", OrderedJson::object())},
                  {"status", item.at("status")}};
  if (item.contains("reason")) row["reason"] = item.at("reason");
  OrderedJson columns = OrderedJson::object();
  for (const auto& [column, place] : experiment.columns) columns[column] = value_at(item.at("steps"), place);
  row["columns"] = std::move(columns);
  row["seconds"] = item.at("seconds");
  row["peak_memory_mb"] = item.at("peak_memory_mb");
  return row;
}

std::string csv_cell(const OrderedJson& value) {
  if (value.is_null()) return "";
  std::string text = value.is_string() ? value.get<std::string>() : value.dump();
  if (text.find_first_of(",\"\n") == std::string::npos) return text;
  std::string quoted = "\"";
  for (const char c : text) quoted += c == '"' ? "\"\"" : std::string(1, c);
  return quoted + '"';
}

std::string csv_of(const Experiment& experiment, const OrderedJson& rows) {
  std::string text = "model";
  for (const SweepParameter& parameter : experiment.sweep) text += "," + csv_cell(parameter.name);
  text += ",status";
  for (const auto& [column, place] : experiment.columns) text += "," + csv_cell(column);
  text += ",seconds,peak_memory_mb,reason\n";
  for (const OrderedJson& row : rows) {
    text += csv_cell(row.at("model"));
    for (const SweepParameter& parameter : experiment.sweep)
      text += "," + csv_cell(row.at("parameters").value(parameter.name, OrderedJson()));
    text += "," + csv_cell(row.at("status"));
    for (const auto& [column, place] : experiment.columns) text += "," + csv_cell(row.at("columns").at(column));
    text += fmt::format(",{:.3f},{:.1f},{}\n", row.at("seconds").get<double>(), row.at("peak_memory_mb").get<double>(),
                        csv_cell(row.value("reason", OrderedJson())));
  }
  return text;
}

OrderedJson experiment_json(const Experiment& experiment) {
  OrderedJson json{{"name", experiment.name}, {"title", experiment.title}, {"paper", experiment.paper}};
  json["models"] = OrderedJson::array();
  for (const ModelConfig& model : experiment.models)
    json["models"].push_back({{"name", model.name},
                              {"mesh", model.mesh.filename().string()},
                              {"skeleton", model.skeleton.filename().string()},
                              {"credits", model.credits}});
  for (const SweepParameter& parameter : experiment.sweep) {
    json["sweep"][parameter.name] = OrderedJson::array();
    for (const SweepValue& value : parameter.values)
      json["sweep"][parameter.name].push_back(
          {{"label", value.label}, {"arguments", value.arguments}, {"values", value.values}});
  }
  for (const Step& step : experiment.steps)
    json["steps"].push_back({{"name", step.name},
                             {"run", step.run},
                             {"tool", step.tool},
                             {"exit_code", step.exit_code},
                             {"file_sizes", step.file_sizes}});
  for (const auto& [column, place] : experiment.columns) json["columns"][column] = place;
  return json;
}

}  // namespace

// The order of the run, its threads and its files in one place.
// NOLINTNEXTLINE(readability-function-cognitive-complexity,readability-function-size)
RunSummary run_experiment(const Experiment& experiment, const RunOptions& options) {
  const auto begin = std::chrono::steady_clock::now();
  const std::string date = fmt::format("{:%Y-%m-%dT%H:%M:%SZ}", fmt::gmtime(std::time(nullptr)));
  const OrderedJson checkout = describe_checkout();
  const std::vector<Item> items = plan_items(experiment);
  std::error_code code;
  fs::create_directories(options.folder / "items", code);
  if (code) throw IoError(fmt::format("{}: the folder cannot be made: {}", options.folder.string(), code.message()));
  std::map<fs::path, std::string> hashes;
  for (const ModelConfig& model : experiment.models)
    for (const fs::path& path : {model.mesh, model.skeleton})
      if (!hashes.contains(path)) hashes[path] = hash_file(path);

  std::vector<OrderedJson> results(items.size());
  std::vector<std::size_t> open;
  RunSummary summary;
  for (std::size_t i = 0; i < items.size(); ++i) {
    const OrderedJson signature = signature_of(experiment, items[i], checkout, hashes);
    if (options.is_resumed)
      if (auto old = read_json_file(options.folder / "items" / (items[i].key + ".json"));
          old && old->value("status", "") == "done" && old->value("signature", OrderedJson()) == signature) {
        results[i] = std::move(*old);
        ++summary.kept;
        continue;
      }
    open.push_back(i);
  }

  std::mutex mutex;
  std::atomic<std::size_t> next{0};
  int finished = 0;
  std::exception_ptr failure;
  const auto work = [&](int job) {
    std::map<std::string, std::string> environment;
    // Processes that share PoCL's kernel cache have crashed.
    if (options.jobs > 1) {
      const char* base = std::getenv("POCL_CACHE_DIR");
      const fs::path folder =
          fs::path(base ? base : (fs::temp_directory_path() / "skeletex-pocl").string()) / fmt::format("job-{}", job);
      fs::create_directories(folder);
      environment["POCL_CACHE_DIR"] = folder.string();
    }
    try {
      for (std::size_t k = next++; k < open.size(); k = next++) {
        const Item& item = items[open[k]];
        OrderedJson result =
            run_item(experiment, item, options, signature_of(experiment, item, checkout, hashes), environment);
        write_json_file(options.folder / "items" / (item.key + ".json"), result);
        const std::lock_guard lock(mutex);
        ++finished;
        const double elapsed = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
        results[open[k]] = std::move(result);
        if (options.progress)
          options.progress(summary.kept + finished, static_cast<int>(items.size()), item.key,
                           elapsed / finished * static_cast<double>(open.size() - finished));
      }
    } catch (...) {
      const std::lock_guard lock(mutex);
      if (!failure) failure = std::current_exception();
      next = open.size();
    }
  };
  std::vector<std::thread> threads;
  for (int job = 1; job < options.jobs; ++job) threads.emplace_back(work, job);
  work(0);
  for (std::thread& thread : threads) thread.join();
  if (failure) std::rethrow_exception(failure);

  OrderedJson rows = OrderedJson::array();
  double peak = 0;
  for (const OrderedJson& result : results) {
    (result.at("status") == "done" ? summary.done : summary.failed) += 1;
    rows.push_back(row_of(experiment, result));
    peak = std::max(peak, result.at("peak_memory_mb").get<double>());
  }
  summary.results = {{"experiment", experiment.name},
                     {"title", experiment.title},
                     {"paper", experiment.paper},
                     {"rows", std::move(rows)}};
  write_json_file(options.folder / "results.json", summary.results);
  write_text_atomically(options.folder / "results.csv", csv_of(experiment, summary.results.at("rows")));
  OrderedJson record{{"date", date},
                     {"source", options.source},
                     {"experiment", experiment_json(experiment)},
                     {"inputs", OrderedJson::object()},
                     {"git", checkout}};
  for (const auto& [path, hash] : hashes) record["inputs"][path.filename().string()] = hash;
  record.update(describe_build_and_machine(options.device));
  record["jobs"] = options.jobs;
  record["items"] = {{"done", summary.done}, {"kept", summary.kept}, {"failed", summary.failed}};
  record["seconds"] = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  record["peak_memory_mb"] = peak;
  write_json_file(options.folder / "record.json", record);
  return summary;
}

std::vector<std::string> compare_results(const OrderedJson& expected, const OrderedJson& found, double tolerance) {
  std::vector<std::string> differences;
  std::map<std::string, const OrderedJson*> rows;
  for (const OrderedJson& row : found.at("rows")) rows[row.at("key").get<std::string>()] = &row;
  for (const OrderedJson& row : expected.at("rows")) {
    const std::string key = row.at("key").get<std::string>();
    const auto other = rows.find(key);
    if (other == rows.end()) {
      differences.push_back(key + ": not in the new run");
      continue;
    }
    if (row.at("status") != other->second->at("status"))
      differences.push_back(fmt::format("{}: was {}, is {}", key, row.at("status").get<std::string>(),
                                        other->second->at("status").get<std::string>()));
    for (const auto& [column, value] : row.at("columns").items()) {
      if (column.ends_with("_ms") || column.ends_with("_s") || column.ends_with("_mb")) continue;
      const OrderedJson now = other->second->at("columns").value(column, OrderedJson());
      const bool is_same = value.is_number() && now.is_number()
                               ? std::abs(value.get<double>() - now.get<double>()) <=
                                     tolerance * std::max(std::abs(value.get<double>()), std::abs(now.get<double>()))
                               : value == now;
      if (!is_same) differences.push_back(fmt::format("{}: {} was {}, is {}", key, column, value.dump(), now.dump()));
    }
    rows.erase(other);
  }
  for (const auto& [key, row] : rows) differences.push_back(key + ": only in the new run");
  return differences;
}

}  // namespace skeletex
