// SPDX-License-Identifier: MIT
#pragma once
#include <span>
#include <vector>

#include "skeletex/geometry/mesh.h"
#include "skeletex/skeleton/bone_motion.h"

namespace skeletex {

/// Per vertex the weights of bones, by what a user would take without this project: each vertex' own bone, diffused
/// over the surface.
using VertexWeights = std::vector<std::vector<BoneWeight>>;

/// One implicit step of the cotangent Laplacian, (M + width^2 L) w = M w0 with w0 = 1 for the vertex' own bone. Weights
/// below 0 are cut; no number of bones is.
/// \param own  bone of each vertex
/// \param width  world units
VertexWeights diffused_weights(const TriangleMesh& bind, std::span<const int> own, int bone_count, double width);

std::vector<Vec3> skin_linearly(std::span<const Vec3> bind, const VertexWeights& weights,
                                std::span<const BoneMotion> motions);
std::vector<Vec3> skin_by_dual_quaternions(std::span<const Vec3> bind, const VertexWeights& weights,
                                           std::span<const BoneMotion> motions);

}  // namespace skeletex
