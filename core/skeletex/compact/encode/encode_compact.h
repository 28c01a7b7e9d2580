// SPDX-License-Identifier: MIT
#pragma once
#include "skeletex/compact/compact_model.h"
#include "skeletex/compact/encode/encode_patch.h"
#include "skeletex/compact/encode/source_surface.h"
#include "skeletex/model/texture.h"

namespace skeletex {

struct CompactOptions {
  double step = 1e-4;   ///< of offsets along the normal, in the unit frame
  int size = 512;       ///< about the side of the texture that the file decodes to
  int bare_levels = 4;  ///< finest steps of every patch without residuals
  ResidualOptions residuals;
  /// Of the prediction of offsets; none: those that suit the model best.
  std::optional<std::array<OffsetWeights, 2>> weights;
  std::vector<std::vector<Place>> fixed_places;  ///< per patch, see encode_patch; empty: none
  int layer_steps = 0;                           ///< steps of a layer's range; 0: layers and bone weights are left out
};

/// A compact model of a model, whose surface it follows.
/// \param model  in its unit frame: in_unit_frame
CompactModel encode_compact(const SkeletexModel& model, const SourceSurface& source, const CompactOptions& options);

/// The model in a frame in which its diagonal is 1 and its origin 0.
SkeletexModel in_unit_frame(SkeletexModel model);

}  // namespace skeletex
