// SPDX-License-Identifier: MIT
#pragma once
#include "skeletex/compact/compact_model.h"
#include "skeletex/model/texture.h"

namespace skeletex {

/// The model of a compact one. The same integers give the same points.
/// \param octaves  doublings of rows and columns beyond the size of the file; negative: halvings
/// \throw IoError when its parts do not fit together; InputError when memory does not suffice
SkeletexModel decode_model(const CompactModel& compact, int octaves = 0);

/// The longer side of the texture that decode_model gives.
int decoded_size(const CompactModel& compact, int octaves);
/// How many of the finest steps of every patch decode_model does not take; 0 or more.
int unused_steps(const CompactModel& compact, int octaves);
/// The fewest octaves, from -8 to 8, at which it is at least `size`.
int octaves_for(const CompactModel& compact, int size);

}  // namespace skeletex
