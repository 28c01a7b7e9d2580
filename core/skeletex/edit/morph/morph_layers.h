// SPDX-License-Identifier: MIT
#pragma once
#include <span>
#include <vector>

#include "skeletex/device/context.h"
#include "skeletex/model/texture.h"

namespace skeletex {

/// What a morph takes from one of its models.
struct LayerSource {
  const SkeletexModel& model;
  std::vector<Vec3> positions;  ///< the places of the result's vertices on it, world units
  double weight = 0;
};
/// The layers of an in-between model: weighted means of those of its models at corresponding places. Normals first turn
/// as the surface does between the model and the result. A layer that some models lack is the mean of the others'; a
/// model without normals counts with those of its triangles.
std::vector<Layer> blend_layers(ClContext& context, const SkeletexModel& result, std::span<const LayerSource> sources);

}  // namespace skeletex
