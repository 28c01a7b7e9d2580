// SPDX-License-Identifier: MIT
#pragma once
#include <cstdint>
#include <span>
#include <vector>

#include "skeletex/model/mesh.h"

namespace skeletex {

/// The points' indices along a Hilbert curve through their bounding box (2^16 cells a side; points of one cell keep
/// their order): neighbours in the order are neighbours in space.
/// \pre all coordinates are finite
std::vector<int> hilbert_order(std::span<const Vec3> points);

/// Position of a cell along the Hilbert curve (Skilling 2004); coordinates below 2^16.
std::uint64_t hilbert_key(std::uint32_t x, std::uint32_t y, std::uint32_t z);

}  // namespace skeletex
