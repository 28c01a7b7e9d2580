// SPDX-License-Identifier: MIT
#pragma once
#include <memory>
#include <span>
#include <vector>

#include "skeletex/convert/parameterize/method.h"

namespace skeletex {

/// Vertex-sampling-maximizing maps (paper 3.2.2) of all charts together: weights, then one elimination per iteration in
/// single precision on the device, for u and v at once, by fronts that many work-groups share. Fills u and v of every
/// inner vertex. A chart with flipped triangles is solved again by a sparse factorization on the host (map_directly).
/// \return one report per chart
std::vector<MapReport> solve_vsm(ClContext& context, std::span<Chart> charts, const VsmOptions& options = {});

std::unique_ptr<ParameterizationMethod> make_vsm_method();

}  // namespace skeletex
