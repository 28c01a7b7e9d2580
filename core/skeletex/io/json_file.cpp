// SPDX-License-Identifier: MIT
#include "skeletex/io/json_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "skeletex/model/error.h"

namespace skeletex {

nlohmann::json parse_json(std::string_view text, const std::string& where) {
  try {
    return nlohmann::json::parse(text.begin(), text.end());
  } catch (const nlohmann::json::parse_error& error) {
    const std::size_t end = std::min(error.byte > 0 ? error.byte - 1 : 0, text.size());
    const auto line = 1 + std::count(text.begin(), text.begin() + static_cast<std::ptrdiff_t>(end), '\n');
    std::string what = error.what();  // "[json.exception.parse_error.101] parse error at line L, column C: reason"
    if (const std::size_t colon = what.find(": "); colon != std::string::npos) what.erase(0, colon + 2);
    // The reason may quote bytes of a binary file; messages stay printable.
    std::erase_if(what,
                  [](char c) { return static_cast<unsigned char>(c) < 32 || static_cast<unsigned char>(c) > 126; });
    if (what.size() > 200) what.resize(200);
    throw IoError(fmt::format("{}: line {}: not JSON: {}", where, line, what));
  } catch (const nlohmann::json::exception& error) {
    throw IoError(fmt::format("{}: not usable JSON: {}", where, error.what()));
  }
}

const nlohmann::json& json_member(const nlohmann::json& object, const char* key, const std::string& where) {
  if (!object.is_object()) throw IoError(fmt::format("{}: an object {{...}} with \"{}\" is expected here", where, key));
  const auto found = object.find(key);
  if (found == object.end()) throw IoError(fmt::format("{}: \"{}\" is missing", where, key));
  return *found;
}

std::string json_string(const nlohmann::json& value, const std::string& where) {
  if (!value.is_string()) throw IoError(fmt::format("{}: a string is expected", where));
  return value.get<std::string>();
}

double json_number(const nlohmann::json& value, const std::string& where) {
  const double number = value.is_number() ? value.get<double>() : std::nan("");
  if (!std::isfinite(number)) throw IoError(fmt::format("{}: a finite number is expected", where));
  return number;
}

int json_int(const nlohmann::json& value, int lower, int upper, const std::string& where) {
  const bool is_int = value.is_number_integer() &&
                      (!value.is_number_unsigned() || value.get<std::uint64_t>() <= std::uint64_t{INT64_MAX});
  const std::int64_t number = is_int ? value.get<std::int64_t>() : 0;
  if (!is_int || number < lower || number > upper)
    throw IoError(upper < lower ? fmt::format("{}: there is nothing that an index could name", where)
                                : fmt::format("{}: a whole number from {} to {} is expected", where, lower, upper));
  return static_cast<int>(number);
}

const nlohmann::json& json_array(const nlohmann::json& value, const std::string& where) {
  if (!value.is_array()) throw IoError(fmt::format("{}: an array [...] is expected", where));
  return value;
}

}  // namespace skeletex
