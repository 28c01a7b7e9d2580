// SPDX-License-Identifier: MIT
#pragma once
#include "skeletex/device/context.h"
#include "skeletex/model/texture.h"

namespace skeletex {

/// The model with its texels on a regular grid. Texels on the mesh's own vertices and edges lie up to a cell away from
/// their places, in every model differently, so that means of two models' texels would mix points of different places.
/// Here texels slide over the surface until each lies at the mean of its neighbours. Creases then lie between texels:
/// the error becomes that of a regular grid. Models that are not snapped, by their encoder's settings, are returned
/// unchanged. SPD patches and seams stay.
SkeletexModel regular_grid(ClContext& context, const SkeletexModel& model);

}  // namespace skeletex
