// SPDX-License-Identifier: MIT
#pragma once
#include <Eigen/Geometry>
#include <span>
#include <string>
#include <vector>

#include "skeletex/skeleton/pose.h"

namespace skeletex {

/// A joint of a rig, as other programs pose characters: a frame that its parent carries along.
struct RigJoint {
  std::string name;
  int parent = -1;                                         ///< an earlier joint; -1 at the root
  BoneIndex bone;                                          ///< that it moves; -1: none
  Eigen::Isometry3d bind = Eigen::Isometry3d::Identity();  ///< to the world; y points along the bone
};

/// The joints of a skeleton. Joint 0 is the root and moves no bone. Each bone has a joint at its node nearer to the
/// root; each free end has a joint that moves nothing and shows how long its bone is.
struct Rig {
  std::vector<RigJoint> joints;
  std::vector<int> joint_of_bone;
  bool is_hierarchy = true;  ///< otherwise all joints are children of the root
};

/// \param is_hierarchy  bones carry those behind them along; not of skeletons with cycles, nor for poses that make
///                      bones longer, as their children would be stretched too
Rig make_rig(const Skeleton& bind, bool is_hierarchy);

/// A joint relative to its parent.
struct JointTransform {
  Vec3 translation = Vec3::Zero();
  Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();
  Vec3 scale = Vec3::Ones();
};

/// All joints over time.
struct JointClip {
  std::string name;
  std::vector<double> times;                            ///< seconds, growing, from 0 on
  std::vector<std::vector<JointTransform>> transforms;  ///< per time, per joint
};

/// The joints in the bind pose.
std::vector<JointTransform> bind_transforms(const Rig& rig);

/// A rig and the clips of some animations. Between the frames of an animation there are as many more as it takes for no
/// bone to turn by more than 10 degrees, and 30 per second where nodes move or bones roll, as other programs
/// interpolate linearly in between. Clips begin at 0.
struct AnimatedRig {
  Rig rig;
  std::vector<JointClip> clips;
};
struct NamedAnimation {
  std::string name;
  PoseAnimation animation;
};
/// \throw InputError as apply_pose
AnimatedRig animate_rig(const Skeleton& bind, std::span<const NamedAnimation> animations);

}  // namespace skeletex
