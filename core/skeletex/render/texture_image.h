// SPDX-License-Identifier: MIT
#pragma once
#include "skeletex/model/texture.h"
#include "skeletex/render/image.h"

namespace skeletex {

/// The displacement texture to look at: red along, green around (grey: none, full at what 99 % of the texels lie
/// below), blue out (dark: at the bone), with the rectangles' outlines. A square pixel per texel, magnified to about
/// `pixels`.
Image map_image(const SkeletexModel& model, int pixels);
/// The atlas: each bone's rectangle in its colour with its name.
Image layout_image(const SkeletexModel& model, int pixels);

}  // namespace skeletex
