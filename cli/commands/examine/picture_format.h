// SPDX-License-Identifier: MIT
#pragma once
#include <optional>
#include <string>

#include "skeletex/render/colours.h"
#include "skeletex/render/image.h"

namespace skeletex::cli {

/// White, black, transparent or #rrggbb.
/// \return linear colour, or nothing for "transparent"
/// \throw CLI::ValidationError
std::optional<LinearRgb> parse_background(const std::string& text);

}  // namespace skeletex::cli
