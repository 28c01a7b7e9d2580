// SPDX-License-Identifier: MIT
#pragma once
#include <functional>

#include "experiment.h"

namespace skeletex {

struct RunOptions {
  std::string program;           ///< this program, which the steps call
  std::filesystem::path folder;  ///< of the results
  bool is_resumed = false;       ///< keep items that are done, by the same commit, commands and inputs
  int jobs = 1;
  int shard = 1, shards = 1;  ///< only the items of this part of so many, 1 <= shard <= shards
  std::string device;         ///< --device of every step; "" for the default
  OrderedJson source;         ///< for the record: the file and the changes that the experiment was made of
  /// After each item: how many are done, of how many, which one, seconds left (< 0: unknown).
  std::function<void(int done, int total, const std::string& key, double seconds_left)> progress;
};

struct RunSummary {
  int done = 0, kept = 0, failed = 0;
  OrderedJson results;  ///< what results.json holds
};

/// Runs every item, each in processes of its own, so that one that fails or crashes is recorded with its reason and
/// does not stop the rest. Writes, all atomically and in `folder`:
///   items/KEY.json   parameters, commands, the steps' JSON, seconds, peak memory; written as soon as the item ends
///   items/KEY.log    what was called, and what it printed to standard error
///   results.json     one row per item: model, parameters, status, columns
///   results.csv      the same as a table
///   record.json      the experiment as it was resolved, date, input hashes, git state, compiler, device, machine
/// A shard has every shards-th item from the shard-th on. Instead of the last three it writes shards/I-of-N.json, its
/// record, when all of its items have ended; shards may share a folder, and collect_shards makes the rest.
/// \throw IoError when the folder cannot be written or a {name} in a step is unknown
RunSummary run_experiment(const Experiment& experiment, const RunOptions& options);

struct Collected {
  Experiment experiment;  ///< without models and steps
  RunSummary summary;
};
/// Joins the results of all shards of an experiment into those that one run would have written.
/// \param folders  those that the shards wrote to
/// \param out      receives what they hold; may be one of them
/// \throw InputError when shards are missing, or are not of one experiment, commit and input; IoError
Collected collect_shards(const std::vector<std::filesystem::path>& folders, const std::filesystem::path& out);

/// Differences between two results.json: rows that only one has, columns that differ by more than `tolerance`
/// (relative). Columns whose names end in _ms, _s or _mb are times and memory and not compared. Empty: they agree.
std::vector<std::string> compare_results(const OrderedJson& expected, const OrderedJson& found, double tolerance);

}  // namespace skeletex
