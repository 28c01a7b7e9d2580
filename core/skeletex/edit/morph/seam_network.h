// SPDX-License-Identifier: MIT
#pragma once
#include <array>
#include <vector>

#include "skeletex/model/texture.h"
#include "skeletex/skeleton/separation_planes.h"

namespace skeletex {

/// How the surface around a skeleton divides into its bones' parts, before it is known how far from the bones it lies:
/// the separation planes' arcs without samples, the corners with their angles, and every end's way through them. Where
/// more than three directions lie on one circle around a node, slivers without width separate them.
struct SeamNetwork {
  std::vector<SeamArc> arcs;
  std::vector<SeamCorner> corners;
  std::vector<Vec3> directions;  ///< of the corners from their nodes, unit
  std::vector<std::array<PatchEnd, 2>> ends;
};

/// \throw TopologyError when two bones leave a node in the same direction
SeamNetwork seam_network(const Skeleton& skeleton, const SeparationPlanes& separation);

}  // namespace skeletex
