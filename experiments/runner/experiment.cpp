// SPDX-License-Identifier: MIT
#include "experiment.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <set>

#include "skeletex/io/json_file.h"
#include "skeletex/io/read_file.h"
#include "skeletex/io/suggestion.h"
#include "skeletex/model/error.h"

namespace skeletex {
namespace {

const std::vector<std::string> kKeys{"name",    "title",  "paper",  "models", "sweep",  "steps",
                                     "columns", "checks", "limits", "quick",  "$schema"};
const std::vector<std::string> kStepKeys{"name", "run", "tool", "exit_code", "file_sizes"};
const std::vector<std::string> kValueKeys{"label", "arguments", "values"};
const std::vector<std::string> kModelKeys{"name", "mesh", "skeleton", "credits", "view"};

OrderedJson load(const std::filesystem::path& path) {
  const std::string text = read_file(path, std::uintmax_t{16} << 20);
  parse_json(text, path.string());  // says the line of an error
  return OrderedJson::parse(text);
}

void check_keys(const OrderedJson& json, const std::vector<std::string>& known, const std::string& where) {
  if (!json.is_object()) throw IoError(where + " must be an object");
  for (const auto& [key, value] : json.items())
    if (std::find(known.begin(), known.end(), key) == known.end())
      throw IoError(fmt::format("{}: unknown key \"{}\"{}", where, key, did_you_mean(key, known)));
}

std::string text_of(const OrderedJson& json, const char* key, const std::string& where,
                    const char* fallback = nullptr) {
  if (!json.contains(key)) {
    if (fallback) return fallback;
    throw IoError(fmt::format("{}: \"{}\" is missing", where, key));
  }
  if (!json.at(key).is_string()) throw IoError(fmt::format("{}: \"{}\" must be a string", where, key));
  return json.at(key).get<std::string>();
}

std::vector<std::string> texts_of(const OrderedJson& json, const std::string& where) {
  if (!json.is_array() || !std::all_of(json.begin(), json.end(), [](const auto& x) { return x.is_string(); }))
    throw IoError(where + " must be a list of strings");
  return json.get<std::vector<std::string>>();
}

std::map<std::string, std::string> dictionary_of(const OrderedJson& json, const std::string& where) {
  if (!json.is_object()) throw IoError(where + " must be an object of strings");
  std::map<std::string, std::string> result;
  for (const auto& [key, value] : json.items()) {
    if (!value.is_string()) throw IoError(fmt::format("{}: \"{}\" must be a string", where, key));
    result[key] = value.get<std::string>();
  }
  return result;
}

std::string label_text(const OrderedJson& label) { return label.is_string() ? label.get<std::string>() : label.dump(); }

SweepValue value_of(const OrderedJson& json, const std::string& where) {
  SweepValue value;
  if (json.is_object()) {
    check_keys(json, kValueKeys, where);
    if (!json.contains("label")) throw IoError(where + ": \"label\" is missing");
    value.label = json.at("label");
    if (json.contains("values")) value.values = dictionary_of(json.at("values"), where + ": \"values\"");
    value.arguments = json.contains("arguments") ? texts_of(json.at("arguments"), where + ": \"arguments\"")
                                                 : std::vector{label_text(value.label)};
  } else {
    value.label = json;
    value.arguments = {label_text(json)};
  }
  if (value.label.is_structured() || value.label.is_null())
    throw IoError(where + " must be a number, a string, true, false or an object with \"label\"");
  return value;
}

double number_of(const OrderedJson& json, const std::string& where) {
  if (!json.is_number() || !(json.get<double>() > 0)) throw IoError(where + " must be a number above 0");
  return json.get<double>();
}

ItemLimits limits_of(const OrderedJson& json, const std::string& where) {
  check_keys(json, {"seconds", "memory_mb"}, where);
  ItemLimits limits;
  if (json.contains("seconds")) limits.seconds = number_of(json.at("seconds"), where + ": \"seconds\"");
  if (json.contains("memory_mb")) limits.memory_mb = number_of(json.at("memory_mb"), where + ": \"memory_mb\"");
  return limits;
}

std::vector<Check> checks_of(const OrderedJson& json, const Experiment& experiment, const std::string& where) {
  if (!json.is_object()) throw IoError(where + " must be an object of columns");
  const auto require_column = [&](const std::string& name) {
    std::vector<std::string> names;
    for (const auto& [column, place] : experiment.columns) names.push_back(column);
    if (std::find(names.begin(), names.end(), name) == names.end())
      throw IoError(fmt::format("{}: there is no column \"{}\"{}", where, name, did_you_mean(name, names)));
  };
  std::vector<Check> checks;
  for (const auto& [column, value] : json.items()) {
    const std::string place = fmt::format("{}: \"{}\"", where, column);
    require_column(column);
    check_keys(value, {"equals", "like", "most"}, place);
    if (value.size() != 1) throw IoError(place + " must have one of \"equals\", \"like\" and \"most\"");
    Check check{column, value.value("equals", OrderedJson()), text_of(value, "like", place, ""), std::nullopt};
    if (value.contains("like")) require_column(check.like);
    if (value.contains("equals") && (check.equals.is_null() || check.equals.is_structured()))
      throw IoError(place + ": \"equals\" must be a number, a string, true or false");
    if (value.contains("most")) {
      if (!value.at("most").is_number()) throw IoError(place + ": \"most\" must be a number");
      check.most = value.at("most").get<double>();
    }
    checks.push_back(std::move(check));
  }
  return checks;
}

/// Sets "a.b.c" in place, making objects on the way.
void set_at(OrderedJson& json, const std::string& path, const OrderedJson& value, const std::string& where) {
  OrderedJson* at = &json;
  std::size_t begin = 0;
  while (true) {
    const std::size_t dot = path.find('.', begin);
    const std::string key = path.substr(begin, dot - begin);
    if (key.empty() || !(at->is_object() || at->is_null()))
      throw IoError(fmt::format("{}: \"{}\" is no place in it", where, path));
    at = &(*at)[key];
    if (dot == std::string::npos) break;
    begin = dot + 1;
  }
  *at = value;
}

ModelConfig model_from(const OrderedJson& json, const std::filesystem::path& folder, const std::string& where) {
  if (json.is_string()) return find_model(json.get<std::string>(), folder);
  check_keys(json, kModelKeys, where);
  const auto file = [&](const char* key) { return (folder / text_of(json, key, where)).lexically_normal(); };
  return {text_of(json, "name", where), file("mesh"),
          json.contains("skeleton") ? file("skeleton") : std::filesystem::path(), text_of(json, "credits", where, ""),
          nlohmann::json(json.value("view", OrderedJson()))};
}

}  // namespace

ModelConfig find_model(const std::string& name, const std::filesystem::path& folder) {
  if (name.ends_with(".json")) return read_model_config(folder / name);  // an absolute path stays itself
  const std::filesystem::path models = folder / "../models", path = models / (name + ".json");
  if (std::filesystem::exists(path)) return read_model_config(path);
  std::vector<std::string> names;
  std::error_code ignored;
  for (const auto& entry : std::filesystem::directory_iterator(models, ignored))
    names.push_back(entry.path().stem().string());
  throw IoError(fmt::format("there is no model \"{}\" in {}{}", name, models.lexically_normal().string(),
                            did_you_mean(name, names)));
}

std::vector<std::filesystem::path> experiment_files(const std::filesystem::path& path) {
  const OrderedJson json = load(path);
  if (!json.is_object() || !json.contains("experiments")) return {path};
  check_keys(json, {"name", "title", "experiments", "$schema"}, path.string());
  std::vector<std::filesystem::path> files;
  for (const std::string& file : texts_of(json.at("experiments"), path.string() + ": \"experiments\""))
    files.push_back((path.parent_path() / file).lexically_normal());
  return files;
}

// One key of the file after the other, each with its own message: short, but many branches.
// NOLINTNEXTLINE(readability-function-cognitive-complexity,readability-function-size)
Experiment read_experiment(const std::filesystem::path& path, const ExperimentChanges& changes) {
  const std::string where = path.string();
  OrderedJson json = load(path);
  check_keys(json, kKeys, where);
  if (changes.is_quick && json.contains("quick")) {
    if (!json.at("quick").is_object()) throw IoError(where + ": \"quick\" must be an object of settings");
    const OrderedJson quick = json.at("quick");
    for (const auto& [place, value] : quick.items()) set_at(json, place, value, where + ": \"quick\"");
  }
  for (const std::string& setting : changes.settings) {
    const std::size_t equals = setting.find('=');
    if (equals == std::string::npos)
      throw InputError(fmt::format("--set {}: give KEY=VALUE, e.g. sweep.size=[64,128]", setting));
    const std::string text = setting.substr(equals + 1);
    OrderedJson value = OrderedJson::parse(text, nullptr, false);
    set_at(json, setting.substr(0, equals), value.is_discarded() ? OrderedJson(text) : value, "--set");
  }
  check_keys(json, kKeys, where);

  Experiment experiment;
  experiment.folder = path.parent_path();
  experiment.name = text_of(json, "name", where);
  if (experiment.name.empty() || experiment.name.find('/') != std::string::npos)
    throw IoError(where + ": \"name\" must be fit for a folder");
  experiment.title = text_of(json, "title", where, "");
  experiment.paper = text_of(json, "paper", where, "");
  if (!changes.models.empty()) {
    experiment.models = changes.models;
  } else if (json.contains("models")) {
    if (!json.at("models").is_array()) throw IoError(where + ": \"models\" must be a list");
    for (const OrderedJson& model : json.at("models"))
      experiment.models.push_back(model_from(model, experiment.folder, where + ": \"models\""));
  }
  for (const std::string& name : changes.only) {
    std::vector<std::string> names;
    for (const ModelConfig& model : experiment.models) names.push_back(model.name);
    if (!names.empty() && std::find(names.begin(), names.end(), name) == names.end())
      throw InputError(fmt::format("{} has no model \"{}\"{}", experiment.name, name, did_you_mean(name, names)));
  }
  if (!changes.only.empty())
    std::erase_if(experiment.models, [&](const ModelConfig& model) {
      return std::find(changes.only.begin(), changes.only.end(), model.name) == changes.only.end();
    });

  if (json.contains("sweep")) {
    if (!json.at("sweep").is_object()) throw IoError(where + ": \"sweep\" must be an object of lists");
    for (const auto& [name, values] : json.at("sweep").items()) {
      const std::string place = fmt::format("{}: \"sweep.{}\"", where, name);
      SweepParameter parameter{name, {}};
      for (const OrderedJson& value : values.is_array() ? values : OrderedJson::array({values}))
        parameter.values.push_back(value_of(value, place));
      if (parameter.values.empty()) throw IoError(place + " has no values");
      experiment.sweep.push_back(std::move(parameter));
    }
  }
  if (!json.contains("steps") || !json.at("steps").is_array() || json.at("steps").empty())
    throw IoError(where + ": \"steps\" must be a list of commands");
  for (const OrderedJson& entry : json.at("steps")) {
    const std::string place = fmt::format("{}: step {}", where, experiment.steps.size() + 1);
    check_keys(entry, kStepKeys, place);
    Step step{text_of(entry, "name", place), {}, text_of(entry, "tool", place, ""), 0, {}};
    if (entry.contains("exit_code")) {
      if (!entry.at("exit_code").is_number_integer()) throw IoError(place + ": \"exit_code\" must be a whole number");
      step.exit_code = entry.at("exit_code").get<int>();
    }
    if (!entry.contains("run")) throw IoError(place + ": \"run\" is missing");
    step.run = texts_of(entry.at("run"), place + ": \"run\"");
    if (entry.contains("file_sizes"))
      step.file_sizes = dictionary_of(entry.at("file_sizes"), place + ": \"file_sizes\"");
    for (const Step& other : experiment.steps)
      if (other.name == step.name) throw IoError(fmt::format("{}: there is another step \"{}\"", place, step.name));
    experiment.steps.push_back(std::move(step));
  }
  if (json.contains("columns") && !json.at("columns").is_object())
    throw IoError(where + ": \"columns\" must be an object of places");
  if (json.contains("columns"))
    for (const auto& [column, value] : json.at("columns").items()) {
      const std::string place = text_of(json.at("columns"), column.c_str(), where + ": \"columns\"");
      const std::string step = place.substr(0, place.find('.'));
      if (std::none_of(experiment.steps.begin(), experiment.steps.end(), [&](const Step& s) { return s.name == step; }))
        throw IoError(fmt::format("{}: column \"{}\" reads from \"{}\", which is no step", where, column, step));
      experiment.columns.emplace_back(column, place);
    }
  if (json.contains("checks")) experiment.checks = checks_of(json.at("checks"), experiment, where + ": \"checks\"");
  if (json.contains("limits")) experiment.limits = limits_of(json.at("limits"), where + ": \"limits\"");
  return experiment;
}

// NOLINTNEXTLINE(readability-function-cognitive-complexity): the loops are the sweep's own nesting
std::vector<Item> plan_items(const Experiment& experiment) {
  std::vector<Item> items;
  std::set<std::string> keys;
  std::vector<int> models(experiment.models.size());
  for (std::size_t i = 0; i < models.size(); ++i) models[i] = static_cast<int>(i);
  if (models.empty()) models.push_back(-1);
  for (const int model : models) {
    std::vector<Item> of_model{Item{"", model, {}, {}, {}}};
    for (const SweepParameter& parameter : experiment.sweep) {
      std::vector<Item> longer;
      for (const Item& item : of_model)
        for (const SweepValue& value : parameter.values) {
          Item next = item;
          next.parameters.emplace_back(parameter.name, value.label);
          next.placeholders[parameter.name] = label_text(value.label);
          next.placeholders.insert(value.values.begin(), value.values.end());
          next.lists[parameter.name] = value.arguments;
          longer.push_back(std::move(next));
        }
      of_model = std::move(longer);
    }
    for (Item& item : of_model) {
      item.key = model < 0 ? "" : experiment.models[model].name;
      for (const auto& [name, label] : item.parameters) item.key += (item.key.empty() ? "" : "-") + label_text(label);
      if (item.key.empty()) item.key = experiment.name;
      for (char& c : item.key)
        if (!std::isalnum(static_cast<unsigned char>(c)) && c != '-' && c != '_' && c != '.') c = '_';
      if (!keys.insert(item.key).second)
        throw IoError(fmt::format("{}: two items are called \"{}\"; give models or values other names", experiment.name,
                                  item.key));
      items.push_back(std::move(item));
    }
  }
  return items;
}

// NOLINTNEXTLINE(readability-function-cognitive-complexity): one branch for each kind of placeholder
std::vector<std::string> fill_arguments(const Experiment& experiment, const Item& item,
                                        const std::vector<std::string>& arguments,
                                        const std::map<std::string, std::string>& more) {
  const auto value_of_name = [&](const std::string& name) -> std::string {
    if (const auto found = more.find(name); found != more.end()) return found->second;
    if (const auto found = item.placeholders.find(name); found != item.placeholders.end()) return found->second;
    const std::size_t colon = name.find(':');
    const std::string what = name.substr(0, colon);
    if ((what == "model" || what == "mesh" || what == "skeleton") && (colon != std::string::npos || item.model >= 0)) {
      const ModelConfig model = colon != std::string::npos ? find_model(name.substr(colon + 1), experiment.folder)
                                                           : experiment.models[item.model];
      if (what == "skeleton" && model.skeleton.empty())
        throw IoError(
            fmt::format("{}: model \"{}\" has no skeleton, which {{{}}} asks for", experiment.name, model.name, name));
      return what == "model" ? model.name : what == "mesh" ? model.mesh.string() : model.skeleton.string();
    }
    throw IoError(fmt::format("{}: nothing sets the placeholder {{{}}}", experiment.name, name));
  };
  std::vector<std::string> filled;
  for (const std::string& argument : arguments) {
    if (argument.size() > 2 && argument.front() == '{' && argument.back() == '}')
      if (const auto list = item.lists.find(argument.substr(1, argument.size() - 2)); list != item.lists.end()) {
        const std::vector<std::string> nested = fill_arguments(
            experiment, {item.key, item.model, item.parameters, item.placeholders, {}}, list->second, more);
        filled.insert(filled.end(), nested.begin(), nested.end());
        continue;
      }
    std::string text = argument;
    for (int replaced = 0;; ++replaced) {  // innermost first, so that {mesh:{a}} works
      if (replaced == 100)
        throw IoError(fmt::format("{}: a placeholder of \"{}\" stands for itself", experiment.name, argument));
      const std::size_t end = text.find('}');
      const std::size_t begin = end == std::string::npos ? end : text.rfind('{', end);
      if (begin == std::string::npos) break;
      text.replace(begin, end - begin + 1, value_of_name(text.substr(begin + 1, end - begin - 1)));
    }
    filled.push_back(std::move(text));
  }
  return filled;
}

}  // namespace skeletex
