// SPDX-License-Identifier: MIT
#pragma once
#include "skeletex/compact/encode/encode_compact.h"
#include "skeletex/device/context.h"

namespace skeletex {

/// Encodes a model again where triangles of its mesh intersect: there points do not slide. Keeps that where most of the
/// intersections go, as it costs bytes.
/// \param options  of `compact`, also afterwards
/// \param compact  as encode_compact made it
void reduce_intersections(ClContext& context, const SkeletexModel& model, const SourceSurface& source,
                          CompactOptions& options, CompactModel& compact);

}  // namespace skeletex
