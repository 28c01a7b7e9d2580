// SPDX-License-Identifier: MIT
#pragma once
#include <span>
#include <vector>

#include "skeletex/convert/layout/row_profile.h"
#include "skeletex/convert/parameterize/spd.h"

namespace skeletex {

/// How surface length grows along patches of rays (SPD): the profile of the rays' own points on a regular grid in u.
std::vector<RowProfile> ray_profiles(ClContext& context, const Skeleton& skeleton, const SeparationPlanes& separation,
                                     std::span<const Chart> charts, SpdHit hit);

}  // namespace skeletex
