// SPDX-License-Identifier: MIT
#pragma once
#include <array>
#include <vector>

#include "skeletex/model/texture.h"
#include "skeletex/skeleton/separation_planes.h"

namespace skeletex {

/// How separation planes divide the surface around a skeleton into its bones' segments, whatever its distance from the
/// bones: arcs without samples, corners with their angles, and the loop of arcs around every end. Where more than three
/// directions lie on one circle around a node, arcs without length separate them.
struct SeamNetwork {
  std::vector<SeamArc> arcs;
  std::vector<SeamCorner> corners;
  std::vector<Vec3> directions;  ///< of the corners from their nodes, unit
  std::vector<std::array<PatchEnd, 2>> ends;
};

/// \throw TopologyError when two bones leave a node in the same direction
SeamNetwork seam_network(const Skeleton& skeleton, const SeparationPlanes& separation);

}  // namespace skeletex
