// SPDX-License-Identifier: MIT
#pragma once
#include <limits>
#include <span>
#include <vector>

#include "skeletex/skeletonize/body/voxel_body.h"

namespace skeletex {

/// Where a way through a body begins, and how long it is there already.
struct PathSource {
  int voxel = 0;
  double distance = 0;
};

/// Shortest distances through a body from some of its voxels (Dijkstra), over all 26 neighbours, world units.
/// \param costs    when given, per voxel what a step into it costs for each unit of its length
/// \param bound    ways that are longer are left out
/// \param parents  out, when given: the voxel before each; -1 where there is none
/// \return infinity where nothing leads
std::vector<double> distances_through(const VoxelBody& body, std::span<const PathSource> sources,
                                      std::span<const double> costs = {},
                                      double bound = std::numeric_limits<double>::infinity(),
                                      std::vector<int>* parents = nullptr);

/// Costs that keep ways in the middle of the body (TEASAR, Sato et al. 2000).
std::vector<double> middle_costs(const VoxelBody& body);

/// The way through the middle of the body between two voxels, with both.
std::vector<int> path_between(const VoxelBody& body, std::span<const double> middle_costs, int from, int to);

/// Shortest ways from some voxels to all others.
struct BodyPaths {
  std::vector<int> roots;
  std::vector<double> distances;  ///< from the nearest root by plain length, world units
  std::vector<int> parents;       ///< next voxel on the way to a root through the middle; -1 at roots
};
BodyPaths find_paths(const VoxelBody& body, std::vector<int> roots);

int deepest_voxel(const VoxelBody& body);

}  // namespace skeletex
