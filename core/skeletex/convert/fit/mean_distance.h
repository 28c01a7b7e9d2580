// SPDX-License-Identifier: MIT
#pragma once
#include <span>
#include <vector>

namespace skeletex {

/// The mean distance of the samples of a fit, from sums per texel.
class MeanDistance {
 public:
  /// \param texel_patches  per texel its patch; -1: none
  MeanDistance(std::vector<int> texel_patches, std::size_t patches);

  /// From now on leaves out the patches whose mean is more than 20 times that of the median patch. Their maps are
  /// squeezed: no step brings their samples near, and what steps do for the other patches would not show in the sum.
  /// \param costs  per texel the sum over its samples of distance times area
  /// \param areas  the sums of the areas
  void leave_out_squeezed(std::span<const float> costs, std::span<const float> areas);

  /// \return in the unit of the distances; 0 without samples
  double of(std::span<const float> costs, std::span<const float> areas) const;

 private:
  std::vector<int> texel_patches_;
  std::vector<bool> is_left_out_;
};

}  // namespace skeletex
