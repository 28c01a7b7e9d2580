// SPDX-License-Identifier: MIT
#pragma once
#include "skeletex/convert/segment/cut.h"
#include "skeletex/device/context.h"
#include "skeletex/model/segment.h"

namespace skeletex {

/// The largest offset of a separation plane, in diagonals. Offsets make co-circular directions and vertices on a
/// separation plane unambiguous.
inline constexpr double kMostPerturbation = 1e-7;

/// Cuts a closed mesh along the separation planes of its skeleton and gives every bone its surface (paper 3.1).
/// Cuts follow, at each node, only the separation planes around that node. Exact to rounding: the segments' areas add
/// up to the mesh's, and depend neither on the order of vertices and triangles nor on that of bones and nodes.
/// \pre the mesh is closed, oriented outwards, 2-manifold and connected; the skeleton's nodes lie inside
/// \throw TopologyError naming bone and node, the rule that broke, the point, and what to move
Segmentation segment_mesh(ClContext& context, CutMesh mesh, const Skeleton& skeleton);
inline Segmentation segment_mesh(ClContext& context, const TriangleMesh& mesh, const Skeleton& skeleton) {
  return segment_mesh(context, cut_mesh_of(mesh), skeleton);
}

}  // namespace skeletex
