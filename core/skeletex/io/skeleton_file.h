// SPDX-License-Identifier: MIT
#pragma once
#include <filesystem>
#include <nlohmann/json.hpp>

#include "skeletex/skeleton/skeleton.h"

namespace skeletex {

/// Reads {"nodes":[{"name","position":[x,y,z]}], "bones":[{"name","head","tail","s"?}]}; head and tail by index or
/// name; other keys are ignored. Checks that names are unique, indices exist and numbers are finite.
/// \throw IoError naming file and line (syntax) or entry (content), and what to do
Skeleton read_skeleton(const std::filesystem::path& path);
Skeleton skeleton_from_json(const nlohmann::json& json, const std::string& where);
nlohmann::json skeleton_to_json(const Skeleton& skeleton);

}  // namespace skeletex
