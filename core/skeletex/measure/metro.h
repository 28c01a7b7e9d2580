// SPDX-License-Identifier: MIT
#pragma once
#include <span>
#include <vector>

#include "skeletex/cl/context.h"
#include "skeletex/model/mesh.h"

namespace skeletex {

/// Distances divided by the bounding box diagonal of mesh A.
struct DistanceStatistics {
  double mean = 0, std = 0, rms = 0, max = 0;
};

struct MetroOptions {
  /// Points spread evenly over each surface; 0: ten per vertex of the mesh with more vertices, at least 100 000.
  long samples = 0;
};

struct MetroReport {
  double diagonal = 0;          ///< of A
  DistanceStatistics forward;   ///< from points on A's surface to B
  DistanceStatistics backward;  ///< from points on B's surface to A
  DistanceStatistics vertex;    ///< from A's vertices to B: what the paper's Figure 14 shows
  std::vector<float> vertex_distances;  ///< per vertex of A, world units
  double seconds = 0;
};

/// Distances between two surfaces as the metro tool (Cignoni et al. 1998) and the paper measure them, on the device.
/// Deterministic: the points are a low-discrepancy set over each triangle, in numbers that follow its area.
MetroReport measure_metro(ClContext& context, const TriangleMesh& a, const TriangleMesh& b, const MetroOptions& options = {});

/// Distance from each point to the nearest point of the mesh, on the device, world units.
std::vector<float> closest_distances(ClContext& context, const TriangleMesh& mesh, std::span<const Vec3> points);

}  // namespace skeletex
