// SPDX-License-Identifier: MIT
#pragma once
#include <string>
#include <vector>

#include "skeletex/edit/morph/landmarks.h"

namespace skeletex::cli {

/// Reads pairs of points, in the units of the models' meshes:
///   {"landmarks": [{"name": "chin", "points": [[x,y,z], [x,y,z]]}, ..]}
/// \throw IoError saying where
std::vector<Landmark> read_landmarks(const std::string& path);

}  // namespace skeletex::cli
