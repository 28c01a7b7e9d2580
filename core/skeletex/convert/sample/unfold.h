// SPDX-License-Identifier: MIT
#pragma once
#include <functional>
#include <span>

#include "skeletex/convert/sample/device_maps.h"
#include "skeletex/convert/snap/snap.h"

namespace skeletex {

struct UnfoldReport {
  int folded_quads = 0;  ///< of the regular grid
  int left = 0;          ///< that stay folded
};

/// Texels of VSM patches around quads that fold in space although the map does not (it turns sharply there, next to
/// seams for the most part) read nearer to their neighbours' mean. Where that does not unfold them they stay at their
/// own places. Folds at edges of the surface itself are left alone.
/// \param triangles  per texel, the map's triangle at its place
/// \param read       reads the points of the texels on a part of a list, those that `triangles` has one for, where
///                   `positions` have them at home
/// \param positions  only what they have at home changes
UnfoldReport unfold_lattice(ClContext& context, const DeviceLayout& layout, std::span<const Patch> patches,
                            const DeviceMaps& maps, const ClBuffer<int>& triangles,
                            const std::function<void(const ClBuffer<int>& texels, int first, int count)>& read,
                            ReadingPositions& positions, DevicePlanes& points);

}  // namespace skeletex
