// SPDX-License-Identifier: MIT
#pragma once
#include <vector>

#include "skeletex/geometry/mesh.h"

namespace skeletex {

/// A loop of edges that was cut.
struct CutLoop {
  Vec3 centre = Vec3::Zero();
  double length = 0;  ///< world units
};

struct HandleCuts {
  std::vector<CutLoop> loops;
  std::vector<int> origins;  ///< per triangle the one that it was before; -1: it closes a cut
  std::vector<int> copies;   ///< per vertex that was added, at the end, the one that it is a copy of
  double shortest_left = 0;  ///< of the loops that are left, as far as found, world units; 0: none is left
  bool is_stuck = false;     ///< a rim could not be filled, so some short loops are left
};

/// Cuts handles off: wherever a loop shorter than `longest` does not part the surface, the mesh is cut along it, the
/// two rims are drawn a little apart, and both are filled. A narrow tunnel gets plugged so, a thin bridge goes; the
/// genus falls by one each.
///
/// Loops come from trees of shortest paths and their cotrees (Erickson and Whittlesey, Greedy Optimal Homotopy and
/// Homology Generators, 2005), rooted on loops found before: short ones, though not always the shortest.
///
/// \param longest  world units
/// \pre a closed manifold of one component; finite coordinates
HandleCuts cut_handles(TriangleMesh& mesh, double longest);

}  // namespace skeletex
