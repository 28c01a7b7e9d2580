// SPDX-License-Identifier: MIT
#pragma once
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>

namespace skeletex {

/// Parses JSON text.
/// \param where  name of the text in messages, e.g. its path
/// \throw IoError naming the line of a syntax error
nlohmann::json parse_json(std::string_view text, const std::string& where);

/// Member `key` of an object.
/// \throw IoError saying that `where` lacks it (or is no object)
const nlohmann::json& json_member(const nlohmann::json& object, const char* key, const std::string& where);
std::string json_string(const nlohmann::json& value, const std::string& where);
/// A finite number.
/// \throw IoError
double json_number(const nlohmann::json& value, const std::string& where);
/// A whole number in [lower, upper].
/// \throw IoError
int json_int(const nlohmann::json& value, int lower, int upper, const std::string& where);
/// An array.
/// \throw IoError
const nlohmann::json& json_array(const nlohmann::json& value, const std::string& where);

}  // namespace skeletex
