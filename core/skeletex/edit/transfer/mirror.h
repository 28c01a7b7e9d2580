// SPDX-License-Identifier: MIT
#pragma once
#include "skeletex/model/texture.h"

namespace skeletex {

/// The mirror image of a model in the plane x = 0: a left hand becomes a right one. Exact: texels only change place and
/// sign. Bones keep their names.
SkeletexModel mirrored(const SkeletexModel& model);

}  // namespace skeletex
