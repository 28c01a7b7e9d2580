// SPDX-License-Identifier: MIT
#pragma once
#include "skeletex/device/context.h"
#include "skeletex/model/texture.h"

namespace skeletex {

/// The model with its texels in an regular grid again. Texels on the mesh's own vertices and edges lie up to a cell
/// beside their places, each model's in its own way, so means of two models' texels would mix points of different
/// places. Here they slide over the surface until each lies among its neighbours. Creases lie between texels again: the
/// error becomes that of an regular grid. Models that are not snapped, by their encoder's settings, come back as they
/// are; SPD patches and seams stay.
SkeletexModel regular_grid(ClContext& context, const SkeletexModel& model);

}  // namespace skeletex
