// SPDX-License-Identifier: MIT
#pragma once
#include <string>
#include <string_view>
#include <vector>

namespace skeletex {

/// Number of letters to insert, remove, replace or swap with the next to turn one word into the other.
int edit_distance(std::string_view a, std::string_view b);
/// The name nearest to a mistyped one; empty when none is near enough to be meant.
std::string nearest_name(std::string_view typed, const std::vector<std::string>& names);
/// "; did you mean X?", or nothing.
std::string did_you_mean(std::string_view typed, const std::vector<std::string>& names);

}  // namespace skeletex
