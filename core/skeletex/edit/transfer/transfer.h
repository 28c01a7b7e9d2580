// SPDX-License-Identifier: MIT
#pragma once
#include <string>
#include <utility>
#include <vector>

#include "skeletex/device/context.h"
#include "skeletex/model/texture.h"

namespace skeletex {

/// How the correction that carries a part onto the seams that the target keeps fades away from them.
enum class TransferBlend { kCosine, kLinear, kNone };

/// What a part is scaled by across its bones. Along them its length always follows the target's bones.
enum class TransferScale {
  kAuto,    ///< the geometric mean of kLength and kGirth; of parts between two seams kGirth
  kLength,  ///< ratio of the lengths of all bones of the part: it keeps its proportions
  kGirth,   ///< ratio of the girths where the correction ends; linear between two seams
  kFactor   ///< TransferOptions::factor
};

struct TransferOptions {
  bool has_limbs = false;  ///< with every bone also those below it: the ones on its far side from the skeleton's root
  TransferBlend blend = TransferBlend::kCosine;
  double width = -1;  ///< of the fade: share of the patch's rows; below 0: 0.25, of parts between two seams 0.5
  double width_in_texels = 0;  ///< instead, where it is above 0: rows
  TransferScale scale = TransferScale::kAuto;
  double factor = 1;
  double keep = -1;  ///< share of its rows that the target keeps at its seams; below 0: up to where the two fit best
  double skip = -1;  ///< share of the source's rows that is left out there; below 0: up to where the two fit best
  /// With kCosine, a part that ends freely and has no root in its first bone is joined over the surface, so that it
  /// meets the target and hangs together as smoothly as on the source (join_surface.h). Without it the correction alone
  /// carries each column onto the seam.
  bool is_smooth = true;
};

/// What was done to one pair of bones.
struct TransferredPart {
  double scale = 0;         ///< across the bones, at the part's beginning
  double length_scale = 0;  ///< along the first bone
  double skipped = 0;       ///< share of the source's rows at its beginning
  double kept = 0;          ///< share of the target's rows there
};

/// The target with the surfaces of some bones replaced by those of the source's (paper 5, Figures 17 and 18): inner
/// segments, leaves, or whole limbs. The target's skeleton stays, and so do its seams with bones that are not replaced
/// and all texels of these, bit by bit; of limbs, the seams in between are the source's. The part keeps its shape but
/// for an affine map: along the bone to the target's length, across it scaled, turned about it so that the rest of the
/// body stays on the same side. Near the seams that the target keeps an offset is added that carries the part's edge
/// onto the seam and turns it into the target's slope, and fades (see docs/transfers.md). \param bones  names (source,
/// target) \param parts  if given, receives one entry per pair of bones \throw InputError when a bone is unknown, one
/// of a pair ends freely and the other does not, the bones below them
///        branch differently, or a limb is part of a cycle, naming the bone
SkeletexModel transfer(ClContext& context, const SkeletexModel& source, const SkeletexModel& target,
                       const std::vector<std::pair<std::string, std::string>>& bones,
                       const TransferOptions& options = {}, std::vector<TransferredPart>* parts = nullptr);

}  // namespace skeletex
