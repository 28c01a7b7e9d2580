// SPDX-License-Identifier: MIT
// Parts of import_rig.
#pragma once
#include <string>
#include <vector>

#include "skeletex/io/gltf/gltf_surface.h"
#include "skeletex/rig/joint_skeleton.h"
#include "skeletex/skeleton/pose.h"

namespace skeletex {

struct RigAnimation {
  PoseAnimation animation;  ///< without frames when no joint moves
  std::vector<std::string> notes;
};
/// The poses of an animation, at its own times. They turn bones and move the whole skeleton where that says everything,
/// to a thousandth of the diagonal; else they place nodes and roll bones, 30 times per second.
RigAnimation read_rig_animation(const GltfScene& scene, const GltfSurface& surface, const JointSkeleton& joints,
                                const GltfAnimation& animation);

}  // namespace skeletex
