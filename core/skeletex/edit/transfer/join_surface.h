// SPDX-License-Identifier: MIT
#pragma once
#include <array>
#include <span>
#include <vector>

#include "skeletex/device/context.h"
#include "skeletex/model/texture.h"

namespace skeletex {

/// A bone's surface from elsewhere, laid where it shall be but for what it misses at its ends. Points go row by row,
/// all rows.
struct PlacedPatch {
  int bone = 0;
  std::vector<Vec3> placed;  ///< world units
  std::vector<Vec3> source;  ///< the same points of the surface that it comes from, which may lie anywhere
  std::vector<std::array<int, 2>>
      rows;  ///< by column the first and the last row of the part; beyond them the surface is the target's
  std::array<std::vector<Vec3>, 2>
      gaps;  ///< by column, from these rows to the target's, at head and tail; empty where the target has none
};

/// Puts a part on a model so that it hangs together and meets the model as smoothly as the source and the target do:
/// gaps spread over the part, fading over `distance`, then edges are rotated to the source's orientation (where bones
/// of the part meet, by the mean of their rotations), and the surface is solved for that has such edges (orientation.h;
/// Poisson shapes, Yu et al. 2004). Where the part begins, its orientation is the target's, which goes over into the
/// source's over `distance`. \param target    the model without the part \param model     the same with the part's rows
/// and seams; its texels inside of the part do not count, those outside stay bit by bit \param distance  diagonals
SkeletexModel join_surface(ClContext& context, const SkeletexModel& target, const SkeletexModel& model,
                           std::span<const PlacedPatch> patches, double distance);

}  // namespace skeletex
