// SPDX-License-Identifier: MIT
#pragma once
#include <vector>

#include "skeletex/convert/sample/device_maps.h"
#include "skeletex/device/context.h"
#include "skeletex/model/texture.h"
#include "skeletex/reconstruct/displace.h"

namespace skeletex {

/// Root mean squares over texels of how far their points leave the planes of the lattice's triangles around, world
/// units.
struct RoundingReport {
  double nearest = 0;  ///< with the nearest half floats
  double chosen = 0;   ///< with those that are taken
};

/// Rounds the texels of inner rows to half floats (16 bits). The nearest ones move points by up to half a step of each
/// number, in any direction; of those near them the ones are taken whose points stay nearest to the lattice's own
/// planes around, so that they move along the surface. Texels of rows 0 and height-1, and numbers that are 0, stay: SPD
/// texels are the nearest ones.
/// \param rule     of the lattice's diagonals
/// \param points   of the texels, relative to the origin of the layout's tables
/// \param texels   in and out: along, around, out
RoundingReport round_to_half(ClContext& context, DiagonalRule rule, const std::vector<Patch>& patches,
                             const DeviceLayout& layout, const DevicePlanes& points, DevicePlanes& texels);

struct RoundedModel {
  SkeletexModel model;
  RoundingReport report;
};
/// The same for a model's texels as they are.
/// \throw DeviceError
RoundedModel round_to_half(ClContext& context, const SkeletexModel& model);

}  // namespace skeletex
