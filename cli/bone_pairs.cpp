// SPDX-License-Identifier: MIT
#include "bone_pairs.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>

#include "skeletex/io/suggestion.h"
#include "skeletex/model/error.h"

namespace skeletex::cli {

BonePairs parse_bone_pairs(const std::vector<std::string>& texts) {
  BonePairs pairs;
  for (const std::string& text : texts) {
    const std::size_t equals = text.find('=');
    if (equals == std::string::npos || equals == 0 || equals + 1 == text.size())
      throw CLI::ValidationError("--bones", fmt::format("\"{}\" is not BONE=BONE", text));
    pairs.emplace_back(text.substr(0, equals), text.substr(equals + 1));
  }
  return pairs;
}

void check_bone(const std::string& path, const Skeleton& skeleton, const std::string& name) {
  std::vector<std::string> names;
  for (const Bone& bone : skeleton.bones) names.push_back(bone.name);
  if (std::find(names.begin(), names.end(), name) == names.end())
    throw InputError(fmt::format("{} has no bone \"{}\"{}", path, name, did_you_mean(name, names)));
}

Correspondence correspond(const std::string& path_a, const Skeleton& a, const std::string& path_b, const Skeleton& b,
                          const BonePairs& given) {
  for (const auto& [from, to] : given) {
    check_bone(path_a, a, from);
    check_bone(path_b, b, to);
  }
  try {
    return find_correspondence(a, b, {.given = given});
  } catch (const InputError& error) {
    throw InputError(fmt::format("{} and {}: {}", path_a, path_b, error.what()));
  }
}

}  // namespace skeletex::cli
