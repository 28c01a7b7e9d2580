// SPDX-License-Identifier: MIT
#pragma once
#include <array>
#include <string>
#include <vector>

#include "skeletex/model/texture.h"

namespace skeletex {

/// Some bones of a model that hang together, cut out: bone i is bones[i]. One more bone, the last, starts where they
/// leave the rest of the body and points to it. Seams are kept where all bones of a node are in the part.
struct Part {
  std::vector<int> bones;
  BoneEnd near = BoneEnd::kHead;  ///< of bones[0]
  std::array<Vec3, 2> rest{Vec3::Zero(),
                           Vec3::Zero()};  ///< unit directions to the bones nearby, and to the centre of all others
  SkeletexModel model;                     ///< skeleton, patches, ends, arcs, corners; no texels
};
/// Name of the bone that stands for the rest of the body: no file's bone has it.
extern const char* const kRestOfBody;

bool is_free_end(const SkeletexModel& model, int bone, BoneEnd end);

/// The end that the rest of the body lies at: the one that is not free, else the one nearer to a root.
BoneEnd near_end(const SkeletexModel& model, int bone);
/// The bone and all those behind its far end.
/// \throw InputError when it is part of a cycle
std::vector<int> limb_of(const SkeletexModel& model, int bone);
Part cut_out(const SkeletexModel& whole, std::vector<int> bones);

}  // namespace skeletex
