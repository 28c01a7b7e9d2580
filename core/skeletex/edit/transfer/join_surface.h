// SPDX-License-Identifier: MIT
#pragma once
#include <array>
#include <span>
#include <vector>

#include "skeletex/device/context.h"
#include "skeletex/model/texture.h"

namespace skeletex {

/// The surface of a bone's part, placed around the target's bone without corrections. Points go row by row, all rows.
struct PlacedPatch {
  BoneIndex bone = 0;
  std::vector<Vec3> placed;  ///< world units
  std::vector<Vec3> source;  ///< the same points of the surface that it comes from, which may lie anywhere
  /// By column, the first and the last row of the part; outside of them the surface is the target's.
  std::vector<std::array<int, 2>> rows;
  /// By column, the offsets from these rows to the target's, at head and tail; empty where the target has none.
  std::array<std::vector<Vec3>, 2> gaps;
};

/// Joins a part to a model so that its seams are as smooth as those of the source and the target. First the gaps are
/// spread over the part, fading over `distance`. Then edges are rotated to the source's orientation (where bones of the
/// part meet, by the mean of their rotations), and the surface with such edges is solved for (orientation.h; Poisson
/// shapes, Yu et al. 2004). The orientation goes from the target's, where the part begins, to the source's over
/// `distance`.
/// \param target    the model without the part
/// \param model     the same with the part's rows and seams; its texels inside of the part are not read, those outside
///                  stay bit by bit
/// \param distance  diagonals
SkeletexModel join_surface(ClContext& context, const SkeletexModel& target, const SkeletexModel& model,
                           std::span<const PlacedPatch> patches, double distance);

}  // namespace skeletex
