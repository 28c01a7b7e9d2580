// SPDX-License-Identifier: MIT
#pragma once
#include <functional>
#include <span>
#include <vector>

#include "skeletex/convert/parameterize/chart.h"
#include "skeletex/device/context.h"

namespace skeletex {

struct VsmOptions {
  /// Reweightings after the first solve with unit weights; 0 is the plain barycentric map.
  int iterations = 4;
  /// Weights are multiplied by A / A3^alpha (A texture area, A3 surface area of the edge's two triangles,
  /// slivers counted as 1e-6 of the mean), then normalised. 0 is the paper's rule.
  double alpha = 0.5;
  /// Stop earlier when an iteration changes the spread (coefficient of variation of texture area) of a segment by less
  /// than this share; 0: never.
  double stop_spread_change = 0;
  /// The solver stops when max |x_i - weighted mean of neighbours| / mean |x_i - x_j| is below this, for u and for v:
  /// at the last solve, and at those before it, which only serve to find weights.
  double tolerance = 1e-3;
  double intermediate_tolerance = 3e-2;
  int max_steps = 20;       ///< refinements per solve at most
  int work_group_size = 0;  ///< of the solver; 0: by device. Another size changes the map within the tolerance
};

struct VsmReport {
  int iterations = 0;    ///< reweightings done
  double spread = 0;     ///< coefficient of variation of the triangles' texture area
  int solver_steps = 0;  ///< refinements, all iterations together
  double residual = 0;   ///< largest |x_i - weighted mean of neighbours| relative to the mean |x_i - x_j| there
  int flipped_triangles = 0;
  bool used_direct_solver =
      false;  ///< the device's solution was not good enough and a sparse factorization replaced it
};

/// Vertex-sampling-maximizing maps (paper 3.2.2) of all charts together: weights, then one elimination per iteration in
/// single precision on the device, for u and v at once, by fronts that many work-groups share. Fills u and v of every
/// inner vertex. A chart with flipped triangles is solved again by a sparse factorization on the host. \return one
/// report per chart
std::vector<VsmReport> solve_vsm(ClContext& context, std::span<Chart> charts, const VsmOptions& options = {});

}  // namespace skeletex
