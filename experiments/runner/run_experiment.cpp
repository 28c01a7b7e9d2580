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
#include <thread>

#include "cache_slot.h"
#include "json_files.h"
#include "record.h"
#include "results.h"
#include "run_item.h"
#include "shards.h"
#include "skeletex/model/error.h"

namespace skeletex {
namespace {

namespace fs = std::filesystem;

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
      if (!path.empty()) inputs[path.filename().string()] = hashes.at(path);
  return {{"commit", checkout.at("commit")},
          {"is_clean", checkout.at("changed_files") == "0"},
          {"commands", commands},
          {"inputs", inputs}};
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
  for (const Check& check : experiment.checks)
    json["checks"][check.column] = {{check.most           ? "most"
                                     : check.like.empty() ? "equals"
                                                          : "like",
                                     check.most           ? OrderedJson(*check.most)
                                     : check.like.empty() ? check.equals
                                                          : OrderedJson(check.like)}};
  if (experiment.limits.seconds > 0) json["limits"]["seconds"] = experiment.limits.seconds;
  if (experiment.limits.memory_mb > 0) json["limits"]["memory_mb"] = experiment.limits.memory_mb;
  return json;
}

/// Hashes of the models' files.
std::map<fs::path, std::string> hash_inputs(const Experiment& experiment) {
  std::map<fs::path, std::string> hashes;
  for (const ModelConfig& model : experiment.models)
    for (const fs::path& path : {model.mesh, model.skeleton})
      if (!path.empty() && !hashes.contains(path)) hashes[path] = hash_file(path);
  return hashes;
}

std::vector<Item> items_of_shard(const Experiment& experiment, const RunOptions& options) {
  const std::vector<Item> all = plan_items(experiment);
  std::vector<Item> items;
  for (std::size_t i = options.shard - 1; i < all.size(); i += options.shards) items.push_back(all[i]);
  return items;
}

void make_folders(const RunOptions& options) {
  std::error_code code;
  fs::create_directories(options.folder / "items", code);
  if (!code && options.shards > 1) fs::create_directories(options.folder / "shards", code);
  if (code) throw IoError(fmt::format("{}: the folder cannot be made: {}", options.folder.string(), code.message()));
}

/// Runs items on several threads.
class Items {
 public:
  Items(const Experiment& experiment, const RunOptions& options, const OrderedJson& checkout,
        const std::map<fs::path, std::string>& hashes)
      : experiment_(experiment), options_(options), items_(items_of_shard(experiment, options)) {
    results_.resize(items_.size());
    for (const Item& item : items_) signatures_.push_back(signature_of(experiment, item, checkout, hashes));
  }

  /// \return how many items the results hold already
  int keep_done() {
    for (std::size_t i = 0; i < items_.size(); ++i) {
      auto old = options_.is_resumed ? read_json_file(options_.folder / "items" / (items_[i].key + ".json"))
                                     : std::optional<OrderedJson>();
      if (old && old->value("status", "") == "done" && old->value("signature", OrderedJson()) == signatures_[i])
        results_[i] = std::move(*old);
      else
        open_.push_back(i);
    }
    return static_cast<int>(items_.size() - open_.size());
  }

  void run() {
    std::vector<std::thread> threads;
    for (int job = 1; job < options_.jobs; ++job) threads.emplace_back([this] { work(); });
    work();
    for (std::thread& thread : threads) thread.join();
    if (failure_) std::rethrow_exception(failure_);
  }

  const std::vector<Item>& items() const { return items_; }
  const std::vector<OrderedJson>& results() const { return results_; }

 private:
  void work() {
    try {
      std::optional<CacheSlot> slot;  // processes that share PoCL's kernel cache have crashed
      if (options_.jobs > 1 || options_.shards > 1) slot.emplace();
      std::map<std::string, std::string> environment;
      if (slot) environment["POCL_CACHE_DIR"] = slot->path().string();
      for (std::size_t k = next_++; k < open_.size(); k = next_++) {
        const Item& item = items_[open_[k]];
        OrderedJson result = run_item(experiment_, item, options_, signatures_[open_[k]], environment);
        write_json_file(options_.folder / "items" / (item.key + ".json"), result);
        const std::lock_guard lock(mutex_);
        ++finished_;
        const double elapsed = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin_).count();
        results_[open_[k]] = std::move(result);
        if (options_.progress)
          options_.progress(static_cast<int>(items_.size() - open_.size()) + finished_, static_cast<int>(items_.size()),
                            item.key, elapsed / finished_ * static_cast<double>(open_.size() - finished_));
      }
    } catch (...) {
      const std::lock_guard lock(mutex_);
      if (!failure_) failure_ = std::current_exception();
      next_ = open_.size();
    }
  }

  const Experiment& experiment_;
  const RunOptions& options_;
  std::vector<Item> items_;
  std::vector<OrderedJson> signatures_, results_;
  std::vector<std::size_t> open_;
  std::mutex mutex_;
  std::atomic<std::size_t> next_{0};
  int finished_ = 0;
  std::exception_ptr failure_;
  const std::chrono::steady_clock::time_point begin_ = std::chrono::steady_clock::now();
};

}  // namespace

RunSummary run_experiment(const Experiment& experiment, const RunOptions& options) {
  const auto begin = std::chrono::steady_clock::now();
  const std::string date = fmt::format("{:%Y-%m-%dT%H:%M:%SZ}", fmt::gmtime(std::time(nullptr)));
  const OrderedJson checkout = describe_checkout();
  make_folders(options);
  const std::map<fs::path, std::string> hashes = hash_inputs(experiment);
  const bool is_whole = options.shards == 1;
  const fs::path record_file =
      is_whole ? options.folder / "record.json" : shard_file(options.folder, options.shard, options.shards);
  if (!is_whole) drop_shard_records(options.folder, options.shard, options.shards);

  Items items(experiment, options, checkout, hashes);
  RunSummary summary;
  summary.kept = items.keep_done();
  items.run();

  OrderedJson rows = OrderedJson::array(), keys = OrderedJson::array();
  for (const OrderedJson& result : items.results()) {
    (result.at("status") == "done" ? summary.done : summary.failed) += 1;
    rows.push_back(row_of(experiment, result));
    keys.push_back(result.at("key"));
  }
  double peak = 0;
  for (const OrderedJson& row : rows) peak = std::max(peak, row.at("peak_memory_mb").get<double>());
  summary.results = is_whole ? write_results(options.folder, experiment, std::move(rows))
                             : OrderedJson{{"outcomes", count_outcomes(rows)}, {"rows", rows}};
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
  if (!is_whole) record["shard"] = {{"index", options.shard}, {"count", options.shards}, {"keys", std::move(keys)}};
  write_json_file(record_file, record);
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
