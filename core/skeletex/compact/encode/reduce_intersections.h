// SPDX-License-Identifier: MIT
#pragma once
#include "skeletex/compact/encode/encode_compact.h"
#include "skeletex/device/context.h"

namespace skeletex {

/// Encodes a model again where triangles of its mesh intersect: points there are stored at their home places. The new
/// encoding costs bytes, and is kept only when at least half of the intersections go. Nothing is tried where there is
/// more than one pair for 250 texels of the wanted size.
/// \param model    in its unit frame; its surface is `source`
/// \param options  those that `compact` was made with; out: those that it is then made with
/// \param compact  as encode_compact made it; out: the one with fewer intersections, or the same
/// \throw DeviceError
void reduce_intersections(ClContext& context, const SkeletexModel& model, const SourceSurface& source,
                          CompactOptions& options, CompactModel& compact);

}  // namespace skeletex
