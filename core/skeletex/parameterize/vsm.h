// SPDX-License-Identifier: MIT
#pragma once
#include <functional>
#include <span>
#include <vector>

#include "skeletex/cl/context.h"
#include "skeletex/parameterize/chart.h"

namespace skeletex {

struct VsmOptions {
  /// Reweightings after the first solve with unit weights; 0 is the plain barycentric map.
  int iterations = 4;
  /// Weights are multiplied by A / A3^alpha (A texture area, A3 surface area of the edge's two triangles), then
  /// normalised. 0 is the paper's rule.
  double alpha = 0.5;
  /// Stop earlier when an iteration changes the spread (coefficient of variation of texture area) of a segment by less
  /// than this share; 0: never.
  double stop_spread_change = 0;
};

struct VsmReport {
  int iterations = 0;       ///< reweightings done
  double spread = 0;        ///< coefficient of variation of the triangles' texture area
  int solver_steps = 0;     ///< conjugate gradient steps, all iterations together
  double residual = 0;      ///< largest |x_i - weighted mean of neighbours| relative to the mean |x_i - x_j| there
  int flipped_triangles = 0;
  bool used_direct_solver = false;  ///< the device's solution was not good enough and a sparse factorization replaced it
};

/// Vertex-sampling-maximizing maps (paper 3.2.2) of all charts together: weights, then one conjugate-gradient solve per
/// iteration in single precision on the device, u and v with a common matrix, a work-group per chart. Fills u and v of
/// every inner vertex. A chart with flipped triangles is solved again by a sparse factorization on the host.
/// \return one report per chart
std::vector<VsmReport> solve_vsm(ClContext& context, std::span<Chart> charts, const VsmOptions& options = {});

}  // namespace skeletex
