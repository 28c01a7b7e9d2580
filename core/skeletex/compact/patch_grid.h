// SPDX-License-Identifier: MIT
#pragma once
#include <cmath>
#include <vector>

#include "skeletex/compact/refine.h"
#include "skeletex/skeleton/separation_planes.h"

namespace skeletex {

/// Where the inner points of a coarse grid are expected, and the directions that their offsets are in.
struct BaseSite {
  Vec3 predicted, out, around, along;
};
/// Row by row, from the two end rows.
std::vector<BaseSite> base_sites(const CompactModel& model, const SeparationPlanes& separation, BoneIndex bone,
                                 const EndRow& end_row);
/// Steps of the coarse grid's offsets: out, and around and along.
inline std::array<double, 3> base_steps(const CompactModel& model, BoneIndex bone) {
  const double tangential = std::ldexp(model.step, model.patches[bone].base_exponent);
  return {0.6 * model.step, tangential, tangential};
}
/// The i-th inner point of the coarse grid.
inline Vec3 base_point(const CompactPatch& patch, const BaseSite& site, const std::array<double, 3>& steps,
                       std::size_t i) {
  return site.predicted + steps[0] * patch.base[3 * i] * site.out + steps[1] * patch.base[3 * i + 1] * site.around +
         steps[2] * patch.base[3 * i + 2] * site.along;
}
/// The coarse grid with its ends and without inner points.
PatchGrid empty_grid(const CompactPatch& patch, const std::array<bool, 2>& has_pole, const EndRow& end_row);

/// Whether a step doubles rows. Beyond the model's own, rows and columns take turns.
bool step_doubles_rows(const CompactPatch& patch, int step);

/// The grid of a patch.
/// \param step_count  steps to take; those that have no residuals are their predictions
PatchGrid decode_patch(const CompactModel& model, const SeparationPlanes& separation, BoneIndex bone,
                       const std::array<bool, 2>& has_pole, const EndRow& end_row, int step_count);

}  // namespace skeletex
