// SPDX-License-Identifier: MIT
#pragma once
#include <string>
#include <vector>

#include "skeletex/device/context.h"
#include "skeletex/geometry/mesh.h"
#include "skeletex/geometry/triangle_tree.h"
#include "skeletex/skeleton/skeleton.h"

namespace skeletex {

struct RepairResult {
  Skeleton skeleton;
  std::vector<std::string> changes;  ///< one sentence each: what was moved, by how much, what was added or taken away
};

/// Changes a skeleton so that encode_model accepts it with its mesh, and as little as it can: unusable bones go, nodes
/// outside the body move to the middle of the body near by, bones that leave it get nodes on the way through it, nodes
/// move until no separation planes cross, and only what is left over then is contracted. Where that would lose limbs,
/// the skeleton that skeletonize makes is taken, with the nodes of the given one as far as they fit. Names stay.
/// \param tree  of the mesh
/// \pre the mesh is closed, oriented outwards, 2-manifold and connected
/// \throw InputError when there is no bone, an index does not exist, a position is not finite, or no node is near the
/// body (other units); TopologyError when the skeleton's cycles are not the mesh's handles, or nothing helps
RepairResult repair_skeleton(ClContext& context, const TriangleMesh& mesh, const TriangleTree& tree,
                             const Skeleton& skeleton);

}  // namespace skeletex
