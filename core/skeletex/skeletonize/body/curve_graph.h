// SPDX-License-Identifier: MIT
#pragma once
#include <vector>

#include "skeletex/skeletonize/body/voxel_body.h"

namespace skeletex {

/// A curve between two nodes of a graph; both may be the same.
struct Branch {
  int from = -1, to = -1;
  std::vector<Vec3> points;  ///< from node to node, with their positions
};

/// Curves in the middle of a body.
struct CurveGraph {
  std::vector<Vec3> nodes;
  std::vector<Branch> branches;
  int cycles() const { return static_cast<int>(branches.size()) - static_cast<int>(nodes.size()) + 1; }
  /// Ends of branches at each node.
  std::vector<int> degrees() const;
};

/// The graph of a body's thinned voxels. Voxels with three neighbours or more that touch are one node, at the deepest.
CurveGraph make_curve_graph(const VoxelBody& body, const std::vector<char>& is_left);

/// Takes branches away until the graph has that many cycles: loops and branches through the narrowest places first.
void limit_cycles(const Surface& surface, int cycles, CurveGraph& graph);

/// Takes away nodes with two branches, which become one.
void join_branches(CurveGraph& graph);

/// Smooths the branches, and moves their points to the middle of the body where it is not much thicker than a voxel.
/// No branch leaves the body by it.
void smooth_branches(const Surface& surface, double voxel_side, CurveGraph& graph);

/// Merges branching nodes that are nearer to each other than the larger of their balls' radii.
void merge_hubs(const Surface& surface, CurveGraph& graph);

}  // namespace skeletex
