// SPDX-License-Identifier: MIT
// Parts of repair_skeleton: the skeleton that skeletonize makes for the mesh in place of one that would lose limbs.
#pragma once
#include "skeletex/skeletonize/body/surface.h"
#include "skeletex/skeletonize/repair.h"

namespace skeletex {

/// The share of a skeleton's length that another one keeps: a place on its bones counts where a bone of the other is no
/// farther away than the radius of the body there and 6 % of the diagonal, without the surface between.
double followed_share(const Surface& surface, const Skeleton& skeleton, const Skeleton& other);

/// Gives an accepted skeleton the nodes of another one. A node that lies next to one of the other's takes its name, and
/// bones that pass by the rest are split there. Bends that the other does not have go, and so do limbs whose free ends
/// are near its bones. Separation planes stay as far apart as they have to be.
/// \param accepted  a skeleton with any names
/// \param wanted  a skeleton with names whose nodes lie inside the body
/// \param original  the places where nodes of those names should be
/// \return a skeleton whose nodes have names of the wanted one or are called bend, bend_2, ..; bones have any names
Repair with_nodes_of(const Surface& surface, Skeleton accepted, const Skeleton& wanted, const Skeleton& original);

/// Names and turns bones as those of another skeleton. A bone takes the name of the one between nodes of the same
/// names, else of the nearest; a second one of a name is called name_part.
void take_bone_names(const Skeleton& wanted, Skeleton& skeleton);

}  // namespace skeletex
