// SPDX-License-Identifier: MIT
#pragma once
#include <cstdint>
#include <span>
#include <vector>

#include "skeletex/geometry/mesh.h"

namespace skeletex {

/// The points' indices along a Hilbert curve through their bounding box (2^16 cells a side; points of one cell keep
/// their order): neighbours in the order are neighbours in space.
/// \pre all coordinates are finite
std::vector<int> hilbert_order(std::span<const Vec3> points);

}  // namespace skeletex
