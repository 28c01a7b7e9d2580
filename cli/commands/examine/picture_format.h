// SPDX-License-Identifier: MIT
#pragma once
#include <array>
#include <optional>
#include <string>

#include "skeletex/render/colours.h"
#include "skeletex/render/image.h"

namespace skeletex::cli {

/// Pixels of "1200x900".
/// \throw CLI::ValidationError
std::array<int, 2> parse_picture_size(const std::string& text);
/// White, black, transparent or #rrggbb.
/// \return linear colour, or nothing for "transparent"
/// \throw CLI::ValidationError
std::optional<LinearRgb> parse_background(const std::string& text);

}  // namespace skeletex::cli
