// SPDX-License-Identifier: MIT
#include "skeletex/io/model_config.h"

#include "skeletex/io/json_file.h"
#include "skeletex/io/read_file.h"

namespace skeletex {

ModelConfig read_model_config(const std::filesystem::path& path) {
  const std::string where = path.string();
  const nlohmann::json json = parse_json(read_file(path, std::uintmax_t{1} << 20), where);
  const auto text = [&](const char* key) {
    return json_string(json_member(json, key, where), where + ": \"" + key + "\"");
  };
  const auto file = [&](const char* key) { return (path.parent_path() / text(key)).lexically_normal(); };
  return {text("name"), file("mesh"), file("skeleton"), text("credits"), json.value("view", nlohmann::json())};
}

}  // namespace skeletex
