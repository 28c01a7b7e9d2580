// SPDX-License-Identifier: MIT
#pragma once
#include <span>
#include <string>
#include <vector>

#include "skeletex/device/context.h"
#include "skeletex/model/texture.h"
#include "skeletex/skeleton/correspondence.h"

namespace skeletex {

/// A point on each of two surfaces that is to become one point of their morph, in the user's units.
struct Landmark {
  std::string name;
  Vec3 first = Vec3::Zero(), second = Vec3::Zero();
};

/// A model whose landmarks lie where a morph looks for those of the first one. Its texels are read anew from its own
/// surface at moved places (PatchWarp); skeleton, seams and surface stay, so that a morph still ends at it, up to the
/// error of other texels.
/// \param first_to_second  from the bones of the first model to those of the second
/// \return the second model, in the first one's unit frame
/// \throw InputError naming the landmark that lies on a seam, or on another bone than its partner; or when landmarks
///        cannot be met without folding the map; DeviceError
SkeletexModel align_landmarks(ClContext& context, const SkeletexModel& first, SkeletexModel second,
                              const Correspondence& first_to_second, std::span<const Landmark> landmarks);

/// Per landmark, how far from its place on the second model a morph maps that of the first, in the second one's
/// diagonals.
/// \throw DeviceError
std::vector<double> landmark_distances(ClContext& context, const SkeletexModel& first, const SkeletexModel& second,
                                       const Correspondence& first_to_second, std::span<const Landmark> landmarks);

}  // namespace skeletex
