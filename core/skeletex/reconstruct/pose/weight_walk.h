// SPDX-License-Identifier: MIT
#pragma once
#include <vector>

#include "skeletex/model/texture.h"
#include "skeletex/skeleton/bone_motion.h"
#include "skeletex/skeleton/separation_planes.h"
#include "skeletex_structs.h"

namespace skeletex {

/// The weights of smooth posing in closed form, from the skeleton and the seams alone.
///
/// A point P belongs to one bone. A walk leads from that bone over joints to other bones, and each joint N adds to the
/// potential of the bone that it leads to. Let d_i be the unit direction from N along bone i, and g the girth there:
/// the median distance of the joint's seams to their bones, by length. Going from bone i to bone j adds (P - N).(d_i -
/// d_j) / g, and the square of how far P lies beyond the seams (skin_weight.h). Weights are exp(-potential), cut below
/// 0.002 of the largest, and normalised. Around one joint this is the softmax of (P - N).d_i / g: smooth, and the same
/// from both sides of every separation plane. Where a skeleton has cycles, the walk with the lowest potential counts.
struct WeightWalks {
  std::vector<WeightStep> steps;  ///< bone by bone, breadth first: up to six joints away, no joint twice
  std::vector<int> first_steps;   ///< per bone the first step of its walk; one more than there are bones
  int longest = 0;                ///< the most steps of one bone
};

/// The walks of all bones. The girths follow from the distances of corners and seam samples.
WeightWalks make_weight_walks(const SkeletexModel& model, const SeparationPlanes& separation);

/// The weights of a point that belongs to a bone: those above 0, the own bone first; their sum is 1.
/// \param point  in the bind pose, relative to the model's origin
std::vector<BoneWeight> bone_weights(const WeightWalks& walks, BoneIndex bone, const Vec3& point);

}  // namespace skeletex
