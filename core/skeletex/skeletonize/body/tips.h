// SPDX-License-Identifier: MIT
#pragma once
#include <vector>

#include "skeletex/skeleton/skeleton.h"
#include "skeletex/skeletonize/body/body_paths.h"

namespace skeletex {

/// Which ends of a body count as tips of limbs. A path from a tip to what there is of the skeleton has the length L and
/// ends where the ball in the body has the radius r.
struct TipRule {
  double longer_than_wide = 1.6;  ///< L must be above this times r
  double least_length = 0.07;     ///< and L - r above this; diagonals
  double covered_radii = 1.4;     ///< a path covers what is within so many times its balls' radii,
  double least_covered = 0.06;    ///< but at least this far; diagonals
};

inline constexpr int kMostTips = 24;

/// Voxels at the tips of limbs, the farthest from the roots first.
std::vector<int> find_tips(const VoxelBody& body, const BodyPaths& paths, const TipRule& rule, double diagonal);

/// What of a body is near to the tip of a limb, by the ways through the body: the tip of a leg is not near to the next
/// leg, however near that comes.
struct LimbTip {
  Vec3 position;
  double reach = 0;          ///< how far away a node may be, world units
  std::vector<Vec3> places;  ///< centres of the voxels that ways from the tip soon lead to
  double voxel_side = 0;     ///< world units
};

/// \param tips   voxels at the tips
/// \param reach  world units, beyond the ball in the body around the tip
std::vector<LimbTip> places_near(const VoxelBody& body, const std::vector<int>& tips, double reach);

/// How many of the tips have a node of a skeleton near to them.
int count_reached(const std::vector<LimbTip>& tips, const Skeleton& skeleton);

/// The two ends of the longest way through a body, about.
std::vector<int> find_ends(const VoxelBody& body);

}  // namespace skeletex
