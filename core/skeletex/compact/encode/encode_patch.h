// SPDX-License-Identifier: MIT
#pragma once
#include "skeletex/compact/encode/source_surface.h"
#include "skeletex/compact/patch_grid.h"

namespace skeletex {

/// What the encoder chooses beside the step.
struct ResidualOptions {
  double reach = 0.5;      ///< how far a point may slide from its home, in distances of its parents
  double rounding = 0.42;  ///< added before rounding down: 0.5 rounds to nearest, less prefers 0
  /// Points nearer to each other than so many steps get no residuals: their normals would follow the rounding.
  double least_spacing = 8;
  /// A point that cannot be read along the normal stays where it is expected, if that is within so many steps of the
  /// surface; else it takes its home place, whose numbers along the surface cost three times the bytes.
  double near_enough = 2;
  /// Residuals below so many steps are dropped in the `kept_levels` finest steps that have some.
  double least_kept = 3;
  int kept_levels = 2;
};

/// Fills a patch's coarse grid and residuals, and its row table.
/// \param compact  its skeleton, steps, weights and the patch's sizes and poles are set
/// \param fixed_places  shares of the rows and columns around which points are stored at their home places
/// \param places  where the points of the finest grid were read; null: not wanted
void encode_patch(CompactModel& compact, const SeparationPlanes& separation, BoneIndex bone,
                  const std::array<bool, 2>& has_pole, const EndRow& end_row, const SourcePatch& source,
                  const ResidualOptions& options, const std::vector<Place>& fixed_places, std::vector<Place>* places);

}  // namespace skeletex
