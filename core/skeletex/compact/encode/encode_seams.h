// SPDX-License-Identifier: MIT
#pragma once
#include "skeletex/compact/encode/source_surface.h"
#include "skeletex/compact/seam_curves.h"

namespace skeletex {

/// Fills corners and arcs; their nodes, bones, corners and numbers of steps are set.
/// \param bare_steps  finest steps of every arc that have no residuals
void encode_seams(CompactModel& compact, const SeparationPlanes& separation, const SourceSurface& source,
                  int bare_steps, double rounding);

}  // namespace skeletex
