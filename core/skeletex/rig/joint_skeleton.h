// SPDX-License-Identifier: MIT
// Parts of import_rig.
#pragma once
#include <string>
#include <vector>

#include "skeletex/io/gltf/gltf_surface.h"
#include "skeletex/skeleton/skeleton.h"

namespace skeletex {

/// A skeleton made of joints, and how the two belong together.
struct JointSkeleton {
  Skeleton skeleton;
  std::vector<int> bone_joint;                   ///< per bone the node of the scene that moves it
  std::vector<int> node_joint;                   ///< per node of the skeleton the node of the scene that carries it
  std::vector<std::vector<int>> bones_of_joint;  ///< per node of the scene: the bones that take its weights
  std::vector<std::string> notes;
};
JointSkeleton make_joint_skeleton(const GltfScene& scene, const GltfSurface& surface);
/// The same joints with another skeleton that was made of theirs: bones of a name that stayed keep their joint; others
/// take that of the bone that was nearest.
JointSkeleton with_skeleton(const JointSkeleton& joints, const Skeleton& skeleton);

}  // namespace skeletex
