// SPDX-License-Identifier: MIT
#pragma once
#include <span>
#include <vector>

#include "skeletex/reconstruct/prepared_model.h"

namespace skeletex {

/// A plane of one value per texel at another size: linear between texels of the same patch where it gets finer,
/// averaged where it gets coarser.
/// \param result  of the same patches
std::vector<float> resample_plane(std::span<const float> values, const SkeletexModel& model,
                                  const SkeletexModel& result);
/// Sets the layers of a model that has another size, as resample_plane does. Normals are averaged as directions in
/// space.
/// \param result  of the same patches; its layers are those of `model`
void resample_layers(const PreparedModel& model, SkeletexModel& result);

}  // namespace skeletex
