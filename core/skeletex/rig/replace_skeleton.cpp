// SPDX-License-Identifier: MIT
#include <algorithm>
#include <cmath>
#include <set>

#include "skeletex/rig/joint_skeleton.h"

namespace skeletex {
namespace {

Vec3 middle_of(const Skeleton& skeleton, std::size_t bone) {
  return 0.5 *
         (skeleton.nodes[skeleton.bones[bone].head].position + skeleton.nodes[skeleton.bones[bone].tail].position);
}

int nearest_bone(const Skeleton& skeleton, const Vec3& point) {
  int best = 0;
  double least = INFINITY;
  for (BoneIndex bone = 0; bone < static_cast<int>(skeleton.bones.size()); ++bone) {
    const double distance = distance_to_bone(point, end_position(skeleton, bone, BoneEnd::kHead),
                                             end_position(skeleton, bone, BoneEnd::kTail));
    if (distance < least) least = distance, best = bone;
  }
  return best;
}

/// \return the number of what has that name; -1: nothing has
template <class T>
int named(const std::vector<T>& list, const std::string& name) {
  const auto found = std::find_if(list.begin(), list.end(), [&](const T& item) { return item.name == name; });
  return found == list.end() ? -1 : static_cast<int>(found - list.begin());
}

}  // namespace

JointSkeleton with_skeleton(const JointSkeleton& joints, const Skeleton& skeleton) {
  const Skeleton& before = joints.skeleton;
  JointSkeleton result{skeleton, {}, {}, std::vector<std::vector<int>>(joints.bones_of_joint.size()), joints.notes};
  std::vector<std::vector<int>> became(before.bones.size());  // per bone before, the bones that stand for it
  for (std::size_t bone = 0; bone < skeleton.bones.size(); ++bone) {
    int from = named(before.bones, skeleton.bones[bone].name);
    if (from < 0) from = nearest_bone(before, middle_of(skeleton, bone));
    result.bone_joint.push_back(joints.bone_joint[from]);
    became[from].push_back(static_cast<int>(bone));
  }
  for (std::size_t bone = 0; bone < became.size(); ++bone)
    if (became[bone].empty()) became[bone].push_back(nearest_bone(skeleton, middle_of(before, bone)));
  for (std::size_t joint = 0; joint < joints.bones_of_joint.size(); ++joint) {
    std::set<int> bones;
    for (const BoneIndex bone : joints.bones_of_joint[joint]) bones.insert(became[bone].begin(), became[bone].end());
    result.bones_of_joint[joint].assign(bones.begin(), bones.end());
  }
  for (std::size_t node = 0; node < skeleton.nodes.size(); ++node) {
    const int from = named(before.nodes, skeleton.nodes[node].name);
    int joint = from >= 0 ? joints.node_joint[from] : -1;
    for (std::size_t bone = 0; bone < skeleton.bones.size() && joint < 0; ++bone)
      if (skeleton.bones[bone].tail == static_cast<int>(node) || skeleton.bones[bone].head == static_cast<int>(node))
        joint = result.bone_joint[bone];
    result.node_joint.push_back(std::max(joint, 0));
  }
  return result;
}

}  // namespace skeletex
