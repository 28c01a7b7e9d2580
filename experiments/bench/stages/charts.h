// SPDX-License-Identifier: MIT
#pragma once
#include <vector>

#include "inputs.h"
#include "skeletex/convert/parameterize/chart.h"

namespace skeletex {

struct ChartSet {
  std::vector<Chart> charts;
  std::vector<double> areas;
};
/// The segments of a mesh, ready to be mapped.
ChartSet charts_of(ClContext& context, const MeshInput& input);

}  // namespace skeletex
