// SPDX-License-Identifier: MIT
// Parts of repair_skeleton: a skeleton of the mesh's own in place of one that would lose limbs.
#pragma once
#include <string>

#include "skeletex/skeletonize/body/surface.h"
#include "skeletex/skeletonize/repair.h"

namespace skeletex {

/// How much of a skeleton another one follows: the share of the length of its bones that lies near a bone of the other,
/// without the surface between.
double followed_share(const Surface& surface, const Skeleton& skeleton, const Skeleton& other);

/// Gives an accepted skeleton the nodes of another one: the nodes nearest to the other's take their names, and bones
/// that pass by the rest are split there. Limbs and bends that the other does not have go. All as far as margins stay
/// enough.
/// \param accepted  any names
/// \param wanted  with names; its nodes lie inside the body
/// \param original  the places where nodes of those names should be
/// \return with nodes of the other's names, and bones without meaningful names
Repair with_nodes_of(const Surface& surface, Skeleton accepted, const Skeleton& wanted, const Skeleton& original);

/// Bones take the names and directions of those of another skeleton: of the one between nodes of the same names, else
/// of the nearest. What is left over is numbered.
void take_bone_names(const Skeleton& wanted, Skeleton& skeleton);

}  // namespace skeletex
