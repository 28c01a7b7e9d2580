// SPDX-License-Identifier: MIT
#pragma once
#include <set>
#include <vector>

#include "skeletex/skeleton/skeleton.h"
#include "skeletex/skeletonize/body/mirror.h"

namespace skeletex {

/// A chain of bones from where the skeleton branches to a free end, in this order.
struct SkeletonLimb {
  std::vector<BoneIndex> bones;
  std::vector<NodeIndex> nodes;  ///< one more than bones: from the branching node to the free end
};

/// All limbs, in the order of the nodes of their free ends. A skeleton that does not branch has none.
std::vector<SkeletonLimb> find_limbs(const Skeleton& skeleton);

/// Takes bones away, and the nodes that have none then.
void drop_bones(const std::set<int>& gone, Skeleton& skeleton);

/// Per limb the one that is its mirror image, itself where it lies in the plane; -1: none.
/// \param apart  how far the tips may be from each other's images, world units
std::vector<int> pair_limbs(const Skeleton& skeleton, const std::vector<SkeletonLimb>& limbs, const MirrorPlane& plane,
                            double apart);

/// Splits the long bones of limbs about their middle, where the limb is thin: a stretched arm gets an elbow. The new
/// nodes and bones have no names.
Skeleton with_joints(const Surface& surface, Skeleton skeleton);

/// The skeleton made its own mirror image: of two limbs that are images of each other one is the image of the other
/// then, and what lies in the plane lies exactly there. Nothing where the skeleton is too far from it, or a bone would
/// leave the body.
std::optional<Skeleton> symmetrized(const Surface& surface, const MirrorPlane& plane, const Skeleton& skeleton);

}  // namespace skeletex
