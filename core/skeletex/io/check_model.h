// SPDX-License-Identifier: MIT
#pragma once
#include <string>

#include "skeletex/model/texture.h"

namespace skeletex {

/// Largest width and height of a model's texture.
inline constexpr int kMaxTextureSize = 16384;

/// Whether the parts of a model fit together, so that whatever uses it may take every index and size for granted: all
/// indices exist, rectangles lie in the texture apart from each other, rows increase from 0 to 1, each end's arcs close
/// up to one loop, and each arc is used by its two bones. Texels are not looked at.
/// \throw IoError naming the entry
void check_model(const SkeletexModel& model, const std::string& where);

}  // namespace skeletex
