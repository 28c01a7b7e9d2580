// SPDX-License-Identifier: MIT
#include "skeletex/io/skeleton_file.h"

#include <fmt/format.h>

#include <unordered_map>

#include "skeletex/io/json_file.h"
#include "skeletex/io/read_file.h"
#include "skeletex/model/error.h"
#include "skeletex/skeleton/check_skeleton.h"

namespace skeletex {
namespace {

constexpr std::uintmax_t kMaxBytes = std::uintmax_t{256} << 20;

Vec3 vector_from_json(const nlohmann::json& json, const std::string& where) {
  if (!json.is_array() || json.size() != 3)
    throw IoError(fmt::format("{}: three numbers [x, y, z] are expected", where));
  Vec3 v;
  for (int i = 0; i < 3; ++i) v[i] = json_number(json[static_cast<std::size_t>(i)], where);
  return v;
}

nlohmann::json vector_to_json(const Vec3& v) { return {v[0], v[1], v[2]}; }

/// "FILE: nodes[3] ("elbow")"
std::string entry(const std::string& where, const char* list, std::size_t i, const std::string& name = {}) {
  return name.empty() ? fmt::format("{}: {}[{}]", where, list, i)
                      : fmt::format("{}: {}[{}] (\"{}\")", where, list, i, name);
}

std::string name_of(const nlohmann::json& object, const char* kind, std::size_t i, const std::string& where) {
  if (!object.is_object()) throw IoError(fmt::format("{}: an object {{...}} is expected", where));
  const auto found = object.find("name");
  if (found == object.end()) return fmt::format("{}_{}", kind, i);
  return json_string(*found, where + ", \"name\"");
}

void claim_name(std::unordered_map<std::string, int>& names, const std::string& name, const char* list, std::size_t i,
                const std::string& where) {
  const auto [other, is_new] = names.emplace(name, static_cast<int>(i));
  if (!is_new)
    throw IoError(fmt::format("{}: the name is already that of {}[{}]; names must differ", entry(where, list, i, name),
                              list, other->second));
}

}  // namespace

Skeleton skeleton_from_json(const nlohmann::json& json, const std::string& where) {
  Skeleton skeleton;
  std::unordered_map<std::string, int> node_names, bone_names;
  const nlohmann::json& nodes = json_array(json_member(json, "nodes", where), where + ": \"nodes\"");
  const nlohmann::json& bones = json_array(json_member(json, "bones", where), where + ": \"bones\"");
  try {
    check_size(nodes.size(), bones.size());
  } catch (const InputError& error) {
    throw IoError(fmt::format("{}: {}", where, error.what()));
  }
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    Node node;
    node.name = name_of(nodes[i], "node", i, entry(where, "nodes", i));
    const std::string here = entry(where, "nodes", i, node.name);
    node.position = vector_from_json(json_member(nodes[i], "position", here), here + ", \"position\"");
    claim_name(node_names, node.name, "nodes", i, where);
    skeleton.nodes.push_back(std::move(node));
  }
  for (std::size_t i = 0; i < bones.size(); ++i) {
    Bone bone;
    bone.name = name_of(bones[i], "bone", i, entry(where, "bones", i));
    const std::string here = entry(where, "bones", i, bone.name);
    const auto node_index = [&](const char* key) {
      const nlohmann::json& value = json_member(bones[i], key, here);
      const std::string there = fmt::format("{}, \"{}\"", here, key);
      if (!value.is_string()) {
        if (!value.is_number_integer()) throw IoError(there + ": the index or the name of a node is expected");
        return json_int(value, 0, static_cast<int>(skeleton.nodes.size()) - 1, there);
      }
      const auto found = node_names.find(value.get<std::string>());
      if (found == node_names.end())
        throw IoError(fmt::format("{}: there is no node \"{}\"", there, value.get<std::string>()));
      return found->second;
    };
    bone.head = node_index("head");
    bone.tail = node_index("tail");
    if (bone.head == bone.tail)
      throw IoError(fmt::format("{}: head and tail are the same node; a bone joins two", here));
    if (const auto s = bones[i].find("s"); s != bones[i].end() && !s->is_null()) {
      bone.s = vector_from_json(*s, here + ", \"s\"");
      if (bone.s->isZero(0))
        throw IoError(fmt::format(
            "{}, \"s\": the zero vector is no direction; leave \"s\" out or give one across the bone", here));
    }
    claim_name(bone_names, bone.name, "bones", i, where);
    skeleton.bones.push_back(std::move(bone));
  }
  if (skeleton.bones.empty()) throw IoError(where + ": the skeleton has no bones");
  return skeleton;
}

Skeleton read_skeleton(const std::filesystem::path& path) {
  return skeleton_from_json(parse_json(read_file(path, kMaxBytes), path.string()), path.string());
}

nlohmann::json skeleton_to_json(const Skeleton& skeleton) {
  nlohmann::json nodes = nlohmann::json::array(), bones = nlohmann::json::array();
  for (const Node& node : skeleton.nodes)
    nodes.push_back({{"name", node.name}, {"position", vector_to_json(node.position)}});
  for (const Bone& bone : skeleton.bones) {
    bones.push_back({{"name", bone.name}, {"head", bone.head}, {"tail", bone.tail}});
    if (bone.s) bones.back()["s"] = vector_to_json(*bone.s);
  }
  return {{"nodes", std::move(nodes)}, {"bones", std::move(bones)}};
}

}  // namespace skeletex
