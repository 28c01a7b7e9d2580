// SPDX-License-Identifier: MIT
#pragma once
#include <array>
#include <string>
#include <vector>

#include "skeletex/model/texture.h"

namespace skeletex {

/// Connected bones of a model, extracted: bone i of the part is bones[i] of the model. The part has one bone more, the
/// last: it ends where the part leaves the rest of the body, and comes from there. The part has the seams of the nodes
/// all of whose bones are in it.
struct Part {
  std::vector<BoneIndex> bones;
  BoneEnd near = BoneEnd::kHead;  ///< the end of bones[0] that the rest of the body lies at
  /// Unit directions from there to the bones nearby, and to the centre of all other bones.
  std::array<Vec3, 2> rest{Vec3::Zero(), Vec3::Zero()};
  SkeletexModel model;  ///< skeleton, patches, ends, arcs, corners; no texels
};
/// Name of the bone that stands for the rest of the body: no file's bone has it.
extern const char* const kRestOfBody;

bool is_free_end(const SkeletexModel& model, BoneIndex bone, BoneEnd end);

/// The end that the rest of the body lies at: the one that is not free, else the one nearer to a root.
BoneEnd near_end(const SkeletexModel& model, BoneIndex bone);
/// The bone and all bones behind its far end.
/// \throw InputError when it is part of a cycle
std::vector<BoneIndex> limb_of(const SkeletexModel& model, BoneIndex bone);
Part extract_part(const SkeletexModel& whole, std::vector<BoneIndex> bones);

}  // namespace skeletex
