// SPDX-License-Identifier: MIT
#pragma once
#include <filesystem>
#include <nlohmann/json.hpp>

#include "skeletex/skeleton/pose.h"

namespace skeletex {

/// Reads a pose, or an animation, of a given skeleton; a lone pose becomes one frame at time 0.
///   {"rotations": {BONE: {"axis": [x,y,z], "degrees": a} or {"quaternion": [x,y,z,w]}}, "roll": {BONE: degrees}}
///   {"nodes": {NODE: [x,y,z]}, "roll": {BONE: degrees}}
///   {"translation": [x,y,z]}  of the whole skeleton, not beside nodes
///   {"frames": [{"time": seconds, "pose": {..}}]}  with growing times
/// Strict: any other key, a bone or node that the skeleton lacks, an axis or quaternion of no length, rotations beside
/// nodes, or times that do not grow are errors.
/// \throw IoError saying where and, for names, which one is nearest
PoseAnimation read_animation(const std::filesystem::path& path, const Skeleton& skeleton);
PoseAnimation animation_from_json(const nlohmann::json& json, const Skeleton& skeleton, const std::string& where);
/// The pose as a file would hold it: rotations as quaternions, and only what differs from the bind pose.
nlohmann::json pose_to_json(const Pose& pose, const Skeleton& skeleton);
nlohmann::json animation_to_json(const PoseAnimation& animation, const Skeleton& skeleton);

}  // namespace skeletex
