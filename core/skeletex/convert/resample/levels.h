// SPDX-License-Identifier: MIT
#pragma once
#include <vector>

#include "skeletex/device/context.h"
#include "skeletex/model/texture.h"

namespace skeletex {

/// The levels of detail of a model: itself, then each with half the longer side of the one before, resampled from the
/// model itself, down to `smallest` or as far as every bone keeps 4 x 4 texels.
std::vector<SkeletexModel> make_levels(ClContext& context, const SkeletexModel& model, int smallest = 32);

}  // namespace skeletex
