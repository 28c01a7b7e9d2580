// SPDX-License-Identifier: MIT
#pragma once
#include <optional>
#include <vector>

#include "skeletex/skeleton/skeleton.h"
#include "skeletex/skeletonize/body/mirror.h"

namespace skeletex {

/// Turns bones so that they point away from a node.
/// \return the bones, from the node outwards
std::vector<int> turn_away_from(NodeIndex node, Skeleton& skeleton);

/// Turns all bones away from a root and names them by their place: spine_1, spine_2.. between limbs, ring_1.. on
/// cycles, limb_1_1, limb_1_2.. from the body to a tip; left_ and right_ where two limbs are mirror images. The root is
/// the node of the largest ball that is not on a limb. Limbs are numbered from the top (y, then z, then x). Left is the
/// body's own left when it faces the front that guess_stance gives. Where that front lies along the plane's normal,
/// left is the side that the normal points to.
/// \param plane  of the body, if it has one
void name_by_place(const Surface& surface, const std::optional<MirrorPlane>& plane, Skeleton& skeleton);

}  // namespace skeletex
