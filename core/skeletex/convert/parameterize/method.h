// SPDX-License-Identifier: MIT
#pragma once
#include <memory>
#include <span>
#include <vector>

#include "skeletex/convert/parameterize/chart.h"
#include "skeletex/device/context.h"
#include "skeletex/model/method.h"

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

/// The options of the library's methods. A method takes those that concern it.
struct MapOptions {
  VsmOptions vsm;
};

/// How a chart was mapped; all 0 for a height field, which needs no map.
struct MapReport {
  int iterations = 0;    ///< reweightings done
  double spread = 0;     ///< coefficient of variation of the triangles' texture area
  int solver_steps = 0;  ///< refinements, all iterations together
  double residual = 0;   ///< largest |x_i - weighted mean of neighbours| relative to the mean |x_i - x_j| there
  int flipped_triangles = 0;
  bool used_direct_solver =
      false;  ///< the device's solution was not good enough and a sparse factorization replaced it
};

/// A way to map the surfaces of bones to their patches.
class ParameterizationMethod {
 public:
  virtual ~ParameterizationMethod() = default;
  /// Fills u and v of all inner vertices of the charts. A height field leaves charts as they are: its texels are found
  /// by the rays of the frames (cast_spd_rays).
  /// \return one report per chart
  virtual std::vector<MapReport> map(ClContext& context, std::span<Chart> charts, const MapOptions& options) const = 0;
};

/// The object of a registered method.
const ParameterizationMethod& parameterization(Method method);

/// Registers another method. Models can be encoded with it, written and read from then on.
/// \pre no other thread uses the table of methods
/// \throw InputError when the name is taken
Method register_method(MethodTraits traits, std::unique_ptr<ParameterizationMethod> method);

/// Maps each chart by its own method, those of one method together.
/// \return one report per chart
std::vector<MapReport> map_charts(ClContext& context, std::span<const Method> methods, std::vector<Chart>& charts,
                                  const MapOptions& options);

}  // namespace skeletex
