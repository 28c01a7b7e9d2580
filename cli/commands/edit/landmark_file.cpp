// SPDX-License-Identifier: MIT
#include "landmark_file.h"

#include <fmt/format.h>

#include "skeletex/io/json_file.h"
#include "skeletex/io/read_file.h"
#include "skeletex/model/error.h"

namespace skeletex::cli {
namespace {

constexpr std::uintmax_t kMaxBytes = std::uintmax_t{1} << 24;

Vec3 point_from_json(const nlohmann::json& json, const std::string& where) {
  if (json_array(json, where).size() != 3) throw IoError(where + ": three numbers [x, y, z] are expected");
  return {json_number(json[0], where), json_number(json[1], where), json_number(json[2], where)};
}

}  // namespace

std::vector<Landmark> read_landmarks(const std::string& path) {
  const nlohmann::json json = parse_json(read_file(path, kMaxBytes), path);
  std::vector<Landmark> landmarks;
  for (const nlohmann::json& entry : json_array(json_member(json, "landmarks", path), path + ", \"landmarks\"")) {
    const std::string where = fmt::format("{}: landmarks[{}]", path, landmarks.size());
    const std::string name = json_string(json_member(entry, "name", where), where + ", \"name\"");
    const nlohmann::json& points = json_array(json_member(entry, "points", where), where + ", \"points\"");
    if (points.size() != 2)
      throw IoError(fmt::format("{}, \"points\": one point per model is expected, two in all", where));
    landmarks.push_back(
        {name, point_from_json(points[0], where + ", points[0]"), point_from_json(points[1], where + ", points[1]")});
  }
  if (landmarks.empty()) throw IoError(path + ": there are no landmarks");
  return landmarks;
}

}  // namespace skeletex::cli
