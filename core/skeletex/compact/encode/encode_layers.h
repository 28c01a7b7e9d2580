// SPDX-License-Identifier: MIT
#pragma once
#include <vector>

#include "skeletex/compact/compact_model.h"
#include "skeletex/compact/encode/source_surface.h"

namespace skeletex {

/// Whether a model has layers beside its normals, or bone weights.
bool has_coded_layers(const SkeletexModel& model);

/// Codes a model's layers, but for its normals, and its bone weights.
/// \param compact  its patches are encoded
/// \param places   per patch, of its finest grid's points: rows and columns of the model's patch
/// \param steps    how many steps a layer's range has
/// \param rounding  see ResidualOptions
void encode_layers(CompactModel& compact, const SkeletexModel& model, const std::vector<std::vector<Place>>& places,
                   int steps, double rounding);

}  // namespace skeletex
