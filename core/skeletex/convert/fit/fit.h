// SPDX-License-Identifier: MIT
#pragma once
#include <span>
#include <vector>

#include "skeletex/convert/snap/snap.h"

namespace skeletex {

/// Steps of a fit where texels are few, or where one is asked for.
inline constexpr double kMostFitSteps = 4;

/// What the fit did.
struct FitReport {
  /// Before each step and after the last: mean distance of the samples, but those of patches with squeezed maps. World
  /// units.
  std::vector<double> residuals;
  int reverted_texels = 0;  ///< see revert_faults
};

/// Moves the points of VSM patches in space so that the flat triangles between them are nearer to the mesh, in both
/// directions: Gauss-Newton with weights 1 / |residual|, so the mean distance falls and not its square. Samples are
/// four points of the mesh per quad of the lattice and the middle of each of its triangles. End rows stay; no point
/// moves by more than a quarter of a cell in a step and a cell in all. See docs/steps/snap.md.
/// \param covering  per texel the triangle of the map that covers its place, as encode.cl's cover_texels leaves it
/// \param steps  of Gauss-Newton, at most; 2.5: three, of which the third goes half the way
FitReport fit_points(ClContext& context, const DeviceLayout& layout, const DeviceMaps& maps,
                     const ClBuffer<int>& covering, const ReadingPositions& positions, DevicePlanes& points,
                     double steps);

}  // namespace skeletex
