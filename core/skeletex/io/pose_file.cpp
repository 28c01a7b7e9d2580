// SPDX-License-Identifier: MIT
#include "skeletex/io/pose_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "skeletex/io/json_file.h"
#include "skeletex/io/read_file.h"
#include "skeletex/io/suggestion.h"
#include "skeletex/model/error.h"

namespace skeletex {
namespace {

constexpr std::uintmax_t kMaxBytes = std::uintmax_t{1} << 30;

void check_keys(const nlohmann::json& object, const std::vector<std::string>& known, const std::string& where) {
  if (!object.is_object()) throw IoError(fmt::format("{}: an object {{...}} is expected", where));
  for (const auto& [key, value] : object.items())
    if (std::find(known.begin(), known.end(), key) == known.end())
      throw IoError(fmt::format("{}: unknown key \"{}\"{}", where, key, did_you_mean(key, known)));
}

/// Index of a bone or node by its name.
template <class Named>
std::size_t index_of(const std::vector<Named>& all, const std::string& name, const char* kind,
                     const std::string& where) {
  const auto found =
      std::find_if(all.begin(), all.end(), [&](const Named& candidate) { return candidate.name == name; });
  if (found != all.end()) return static_cast<std::size_t>(found - all.begin());
  std::vector<std::string> names;
  for (const Named& candidate : all) names.push_back(candidate.name);
  throw IoError(fmt::format("{}: there is no {} \"{}\"{}", where, kind, name, did_you_mean(name, names)));
}

/// A number of a pose: what is larger is a slip of the pen, and its square may be infinite.
/// \param unit  what the number is measured in
double pose_number(const nlohmann::json& json, const std::string& where, double unit = 1) {
  const double most = 1e15 * unit, value = json_number(json, where);
  if (std::abs(value) > most)
    throw IoError(
        fmt::format("{}: {:g} is out of range; numbers of a pose go from {:g} to {:g}", where, value, -most, most));
  return value;
}

template <std::size_t N>
Eigen::Matrix<double, N, 1> numbers_from_json(const nlohmann::json& json, const char* what, const std::string& where,
                                              double unit = 1) {
  if (!json.is_array() || json.size() != N) throw IoError(fmt::format("{}: {} is expected", where, what));
  Eigen::Matrix<double, N, 1> v;
  for (std::size_t i = 0; i < N; ++i) v[static_cast<Eigen::Index>(i)] = pose_number(json[i], where, unit);
  return v;
}

/// The largest number by which nodes are measured: that of a skeleton far from the origin, or of a large one.
double unit_of(const Skeleton& skeleton) {
  double unit = skeleton.frame.scale;
  for (const Node& node : skeleton.nodes)
    unit = std::max(unit, skeleton.frame.to_user(node.position).cwiseAbs().maxCoeff());
  return unit;
}

Eigen::Quaterniond rotation_from_json(const nlohmann::json& json, const std::string& where) {
  check_keys(json, {"axis", "degrees", "quaternion"}, where);
  if (json.contains("quaternion")) {
    if (json.size() != 1) throw IoError(where + ": either \"quaternion\", or \"axis\" and \"degrees\"");
    const auto q = numbers_from_json<4>(json["quaternion"], "a quaternion [x, y, z, w]", where + ", \"quaternion\"");
    if (!(q.norm() > 1e-12)) throw IoError(where + ", \"quaternion\": it has no length; [0, 0, 0, 1] is no rotation");
    return Eigen::Quaterniond(q[3], q[0], q[1], q[2]).normalized();
  }
  const Vec3 axis =
      numbers_from_json<3>(json_member(json, "axis", where), "three numbers [x, y, z]", where + ", \"axis\"");
  const double degrees = pose_number(json_member(json, "degrees", where), where + ", \"degrees\"");
  if (!(axis.norm() > 1e-12)) throw IoError(where + ", \"axis\": the zero vector is no axis");
  return Eigen::Quaterniond(Eigen::AngleAxisd(degrees * std::numbers::pi / 180, axis.normalized()));
}

const nlohmann::json& object_member(const nlohmann::json& json, const char* key, const std::string& where) {
  if (!json[key].is_object()) throw IoError(fmt::format("{}, \"{}\": an object {{name: ...}} is expected", where, key));
  return json[key];
}

Pose pose_from_json(const nlohmann::json& json, const Skeleton& skeleton, const std::string& where) {
  check_keys(json, {"rotations", "nodes", "roll", "translation"}, where);
  if (json.contains("rotations") && json.contains("nodes"))
    throw IoError(where + ": \"rotations\" and \"nodes\" do not go together; a pose either turns bones or moves nodes");
  Pose pose;
  if (json.contains("rotations")) {
    pose.rotations.assign(skeleton.bones.size(), Eigen::Quaterniond::Identity());
    for (const auto& [name, value] : object_member(json, "rotations", where).items())
      pose.rotations[index_of(skeleton.bones, name, "bone", where + ", \"rotations\"")] =
          rotation_from_json(value, fmt::format("{}, \"rotations\", \"{}\"", where, name));
  }
  if (json.contains("nodes")) {
    for (const Node& node : skeleton.nodes) pose.nodes.push_back(node.position);
    for (const auto& [name, value] : object_member(json, "nodes", where).items())
      pose.nodes[index_of(skeleton.nodes, name, "node", where + ", \"nodes\"")] =
          skeleton.frame.from_user(numbers_from_json<3>(
              value, "three numbers [x, y, z]", fmt::format("{}, \"nodes\", \"{}\"", where, name), unit_of(skeleton)));
  }
  if (json.contains("translation")) {
    if (json.contains("nodes"))
      throw IoError(where + ": \"translation\" and \"nodes\" do not go together; places of nodes say it all");
    pose.translation = Vec3(numbers_from_json<3>(json["translation"], "three numbers [x, y, z]",
                                                 where + ", \"translation\"", unit_of(skeleton))) /
                       skeleton.frame.scale;
  }
  if (json.contains("roll")) {
    pose.rolls.assign(skeleton.bones.size(), 0);
    for (const auto& [name, value] : object_member(json, "roll", where).items())
      pose.rolls[index_of(skeleton.bones, name, "bone", where + ", \"roll\"")] =
          pose_number(value, fmt::format("{}, \"roll\", \"{}\"", where, name)) * std::numbers::pi / 180;
  }
  return pose;
}

}  // namespace

PoseAnimation animation_from_json(const nlohmann::json& json, const Skeleton& skeleton, const std::string& where) {
  if (json.is_object() && json.contains("bones"))
    throw IoError(where + ": a skeleton, where a pose is expected; a pose has \"rotations\" or \"nodes\"");
  if (!json.is_object() || !json.contains("frames")) return {{PoseFrame{0, pose_from_json(json, skeleton, where)}}};
  check_keys(json, {"frames"}, where);
  PoseAnimation animation;
  for (const nlohmann::json& entry : json_array(json["frames"], where + ": \"frames\"")) {
    const std::string here = fmt::format("{}: frames[{}]", where, animation.frames.size());
    check_keys(entry, {"time", "name", "pose"}, here);
    const double time = pose_number(json_member(entry, "time", here), here + ", \"time\"");
    if (!animation.frames.empty() && !(time > animation.frames.back().time))
      throw IoError(fmt::format("{}, \"time\": {} is not after the frame before, {}; times must grow", here, time,
                                animation.frames.back().time));
    PoseFrame frame{time, pose_from_json(json_member(entry, "pose", here), skeleton, here + ", \"pose\"")};
    if (const auto name = entry.find("name"); name != entry.end()) {
      if (!name->is_string()) throw IoError(here + ", \"name\": text is expected");
      frame.name = name->get<std::string>();
    }
    animation.frames.push_back(std::move(frame));
  }
  if (animation.frames.empty()) throw IoError(where + ": \"frames\" is empty; an animation has at least one");
  return animation;
}

PoseAnimation read_animation(const std::filesystem::path& path, const Skeleton& skeleton) {
  const std::string text = read_file(path, kMaxBytes);
  if (text.starts_with("glTF"))
    throw IoError(path.string() +
                  ": a rig, where a pose is expected; `skeletex import` writes its animations as poses");
  return animation_from_json(parse_json(text, path.string()), skeleton, path.string());
}

nlohmann::json pose_to_json(const Pose& pose, const Skeleton& skeleton) {
  nlohmann::json json = nlohmann::json::object();
  for (std::size_t i = 0; i < pose.rotations.size(); ++i) {
    const Eigen::Quaterniond& q = pose.rotations[i];
    if (q.vec() != Vec3::Zero())
      json["rotations"][skeleton.bones[i].name] = {{"quaternion", {q.x(), q.y(), q.z(), q.w()}}};
  }
  for (std::size_t i = 0; i < pose.nodes.size(); ++i)
    if (pose.nodes[i] != skeleton.nodes[i].position) {
      const Vec3 node = skeleton.frame.to_user(pose.nodes[i]);
      json["nodes"][skeleton.nodes[i].name] = {node[0], node[1], node[2]};
    }
  if (pose.translation != Vec3::Zero()) {
    const Vec3 way = skeleton.frame.scale * pose.translation;
    json["translation"] = {way.x(), way.y(), way.z()};
  }
  for (std::size_t i = 0; i < pose.rolls.size(); ++i)
    if (pose.rolls[i] != 0) json["roll"][skeleton.bones[i].name] = pose.rolls[i] * 180 / std::numbers::pi;
  return json;
}

nlohmann::json animation_to_json(const PoseAnimation& animation, const Skeleton& skeleton) {
  nlohmann::json frames = nlohmann::json::array();
  for (const PoseFrame& frame : animation.frames) {
    frames.push_back({{"time", frame.time}, {"pose", pose_to_json(frame.pose, skeleton)}});
    if (!frame.name.empty()) frames.back()["name"] = frame.name;
  }
  return {{"frames", std::move(frames)}};
}

}  // namespace skeletex
