// SPDX-License-Identifier: MIT
#pragma once
#include <cstddef>
#include <vector>

#include "skeletex/geometry/mesh.h"

namespace skeletex {

/// What polishing did to a pose.
struct PolishReport {
  long folds_before = 0, folds_after = 0;  ///< new folds (analysis/deformation.h)
  int rounds = 0;                          ///< of smoothing that were kept
  std::size_t moved_vertices = 0;
  double farthest = 0;  ///< that a vertex was moved, world units
};

/// A corrective step for poses that fold the surface. Triangles at a new fold and their neighbours are smoothed by the
/// scale-dependent Laplacian of the bind pose (Desbrun et al., Implicit Fairing of Irregular Meshes using Diffusion and
/// Curvature Flow, 1999), in up to 20 rounds. The round with the fewest new folds is kept. Connected parts that would
/// get more new intersections of triangles are reverted, so that a pose gets more of neither. Other vertices keep their
/// places. Cost: several searches for intersections, below a second for 130 000 triangles.
/// \param positions  of the bind mesh's vertices in the pose
/// \throw InputError when their number differs
PolishReport polish_pose(const TriangleMesh& bind, std::vector<Vec3>& positions);

}  // namespace skeletex
