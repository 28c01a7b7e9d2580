// SPDX-License-Identifier: MIT
#pragma once
#include <string>

#include "skeletex/io/mesh_file.h"

namespace skeletex {

/// A colour for the i-th bone, well apart from those of the bones before it; always the same one.
VertexColour bone_colour(BoneIndex bone);
/// The perceptually even map "viridis" (dark blue, green, yellow) at 0 to 1; values beyond are clamped.
VertexColour viridis(double value);
/// "#1f77b4"
std::string hex(VertexColour colour);

}  // namespace skeletex
