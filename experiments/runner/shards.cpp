// SPDX-License-Identifier: MIT
#include "shards.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <string_view>

#include "json_files.h"
#include "results.h"
#include "run_experiment.h"
#include "skeletex/io/read_file.h"
#include "skeletex/model/error.h"

namespace skeletex {
namespace {

namespace fs = std::filesystem;

std::string ending_of(int shards) { return fmt::format("-of-{}.json", shards); }

/// Everything in a folder goes to another one, which is not in it.
void copy_results(const fs::path& from, const fs::path& to) {
  std::error_code code;
  fs::create_directories(to, code);
  if (!code && fs::equivalent(from, to, code)) return;
  const fs::path below = fs::weakly_canonical(to).lexically_relative(fs::weakly_canonical(from));
  if (!below.empty() && *below.begin() != "..")
    throw InputError(
        fmt::format("{} lies in {}, which is to be copied to it; name another folder", to.string(), from.string()));
  if (!code) fs::copy(from, to, fs::copy_options::recursive | fs::copy_options::overwrite_existing, code);
  if (code) throw IoError(fmt::format("{} cannot be copied to {}: {}", from.string(), to.string(), code.message()));
}

/// What shards of one run have in common, of a record. How many files differ from the commit may change on the way.
OrderedJson identity_of(const OrderedJson& record, const char* key) {
  const OrderedJson& value = record.at(key);
  if (key != std::string_view("git")) return value;
  return {{"commit", value.at("commit")}, {"is_clean", value.at("changed_files") == "0"}};
}

/// The records of all shards, in order.
/// \throw InputError when some are missing or do not belong together
std::vector<OrderedJson> read_records(const fs::path& folder) {
  std::vector<OrderedJson> records;
  std::error_code ignored;
  for (const auto& entry : fs::directory_iterator(folder / "shards", ignored))
    if (auto record = read_json_file(entry.path()); record && record->is_object() && record->contains("shard"))
      records.push_back(std::move(*record));
  if (records.empty())
    throw InputError(fmt::format("{}: no shard of a run has ended there; skeletex run CONFIG --shard I/N makes one",
                                 folder.string()));
  const auto index = [](const OrderedJson& record) { return record.at("shard").at("index").get<int>(); };
  std::sort(records.begin(), records.end(), [&](const auto& a, const auto& b) { return index(a) < index(b); });
  const int count = records[0].at("shard").at("count").get<int>();
  std::vector<int> missing;
  for (int i = 1; i <= count; ++i)
    if (std::none_of(records.begin(), records.end(), [&](const auto& record) { return index(record) == i; }))
      missing.push_back(i);
  for (const OrderedJson& record : records)
    for (const char* key : {"experiment", "inputs", "git"})
      if (identity_of(record, key) != identity_of(records[0], key) || record.at("shard").at("count") != count)
        throw InputError(fmt::format("{}: shards {}/{} and {}/{} are not of one run, as \"{}\" differs; run one again",
                                     folder.string(), index(records[0]), count, index(record),
                                     record.at("shard").at("count").get<int>(), key));
  if (!missing.empty())
    throw InputError(fmt::format("{}: of {} shards, {} are missing: {}; run them (again, with --resume)",
                                 folder.string(), count, missing.size(), fmt::join(missing, ", ")));
  return records;
}

/// The keys of all items in the order of a whole run, which deals them out to the shards in turn.
std::vector<std::string> keys_in_order(const std::vector<OrderedJson>& records) {
  std::vector<std::string> keys;
  for (std::size_t k = 0; k < records[0].at("shard").at("keys").size(); ++k)
    for (const OrderedJson& record : records)
      if (const OrderedJson& own = record.at("shard").at("keys"); k < own.size())
        keys.push_back(own.at(k).get<std::string>());
  return keys;
}

/// What of an experiment its results need, from a record.
Experiment experiment_from(const OrderedJson& json) {
  Experiment experiment;
  experiment.name = json.at("name").get<std::string>();
  experiment.title = json.at("title").get<std::string>();
  experiment.paper = json.at("paper").get<std::string>();
  const OrderedJson sweep = json.value("sweep", OrderedJson::object());
  for (const auto& [name, values] : sweep.items()) experiment.sweep.push_back({name, {}});
  const OrderedJson columns = json.value("columns", OrderedJson::object());
  for (const auto& [column, place] : columns.items()) experiment.columns.emplace_back(column, place.get<std::string>());
  return experiment;
}

/// The first shard's record with the sums of all, and what each has of its own.
OrderedJson join_records(const std::vector<OrderedJson>& records, const RunSummary& summary) {
  OrderedJson joined = records[0];
  joined.erase("shard");
  double seconds = 0, peak = 0;
  joined["shards"] = OrderedJson::array();
  for (const OrderedJson& record : records) {
    joined["date"] = std::min(joined.at("date").get<std::string>(), record.at("date").get<std::string>());
    seconds += record.at("seconds").get<double>();
    peak = std::max(peak, record.at("peak_memory_mb").get<double>());
    joined["shards"].push_back({{"date", record.at("date")},
                                {"machine", record.at("machine")},
                                {"device", record.at("device")},
                                {"items", record.at("items")},
                                {"seconds", record.at("seconds")}});
  }
  joined["items"] = {{"done", summary.done}, {"kept", summary.kept}, {"failed", summary.failed}};
  joined["seconds"] = seconds;
  joined["peak_memory_mb"] = peak;
  return joined;
}

}  // namespace

fs::path shard_file(const fs::path& folder, int shard, int shards) {
  return folder / "shards" / (std::to_string(shard) + ending_of(shards));
}

void drop_shard_records(const fs::path& folder, int shard, int shards) {
  std::error_code ignored;
  fs::remove(shard_file(folder, shard, shards), ignored);
  std::vector<fs::path> others;
  for (const auto& entry : fs::directory_iterator(folder / "shards", ignored))
    if (const std::string name = entry.path().filename(); name.ends_with(".json") && !name.ends_with(ending_of(shards)))
      others.push_back(entry.path());
  for (const fs::path& other : others) fs::remove(other, ignored);
}

Collected collect_shards(const std::vector<fs::path>& folders, const fs::path& out) {
  for (const fs::path& folder : folders) {
    if (!fs::is_directory(folder)) throw InputError(folder.string() + ": there is no such folder of results");
    copy_results(folder, out);
  }
  const std::vector<OrderedJson> records = read_records(out);
  Collected collected{experiment_from(records[0].at("experiment")), {}};
  RunSummary& summary = collected.summary;
  OrderedJson rows = OrderedJson::array();
  for (const std::string& key : keys_in_order(records)) {
    const fs::path file = out / "items" / (key + ".json");
    const auto item = read_json_file(file);
    if (!item || !item->contains("signature"))
      throw InputError(file.string() + ": the result of an item is missing; run its shard again, with --resume");
    if (item->at("signature").at("commit") != records[0].at("git").at("commit"))
      throw InputError(file.string() + ": made by another commit than its shard; run that again, with --resume");
    (item->at("status") == "done" ? summary.done : summary.failed) += 1;
    rows.push_back(row_of(collected.experiment, *item));
  }
  for (const OrderedJson& record : records) summary.kept += record.at("items").at("kept").get<int>();
  summary.results = write_results(out, collected.experiment, std::move(rows));
  write_json_file(out / "record.json", join_records(records, summary));
  return collected;
}

}  // namespace skeletex
