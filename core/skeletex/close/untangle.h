// SPDX-License-Identifier: MIT
#pragma once
#include <vector>

#include "skeletex/geometry/mesh.h"

namespace skeletex {

/// Takes triangles away at edges that more than two triangles share, or two that run through it in the same direction,
/// and what is left of fins there, as long as that is next to nothing of the mesh. The holes are to be filled.
/// \param origins  per triangle of the mesh any number; kept beside the triangles
/// \return triangles that went
int remove_tangles(TriangleMesh& mesh, std::vector<int>& origins);

/// Gives each sheet of surface that touches others in a single vertex a vertex of its own, in the same place.
/// \return per new vertex, which come last, the one that it is a copy of
std::vector<int> split_vertices(TriangleMesh& mesh);

/// Takes away the parts of a mesh with less than a share of its area.
/// \param origins  as in remove_tangles
/// \return parts that went
int remove_crumbs(TriangleMesh& mesh, double share, std::vector<int>& origins);

}  // namespace skeletex
