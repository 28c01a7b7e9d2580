// SPDX-License-Identifier: MIT
#include "skeletex/convert/choose_placing.h"

#include <algorithm>
#include <cmath>

#include "skeletex/convert/fit/fit.h"
#include "skeletex/math/portable.h"

namespace skeletex {
namespace {

constexpr std::size_t kQuickTexels = 256 * 256;      // up to here the fit takes a tenth of a second
constexpr std::size_t kMostTexels = 1280 * 1280;     // beyond, it takes half a gigabyte and more on the device
constexpr double kFewTexels = 4.5, kManyTexels = 7;  // per vertex: with few all steps, with many none
constexpr double kRamp = 1.3;                        // between them, so that the error falls with every size
constexpr double kLeastSteps = 0.05;                 // fewer would take the time of one for nothing

double choose_fit_steps(std::size_t texels, double texels_per_vertex) {
  if (texels <= kQuickTexels) return kMostFitSteps;
  if (texels > kMostTexels) return 0;
  const double share = std::clamp((kManyTexels - texels_per_vertex) / (kManyTexels - kFewTexels), 0.0, 1.0);
  const double steps = kMostFitSteps * portable::pow(share, kRamp);
  return steps < kLeastSteps ? 0 : steps;
}

/// The mean distance from the mesh as a share of that of a regular grid.
double expected_error(bool has_snap, bool has_fit, double texels_per_vertex) {
  if (has_snap)
    return has_fit ? 0.58 * portable::pow(texels_per_vertex, -0.62) : portable::pow(texels_per_vertex, -0.8);
  return has_fit ? 0.72 * portable::pow(texels_per_vertex, -0.18) : 1;
}

}  // namespace

TexelPlacing choose_placing(std::size_t texels, std::size_t vertices, std::optional<bool> has_snap,
                            std::optional<bool> has_fit) {
  TexelPlacing placing;
  const double per_vertex = static_cast<double>(texels) / static_cast<double>(std::max<std::size_t>(1, vertices));
  placing.texels_per_vertex = per_vertex;
  if (has_fit.value_or(true)) placing.fit_steps = has_fit ? kMostFitSteps : choose_fit_steps(texels, per_vertex);
  const bool is_fitted = placing.is_fitted();
  placing.has_snap =
      has_snap.value_or(expected_error(true, is_fitted, per_vertex) < expected_error(false, is_fitted, per_vertex));
  placing.expected_error = std::min(1.0, expected_error(placing.has_snap, is_fitted, per_vertex));
  return placing;
}

}  // namespace skeletex
