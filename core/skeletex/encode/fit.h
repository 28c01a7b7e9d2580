// SPDX-License-Identifier: MIT
#pragma once
#include <span>
#include <vector>

#include "skeletex/encode/snap.h"

namespace skeletex {

struct FitOptions {
  int steps = 4;            ///< of Gauss-Newton, at most
  int sweeps = 4;           ///< of the solver, per step
  float damping = 0.0005f;  ///< of a step, share of a texel's mean diagonal entry
  float springs = 0.001f;   ///< between the steps of neighbouring texels, the same share
  float floor = 1;          ///< added to |residual| in the weights, share of the mean one
};

/// What the fit did.
struct FitReport {
  std::vector<double> residuals;  ///< before each step and after the last: mean distance of the samples, world units
  int texels_put_back = 0;        ///< by the guard
};

/// Moves the points of VSM patches in space so that the flat triangles between them are nearer to the mesh, in both
/// directions: Gauss-Newton with weights 1 / |residual|, so the mean distance falls and not its square. Samples are four
/// points of the mesh per quad of the lattice and the middle of each of its triangles. End rows stay; no point moves by more
/// than a quarter of a cell in a step and a cell in all; what folds goes back. See docs/snap.md.
/// \param covering  per texel the triangle of the map that covers its place, as encode.cl's cover_texels leaves it
/// \param even      the even lattice's points, the guard's measure
FitReport fit_points(ClContext& context, const DeviceLayout& layout, const DeviceMaps& maps, const ClBuffer<int>& covering, const TexelPoints& even,
                     ReadingPositions& positions, TexelPoints& points, const FitOptions& options = {});

/// What put_back_far did.
struct FarReport {
  int texels_put_back = 0;
  int turned_triangles = 0, even_turned_triangles = 0;  ///< of the lattice, and of the even one: that look against the mesh
};

/// Texels go back to the even lattice where a vertex of the mesh is further from the lattice, or the middle of one of its
/// triangles from the mesh, than (nearly) the furthest of the even lattice: so the maximum does not rise.
/// \param even, filtered  the even lattice's points, and these as they would be stored
/// \param is_fitted       whether points may lie off the mesh
FarReport put_back_far(ClContext& context, std::span<const Patch> patches, const DeviceLayout& layout, const DeviceMaps& maps, const ClBuffer<int>& covering,
                       const SnapFeatures& features, const TexelPoints& even, const TexelPoints& filtered, bool is_fitted, ReadingPositions& positions,
                       TexelPoints& points);

}  // namespace skeletex
