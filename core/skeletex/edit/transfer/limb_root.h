// SPDX-License-Identifier: MIT
#pragma once
#include <Eigen/Core>
#include <vector>

#include "skeletex/edit/transfer/bone_profile.h"

namespace skeletex {

/// Where a patch leaves the body and becomes the limb: the row of each column, from the end that the profiles begin at.
/// The closed curve follows the deepest valley around the patch (the minima rule of human shape perception): it has the
/// most concave turn at the least length and the fewest rows left out.
/// \param wanted  places across the bone, per column, that the curve should be near to; may be empty
std::vector<double> limb_root(const std::vector<BoneProfile>& columns, const std::vector<Eigen::Vector2d>& wanted);

}  // namespace skeletex
