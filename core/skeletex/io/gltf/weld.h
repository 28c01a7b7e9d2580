// SPDX-License-Identifier: MIT
#pragma once
#include <vector>

#include "skeletex/geometry/mesh.h"

namespace skeletex {

/// For each point the first one of those that are the same: within the tolerance of each other, directly or by others
/// between them.
/// \param tolerance  world units; 0: equal positions
/// \pre coordinates finite
std::vector<int> weld_targets(const std::vector<Vec3>& points, double tolerance);

}  // namespace skeletex
