// SPDX-License-Identifier: MIT
#pragma once
#include "skeletex/edit/transfer/placement.h"

namespace skeletex {

/// The layers of the target after a transfer. In the parts they are the source's, over the rows of the blend mixed with
/// the target's; normals turn with the surface from the source's shape to the result's. Layers that the source lacks
/// stay the target's (normals: those of its triangles). Outside the parts all stay bit by bit.
/// \param result  the target with its new texels
std::vector<Layer> transfer_layers(ClContext& context, const TransferInput& input, const Placement& placement,
                                   const SkeletexModel& result);

}  // namespace skeletex
