// SPDX-License-Identifier: MIT
#include "results.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>

#include "json_files.h"
#include "skeletex/io/atomic_file.h"

namespace skeletex {
namespace {

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
  text += ",status,outcome";
  for (const auto& [column, place] : experiment.columns) text += "," + csv_cell(column);
  text += ",seconds,peak_memory_mb,reason\n";
  for (const OrderedJson& row : rows) {
    text += csv_cell(row.at("model"));
    for (const SweepParameter& parameter : experiment.sweep)
      text += "," + csv_cell(row.at("parameters").value(parameter.name, OrderedJson()));
    text += "," + csv_cell(row.at("status")) + "," + csv_cell(row.at("outcome"));
    for (const auto& [column, place] : experiment.columns) text += "," + csv_cell(row.at("columns").at(column));
    text += fmt::format(",{:.3f},{:.1f},{}\n", row.at("seconds").get<double>(), row.at("peak_memory_mb").get<double>(),
                        csv_cell(row.value("reason", OrderedJson())));
  }
  return text;
}

}  // namespace

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

std::string failed_check(const Experiment& experiment, const OrderedJson& steps) {
  const auto value_of = [&](const std::string& column) {
    for (const auto& [name, place] : experiment.columns)
      if (name == column) return value_at(steps, place);
    return OrderedJson();
  };
  for (const Check& check : experiment.checks) {
    const OrderedJson value = value_of(check.column);
    if (check.most) {
      if (!value.is_number() || !(value.get<double>() <= *check.most))
        return fmt::format("{} is {}, and at most {} is right", check.column, value.dump(), *check.most);
    } else if (const OrderedJson expected = check.like.empty() ? check.equals : value_of(check.like);
               value != expected) {
      return fmt::format("{} is {}, and {} is right", check.column, value.dump(), expected.dump());
    }
  }
  return "";
}

OrderedJson row_of(const Experiment& experiment, const OrderedJson& item) {
  OrderedJson row{{"key", item.at("key")},
                  {"model", item.at("model")},
                  {"parameters", item.value("parameters", OrderedJson::object())},
                  {"status", item.at("status")},
                  {"outcome", item.value("outcome", "success")}};
  if (item.contains("reason")) row["reason"] = item.at("reason");
  OrderedJson columns = OrderedJson::object();
  for (const auto& [column, place] : experiment.columns) columns[column] = value_at(item.at("steps"), place);
  row["columns"] = std::move(columns);
  row["seconds"] = item.at("seconds");
  row["peak_memory_mb"] = item.at("peak_memory_mb");
  return row;
}

OrderedJson count_outcomes(const OrderedJson& rows) {
  OrderedJson counts = OrderedJson::object();
  for (const char* outcome : {"success", "refused", "out of memory", "out of time", "crashed", "wrong"})
    if (const auto count = std::count_if(rows.begin(), rows.end(),
                                         [&](const OrderedJson& row) { return row.at("outcome") == outcome; });
        count > 0)
      counts[outcome] = count;
  return counts;
}

OrderedJson write_results(const std::filesystem::path& folder, const Experiment& experiment, OrderedJson rows) {
  OrderedJson outcomes = count_outcomes(rows);
  OrderedJson results{{"experiment", experiment.name},
                      {"title", experiment.title},
                      {"paper", experiment.paper},
                      {"outcomes", std::move(outcomes)},
                      {"rows", std::move(rows)}};
  write_json_file(folder / "results.json", results);
  write_text_atomically(folder / "results.csv", csv_of(experiment, results.at("rows")));
  return results;
}

}  // namespace skeletex
