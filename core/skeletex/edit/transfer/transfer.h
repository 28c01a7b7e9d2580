// SPDX-License-Identifier: MIT
#pragma once
#include <string>
#include <utility>
#include <vector>

#include "skeletex/device/context.h"
#include "skeletex/model/texture.h"

namespace skeletex {

/// How the correction that moves a part onto the seams that the target keeps fades with the distance from them.
enum class TransferBlend { kCosine, kLinear, kNone };

/// The scale of a part across its bones. Along them its length always follows the target's bones.
enum class TransferScale {
  kAuto,    ///< the geometric mean of kLength and kGirth; of parts between two seams kGirth
  kLength,  ///< ratio of the lengths of all bones of the part: it keeps its proportions
  kGirth,   ///< ratio of the girths where the correction ends; linear between two seams
  kFactor   ///< TransferOptions::factor
};

struct TransferOptions {
  bool has_limbs = false;  ///< with every bone also those behind its far end, as seen from the skeleton's root
  TransferBlend blend = TransferBlend::kCosine;
  double width = -1;  ///< of the fade, share of the patch's rows; below 0: 0.25, of parts between two seams 0.5
  double width_in_texels = 0;  ///< of the fade in rows; used instead where it is above 0
  TransferScale scale = TransferScale::kAuto;
  double factor = 1;
  double keep = -1;  ///< share of its rows that the target keeps at its seams; below 0: up to where the two fit best
  double skip = -1;  ///< share of the source's rows that is left out there; below 0: up to where the two fit best
  /// With kCosine, a part that ends freely and has no root in its first bone is joined over the surface, so that its
  /// seams are as smooth as the source's and the target's (join_surface.h). Otherwise the correction alone moves each
  /// column onto the seam.
  bool is_smooth = true;
};

/// What was done to one pair of bones.
struct TransferredPart {
  double scale = 0;         ///< across the bones, at the part's beginning
  double length_scale = 0;  ///< along the first bone
  double skipped = 0;       ///< share of the source's rows at its beginning
  double kept = 0;          ///< share of the target's rows there
};

/// The target with the surfaces of some bones replaced by those of the source (paper 5, Figures 17 and 18): inner
/// segments, leaves, or whole limbs. The target's skeleton stays. So do, bit by bit, its seams with bones that are not
/// replaced, and the texels of these bones. Seams between the bones of a limb are the source's.
///
/// The part keeps its shape up to an affine map: it takes the target's length along the bone, is scaled across it, and
/// is turned about it so that the rest of the body stays on the same side. Near the seams that the target keeps, an
/// offset moves the part's edge onto the seam and its slope to the target's. It fades with the distance from the seam.
/// \param bones  names: source, target
/// \param parts  if given, receives one entry per pair of bones
/// \throw InputError when a bone is unknown, one of a pair ends freely and the other does not, the bones behind them
///        branch differently, or a limb is part of a cycle, naming the bone; DeviceError
SkeletexModel transfer(ClContext& context, const SkeletexModel& source, const SkeletexModel& target,
                       const std::vector<std::pair<std::string, std::string>>& bones,
                       const TransferOptions& options = {}, std::vector<TransferredPart>* parts = nullptr);

}  // namespace skeletex
