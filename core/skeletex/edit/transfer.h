// SPDX-License-Identifier: MIT
#pragma once
#include <string>
#include <utility>
#include <vector>

#include "skeletex/cl/context.h"
#include "skeletex/model/texture.h"

namespace skeletex {

/// How a transferred patch fades into the target near the seams that it keeps.
enum class TransferBlend { kCosine, kLinear, kNone };

struct TransferOptions {
  bool has_limbs = false;  ///< with every bone also those below it: the ones on its far side from the skeleton's root
  TransferBlend blend = TransferBlend::kCosine;
  double width = 0.25;         ///< of the fade: share of the patch's rows
  double width_in_texels = 0;  ///< instead, where it is above 0: rows
};

/// The target with the surfaces of some bones replaced by those of the source's (paper 5, Figures 17 and 18): inner
/// segments, leaves, or whole limbs. The target's skeleton stays, and so do its seams with bones that are not replaced and all texels of
/// these, bit by bit. The source's displacements are scaled by the ratio of the girths where its patch meets the target,
/// its length follows the target's bone, and its angle is the one that leaves the rest of the body on the same side.
/// Of limbs, the seams in between are the source's.
/// \param bones  names (source, target)
/// \throw InputError when a bone is unknown, one of a pair ends freely and the other does not, the bones below them
///        branch differently, or a limb is part of a cycle, naming the bone
SkeletexModel transfer(ClContext& context, const SkeletexModel& source, const SkeletexModel& target,
                       const std::vector<std::pair<std::string, std::string>>& bones, const TransferOptions& options = {});

}  // namespace skeletex
