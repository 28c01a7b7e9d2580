// SPDX-License-Identifier: MIT
#pragma once
#include <vector>

#include "skeletex/skeleton/skeleton.h"
#include "skeletex/skeletonize/body/curve_graph.h"

namespace skeletex {

/// Of the body's radius: how far off its curve a bone may be.
constexpr double kBend = 0.7;

/// Replaces the branches of a graph by straight bones inside the body, with nodes where they bend by more than a share
/// of the body's radius there. Branches with a free end stop a ball before the tip. A cycle has three bones or more.
/// Names are empty.
Skeleton make_bones(const Surface& surface, double voxel_side, const CurveGraph& graph, double bend = kBend);

/// A regular polygon of bones around the handle of a body of genus 1: its axis is a principal axis of the body, and
/// its radius is the one with which it lies deepest inside. For wheels and tori.
/// \param graph  of the thinned body, world units
/// \param bones  their number, at least 3
/// \return no bones where the graph is not a single loop, or a bone would leave the body
Skeleton make_even_ring(const Surface& surface, const VoxelBody& body, const CurveGraph& graph, int bones);

/// Where a curve inside the body is split so that straight pieces between these points do for it, ascending, its ends
/// included.
/// \param pieces  at least so many
std::vector<int> straighten(const Surface& surface, double voxel_side, const std::vector<Vec3>& points, int pieces,
                            double bend = kBend);

}  // namespace skeletex
