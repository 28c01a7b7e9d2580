// SPDX-License-Identifier: MIT
#pragma once
#include <span>
#include <vector>

#include "skeletex/convert/parameterize/chart.h"
#include "skeletex/convert/parameterize/elimination.h"
#include "vsm_structs.h"

namespace skeletex {

/// The systems of charts in the layout of vsm.cl.
struct VsmTables {
  VsmLayout layout{};
  std::vector<int> tables;                        ///< see VsmLayout
  std::vector<signed char> jumps;                 ///< per entry
  std::vector<float> factors;                     ///< per entry
  std::vector<int> corners;                       ///< three planes
  std::vector<signed char> corner_jumps;          ///< two planes
  std::vector<float> map;                         ///< u and v of all vertices, and what they are more than these floats
  std::vector<std::vector<int>> device_vertices;  ///< per chart and vertex: its place in the map
  EliminationTables elimination;
};

/// \param alpha  see VsmOptions
VsmTables make_vsm_tables(std::span<const Chart> charts, double alpha);

/// Surface areas, kept away from zero, in units of the chart's mean.
std::vector<double> relative_surface_areas(const Chart& chart);

}  // namespace skeletex
