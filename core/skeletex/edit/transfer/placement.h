// SPDX-License-Identifier: MIT
#pragma once
#include <array>
#include <memory>
#include <span>
#include <vector>

#include "skeletex/edit/transfer/bone_profile.h"
#include "skeletex/edit/transfer/part_pair.h"
#include "skeletex/edit/transfer/place_part.h"

namespace skeletex {

/// What a transfer reads of its two models.
struct TransferInput {
  TransferInput(ClContext& context, const SkeletexModel& source, const SkeletexModel& target,
                const TransferOptions& options);
  TransferInput(const TransferInput&) = delete;  // the patches refer to the points

  const SkeletexModel &source, &target;
  TransferOptions options;
  SeparationPlanes source_separation, separation;           ///< of the source, of the target
  SkeletexModel regular_source, regular_target;             ///< on regular grids; their points are mixed
  DevicePlanes source_points, target_points;                ///< in bone axes
  BonePoints source_host, target_host;                      ///< the same points
  std::vector<PatchPoints> source_patches, target_patches;  ///< the same points, per bone
};

/// Sets where the part leaves the body at the boundaries of its first bone, and what it is scaled by.
void find_cuts(const TransferInput& input, PartPair& pair);

/// The source's parts as they are placed around the target's bones.
struct Placement {
  /// Per bone of the target: the pair that replaces it, and the bone's number in it; nullptr where it stays.
  struct Owner {
    PartPair* pair = nullptr;
    int index = 0;
  };
  std::vector<Owner> owners;
  FrameTables frames;  ///< of the result
  TransferTables tables;
  std::vector<std::size_t> first;  ///< per bone, the point of row 0, column 0
  BonePoints points;               ///< without corrections
  /// Per bone and end, by column: the offset from the placed part's edge to the target's, in bone axes; empty where the
  /// target keeps no seam.
  std::vector<std::array<std::vector<Vec3>, 2>> gaps;
};
/// Places all parts at once. Moves the beginnings of parts whose surface would run back along the bone, leans parts
/// towards the target's edge, and finds the corrections.
/// \param result  the target with the rows and seams of the result
/// \throw InputError when a bone of the target is replaced twice
Placement place_parts(ClContext& context, const TransferInput& input, const SkeletexModel& result,
                      std::span<const std::unique_ptr<PartPair>> pairs);

}  // namespace skeletex
