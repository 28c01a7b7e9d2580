// SPDX-License-Identifier: MIT
#pragma once
#include <deque>
#include <span>

#include "skeletex/edit/morph/seam_map.h"

namespace skeletex {

/// The mean of several models' seams around a mean skeleton. Corners come first, then the arcs between them, then the
/// ends of the rows. Two bones that meet may read the models at slightly different places (next to arcs that only some
/// models have). Each step takes the mean of what the bones read, and fits to the step before: the difference at the
/// corners of an arc fades out along it.
/// \param result     its skeleton and its patches' rectangles are read
/// \param maps       per model, from the result's skeleton; receive the network, and the loops of the result's rows
/// \param layout     the model whose samples an arc takes, where it has the arc
/// \param has_loops  whether the maps receive loops
SeamNetwork mean_seams(const SkeletexModel& result, const SeparationPlanes& separation, std::deque<SeamMap>& maps,
                       std::span<const double> weights, int layout, bool has_loops);

}  // namespace skeletex
