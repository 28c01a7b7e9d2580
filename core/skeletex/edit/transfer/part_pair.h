// SPDX-License-Identifier: MIT
#pragma once
#include <array>
#include <vector>

#include "skeletex/edit/morph/seam_map.h"
#include "skeletex/edit/transfer/part.h"
#include "skeletex/edit/transfer/transfer.h"

namespace skeletex {

/// Where a part begins at an end of its first bone, by column of the target's patch.
struct PartCut {
  std::vector<double> kept_rows, skipped_rows;  ///< of the target's patch and of the source's, from that end
  double kept = 0, skipped = 0;                 ///< mean lengths along the bones, world units
  double scale = 1;                             ///< across the bone, there
  double radius = 0;                            ///< mean distance of the target's surface from the bone, there
};

/// A part of the source and the part of the target that it replaces. Bone i is bone i of the target's part.
class PartPair {
 public:
  /// All but the parts must outlive this.
  /// \throw InputError when the parts do not branch alike
  PartPair(const SkeletexModel& source, const SkeletexModel& target, Part from, Part to,
           const TransferOptions& options);

  int count() const { return static_cast<int>(to_.bones.size()); }
  int target_bone(int i) const { return to_.bones[i]; }
  int source_bone(int i) const { return from_.bones[map_.model_bone(i)]; }
  const Patch& target_patch(int i) const { return target_.patches[target_bone(i)]; }
  const Patch& source_patch(int i) const { return source_.patches[source_bone(i)]; }
  double target_length(int i) const { return bone_length(target_.skeleton, target_bone(i)); }
  double source_length(int i) const { return bone_length(source_.skeleton, source_bone(i)); }
  const SeamMap& map() const { return map_; }
  BoneEnd near() const { return to_.near; }

  /// Whether a seam lies there that the target keeps.
  bool is_boundary(int i, BoneEnd end) const {
    return !is_free_end(target_, target_bone(i), end) && !is_inner_seam(i, end);
  }
  /// Whether a seam between bones of the part lies there.
  bool is_inner_seam(int i, BoneEnd end) const { return !is_free_end(to_.model, i, end); }
  /// Whether the part is one bone between two seams that the target keeps.
  bool is_between() const { return count() == 1 && is_boundary(0, BoneEnd::kHead) && is_boundary(0, BoneEnd::kTail); }
  bool is_scaled_by_girth() const;

  /// Rows over which the correction fades.
  double width_in_rows(int i) const;
  /// The distance over the surface over which the part joins the target, world units.
  double join_distance() const;
  /// The length of all bones of the target's part over that of the source's.
  double length_ratio() const;

  PartCut& cut(BoneEnd end) { return cuts_[static_cast<int>(end)]; }
  const PartCut& cut(BoneEnd end) const { return cuts_[static_cast<int>(end)]; }
  /// Scale and offset of places along a bone, source to target. A bone that ends freely takes all of the source's.
  double length_scale(int i) const;
  double length_offset(int i) const;

  /// Sets the rows of the result's patch to the source's, unless the target keeps some of its own.
  void set_rows(int i, Patch& patch) const;
  /// Sets the seams between bones of the part to the source's.
  /// \param separation  of the target
  void set_seams(SkeletexModel& result, const SeparationPlanes& separation) const;

  /// How far a point at a distance of 1 from the bone (source's units) moves along the bone, from the source's
  /// separation plane at an end to the target's.
  /// \param turn  of the result
  double shear(const SeparationPlanes& source_separation, const SeparationPlanes& separation, int i, BoneEnd end,
               double turn) const;
  /// The offset from the placed part's seam between bones of the part to the result's: across the bone, 0, along it.
  Vec3 seam_offset(const SeparationPlanes& source_separation, const SeparationPlanes& separation, int i, BoneEnd end,
                   double turn) const;

 private:
  int index_of(BoneIndex target_bone) const;
  bool is_inside(BoneIndex target_bone, NodeIndex node) const;
  double seam_distance(const SeparationPlanes& separation, NodeIndex node, const std::vector<BoneIndex>& bones,
                       const Vec3& direction) const;

  const SkeletexModel &source_, &target_;
  Part from_, to_;
  TransferOptions options_;
  SeamMap map_;
  std::array<PartCut, 2> cuts_;
};

}  // namespace skeletex
