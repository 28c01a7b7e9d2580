// SPDX-License-Identifier: MIT
#pragma once
#include <string>
#include <utility>
#include <vector>

#include "skeletex/skeleton/correspondence.h"
#include "skeletex/skeleton/skeleton.h"

namespace skeletex::cli {

using BonePairs = std::vector<std::pair<std::string, std::string>>;

/// "a=b" each, as --bones takes them.
/// \throw CLI::ValidationError for another form
BonePairs parse_bone_pairs(const std::vector<std::string>& texts);
/// \throw InputError naming the file, the bone that it lacks and the nearest one it has
void check_bone(const std::string& path, const Skeleton& skeleton, const std::string& name);
/// find_correspondence with the files' names in the message.
/// \throw InputError
Correspondence correspond(const std::string& path_a, const Skeleton& a, const std::string& path_b, const Skeleton& b,
                          const BonePairs& given);

}  // namespace skeletex::cli
