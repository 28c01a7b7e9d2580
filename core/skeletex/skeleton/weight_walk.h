// SPDX-License-Identifier: MIT
#pragma once
#include <vector>

#include "skeletex/model/texture.h"
#include "skeletex/skeleton/bone_motion.h"
#include "skeletex_structs.h"

namespace skeletex {

/// The weights of smooth posing in closed form, from the skeleton and the seams alone.
///
/// A point P belongs to one bone. Around a joint N with unit directions d_i away from it along its bones, and with the
/// girth g there (the median distance of the joint's seams to their bones), going from bone i to bone j adds (P -
/// N).(d_i - d_j) / g to a potential, and a square of how far P lies beyond the seams (skin_weight.h); potentials add
/// up from joint to joint. Weights are exp(-potential), cut below 0.002 of the largest, and normalised. Around one
/// joint that is the softmax of (P - N).d_i / g: smooth, and the same from both sides of every separation plane. Where
/// a skeleton has cycles the way with the lowest potential counts.
struct WeightWalks {
  std::vector<WeightStep> steps;  ///< bone by bone, breadth first: up to six joints away, no joint twice
  std::vector<int> first_steps;   ///< per bone the first step of its walk; one more than there are bones
  int longest = 0;                ///< the most steps of one bone
};

/// Distances of corners and seam samples give the girths.
WeightWalks make_weight_walks(const SkeletexModel& model);

/// The weights of a point that belongs to a bone: those above 0, the own bone first; their sum is 1.
/// \param point  in the bind pose, relative to the model's origin
std::vector<BoneWeight> bone_weights(const WeightWalks& walks, int bone, const Vec3& point);

}  // namespace skeletex
