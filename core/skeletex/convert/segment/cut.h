// SPDX-License-Identifier: MIT
#pragma once
#include <cstdint>
#include <vector>

#include "skeletex/convert/segment/cells.h"
#include "skeletex/geometry/cut_mesh.h"

namespace skeletex {

enum class CutStatus {
  kCut,
  kNoSurface,    ///< the separation planes do not meet the surface around the node
  kCrossesSeam,  ///< the cut would cross an earlier seam
};

struct CutOutcome {
  CutStatus status = CutStatus::kCut;
  int crossed_half_edge = -1;  ///< on the seam that would be crossed
  Vec3 point = Vec3::Zero();   ///< where
};

/// Cuts the mesh along the separation plane network around one node: that with the corners where the rays along the
/// Voronoi vertices of the directions leave the body first; with two bones the loop that most rays in the separation
/// plane from the node hit first. Other parts of the separation planes are not cut. Triangles are divided into convex
/// pieces without changing the surface. New vertices and triangles come after the old ones; a divided triangle's first
/// piece takes its place.
/// \param labels      cell of every vertex of the mesh (NodeCells::cell_of)
/// \param first_seam  the new half-edges' seams are first_seam + cell of the triangle on that side
/// \return how it went; unless kCut the mesh is unchanged
CutOutcome cut_along_separation(CutMesh& mesh, const NodeCells& node, const std::vector<std::uint8_t>& labels,
                                int first_seam);

}  // namespace skeletex
