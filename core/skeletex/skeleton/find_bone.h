// SPDX-License-Identifier: MIT
#pragma once
#include <algorithm>
#include <optional>
#include <string_view>

#include "skeletex/skeleton/skeleton.h"

namespace skeletex {

/// \return the index of the bone of that name; nothing where there is none
inline std::optional<int> find_bone(const Skeleton& skeleton, std::string_view name) {
  const auto& bones = skeleton.bones;
  const auto found = std::find_if(bones.begin(), bones.end(), [&](const Bone& bone) { return bone.name == name; });
  if (found == bones.end()) return {};
  return static_cast<int>(found - bones.begin());
}

}  // namespace skeletex
