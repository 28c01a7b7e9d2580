// SPDX-License-Identifier: MIT
#pragma once
#include <span>
#include <vector>

#include "skeletex/model/texture.h"

namespace skeletex {

/// The texels that one patch is to get.
struct PatchRequest {
  double share = 1;            ///< of the texels; any positive unit, the sum is normalised
  double columns_per_row = 1;  ///< wanted width / height of the rectangle
};

struct AtlasLayout {
  std::vector<Rectangle> rectangles;  ///< one per request
  double used_fraction = 0;           ///< texels inside rectangles / all
};

/// Fills a width x height texture with one rectangle per request by splitting it like a kd-tree (paper 3.2, Figure 4):
/// each split divides a set of patches and a rectangle in the same ratio, so no texel stays blank. The tree is searched
/// for the best match of shares and side ratios; the same input gives the same layout. Rectangles are at least 4 x 4.
/// \throw InputError when the texture is too small for so many patches
AtlasLayout pack_atlas(std::span<const PatchRequest> requests, int width, int height);

}  // namespace skeletex
