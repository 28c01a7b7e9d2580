// SPDX-License-Identifier: MIT
#pragma once
#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "skeletex/io/model_config.h"

namespace skeletex {

using OrderedJson = nlohmann::ordered_json;

/// One value of a swept parameter: how rows call it, and what {parameter} stands for in arguments.
struct SweepValue {
  OrderedJson label;                   ///< a number, a string or a truth value
  std::vector<std::string> arguments;  ///< what an argument that is just {parameter} becomes; else it is the label
  std::map<std::string, std::string> values;  ///< further placeholders that this value sets
};
struct SweepParameter {
  std::string name;
  std::vector<SweepValue> values;
};

/// A command of the program, with placeholders, that an item runs.
struct Step {
  std::string name;
  std::vector<std::string> run;
  std::string tool;   ///< another program instead of this one: beside it, or on the PATH; it gets no --json
  int exit_code = 0;  ///< with which it is to end
  std::map<std::string, std::string> file_sizes;  ///< result name -> file whose bytes are counted
};

/// What a column must be for an item to be right: exactly one of the three is set.
struct Check {
  std::string column;
  OrderedJson equals;          ///< this value; null: not set
  std::string like;            ///< the value of another column; "": not set
  std::optional<double> most;  ///< at most this
};

/// What each item may take; 0: anything.
struct ItemLimits {
  double seconds = 0;    ///< wall clock of all its steps
  double memory_mb = 0;  ///< addresses of each of its processes
};

/// An experiment as its file describes it (configs/schema/experiment.schema.json): every model x every combination of
/// the sweep is an item, and an item is a list of commands.
struct Experiment {
  std::string name, title, paper;
  std::vector<ModelConfig> models;  ///< may be empty: then items have no model
  std::vector<SweepParameter> sweep;
  std::vector<Step> steps;
  std::vector<std::pair<std::string, std::string>>
      columns;  ///< column name -> place in the steps' JSON, e.g. metro.forward.mean
  std::vector<Check> checks;
  ItemLimits limits;
  std::filesystem::path folder;  ///< of the file: names of models are looked up beside it
};

struct ExperimentChanges {
  std::vector<std::string> settings;  ///< "sweep.size=[64,128]": a value as JSON, or as text where it is none
  bool is_quick = false;              ///< the file's "quick" settings first
  std::vector<std::string> only;      ///< models to keep, by name
  std::vector<ModelConfig> models;    ///< instead of the file's models, when not empty
};

/// \throw IoError naming the file and the key: unknown (with the nearest name), missing or of another kind
Experiment read_experiment(const std::filesystem::path& path, const ExperimentChanges& changes = {});
/// The files that a list {"name", "experiments": [..]} names, or the path itself when it is an experiment.
std::vector<std::filesystem::path> experiment_files(const std::filesystem::path& path);
/// A model by its file, or by its name in `folder`/../models.
/// \throw IoError
ModelConfig find_model(const std::string& name, const std::filesystem::path& folder);

/// One run of all steps.
struct Item {
  std::string key;  ///< unique within the experiment, fit for a file name: "bear-vsm-512"
  int model = -1;   ///< index in Experiment::models
  std::vector<std::pair<std::string, OrderedJson>> parameters;
  std::map<std::string, std::string> placeholders;
  std::map<std::string, std::vector<std::string>> lists;  ///< placeholders that become any number of arguments
};
/// \throw IoError when two items would have the same key
std::vector<Item> plan_items(const Experiment& experiment);

/// A step's arguments for an item. Placeholders: parameters; {model}, {mesh}, {skeleton} and {config} of the item's
/// model or, as {mesh:NAME}, of any; {work}, a folder that is the item's own and goes when it ends; {out}, the folder
/// of the results.
/// \throw IoError naming a placeholder that nothing sets
std::vector<std::string> fill_arguments(const Experiment& experiment, const Item& item,
                                        const std::vector<std::string>& arguments,
                                        const std::map<std::string, std::string>& more);

}  // namespace skeletex
