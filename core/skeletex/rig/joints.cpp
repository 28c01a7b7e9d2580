// SPDX-License-Identifier: MIT
#include "skeletex/rig/joints.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <set>

#include "skeletex/skeleton/bone_motion.h"
#include "skeletex/skeleton/free_name.h"

namespace skeletex {
namespace {

constexpr double kFramesPerSecond = 30;
/// Programs that interpolate quaternions linearly are then within 1e-5 radians of those that do it by slerp.
constexpr double kLargestTurn = 10 * std::numbers::pi / 180;

/// \param end  of the bone, where the joint lies
Eigen::Isometry3d bone_frame(const Skeleton& skeleton, const BoneBasis& basis, BoneIndex bone, BoneEnd end) {
  const Vec3 y = end == BoneEnd::kHead ? basis.o : Vec3(-basis.o);
  Eigen::Isometry3d frame = Eigen::Isometry3d::Identity();
  frame.linear() << basis.s, y, basis.s.cross(y);
  frame.translation() = end_position(skeleton, bone, end);
  return frame;
}

/// Bones from the root on, each with its end nearer to the root and the bone that leads there.
struct Step {
  BoneAtNode bone;
  int before;
};
std::vector<Step> steps_from(const Skeleton& skeleton, int root) {
  const auto at = bones_at_nodes(skeleton);
  std::vector<Step> steps;
  std::vector<bool> is_done(skeleton.bones.size(), false), is_reached(skeleton.nodes.size(), false);
  std::vector<std::pair<int, int>> queue{{root, -1}};  // node, the bone that leads to it
  is_reached[root] = true;
  for (std::size_t i = 0; i < queue.size(); ++i) {
    const auto [node, before] = queue[i];
    for (const BoneAtNode& bone : at[node]) {
      if (is_done[bone.bone]) continue;
      is_done[bone.bone] = true;
      steps.push_back({bone, before});
      const int next = end_node(skeleton, bone.bone, opposite(bone.end));
      if (is_reached[next]) continue;
      is_reached[next] = true;
      queue.emplace_back(next, bone.bone);
    }
  }
  return steps;
}

/// The world transforms of all joints in a pose, without the stretch of bones.
std::vector<Eigen::Isometry3d> posed_frames(const Rig& rig, const Skeleton& bind, const Skeleton& posed,
                                            std::span<const BoneMotion> motions) {
  std::vector<Eigen::Isometry3d> frames(rig.joints.size());
  const int root = root_nodes(bind).front();
  for (std::size_t j = 0; j < frames.size(); ++j) {
    const RigJoint& joint = rig.joints[j];
    frames[j] = joint.bind;
    if (joint.bone >= 0) {
      const BoneMotion& motion = motions[joint.bone];
      // The stretch moves the pivot along where that is the tail.
      const Vec3 pivot = joint.bind.translation();
      frames[j].linear() = motion.rotation.toRotationMatrix() * joint.bind.linear();
      frames[j].translation() = motion.rotation * pivot + motion.translation +
                                (pivot - motion.bind_head).dot(motion.bind_axis) * motion.stretch;
    } else if (joint.parent < 0) {
      frames[j].translation() = posed.nodes[root].position;
    } else {
      frames[j] = frames[joint.parent] * rig.joints[joint.parent].bind.inverse() * joint.bind;
    }
  }
  return frames;
}

std::vector<JointTransform> local_transforms(const Rig& rig, std::span<const Eigen::Isometry3d> frames) {
  std::vector<JointTransform> locals(frames.size());
  for (std::size_t j = 0; j < frames.size(); ++j) {
    const int parent = rig.joints[j].parent;
    const Eigen::Isometry3d local = parent < 0 ? frames[j] : frames[parent].inverse() * frames[j];
    locals[j].translation = local.translation();
    locals[j].rotation = Eigen::Quaterniond(local.linear()).normalized();
  }
  return locals;
}

/// Skeletons of an animation, sampled so that joints may be interpolated linearly between them.
struct PosedSkeletons {
  std::vector<double> times;
  std::vector<Skeleton> skeletons;
};

/// The largest angle by which a bone turns from one pose to another.
double largest_turn(const Pose& from, const Pose& to) {
  double largest = 0;
  for (std::size_t i = 0; i < std::max(from.rotations.size(), to.rotations.size()); ++i) {
    const auto at = [i](const Pose& pose) {
      return pose.rotations.empty() ? Eigen::Quaterniond::Identity() : pose.rotations[i];
    };
    largest = std::max(largest, at(from).angularDistance(at(to)));
  }
  return largest;
}

/// Whether bones turn about the nodes that carry them and nothing else happens.
bool has_rotations_only(const Pose& pose) { return pose.nodes.empty() && pose.rolls.empty(); }

PosedSkeletons sample(const Skeleton& bind, const PoseAnimation& animation) {
  PosedSkeletons result;
  for (std::size_t i = 0; i < animation.frames.size(); ++i) {
    const PoseFrame& frame = animation.frames[i];
    result.times.push_back(frame.time);
    if (i + 1 == animation.frames.size()) break;
    const PoseFrame& next = animation.frames[i + 1];
    const double gap = next.time - frame.time;
    double steps = largest_turn(frame.pose, next.pose) / kLargestTurn;
    if (!has_rotations_only(frame.pose) || !has_rotations_only(next.pose))
      steps = std::max(steps, gap * kFramesPerSecond);
    const int between = static_cast<int>(std::min(std::ceil(steps - 1e-6), 1e5));
    for (int k = 1; k < between; ++k) result.times.push_back(frame.time + gap * k / between);
  }
  for (const double time : result.times) result.skeletons.push_back(apply_pose(bind, pose_at(bind, animation, time)));
  const double first = result.times.front();
  for (double& time : result.times) time -= first;
  return result;
}

bool is_stretched(const Skeleton& bind, const PosedSkeletons& posed) {
  for (const Skeleton& skeleton : posed.skeletons)
    for (BoneIndex bone = 0; bone < static_cast<int>(bind.bones.size()); ++bone) {
      const double length = bone_length(bind, bone);
      if (std::abs(bone_length(skeleton, bone) - length) > 1e-9 * length) return true;
    }
  return false;
}

/// Quaternions q and -q are one rotation; neighbours take the shorter way.
void align_signs(std::vector<std::vector<JointTransform>>& transforms) {
  for (std::size_t i = 1; i < transforms.size(); ++i)
    for (std::size_t j = 0; j < transforms[i].size(); ++j)
      if (transforms[i][j].rotation.dot(transforms[i - 1][j].rotation) < 0)
        transforms[i][j].rotation.coeffs() = -transforms[i][j].rotation.coeffs();
}

JointClip make_clip(const std::string& name, const Rig& rig, const Skeleton& bind, const PosedSkeletons& posed) {
  JointClip clip{name, posed.times, {}};
  for (const Skeleton& skeleton : posed.skeletons) {
    const std::vector<BoneMotion> motions = bone_motions(bind, skeleton);
    clip.transforms.push_back(local_transforms(rig, posed_frames(rig, bind, skeleton, motions)));
    for (std::size_t j = 0; j < rig.joints.size(); ++j)
      if (const BoneIndex bone = rig.joints[j].bone; bone >= 0 && !motions[bone].stretch.isZero(0))
        clip.transforms.back()[j].scale.y() = bone_length(skeleton, bone) / bone_length(bind, bone);
  }
  align_signs(clip.transforms);
  return clip;
}

}  // namespace

Rig make_rig(const Skeleton& bind, bool is_hierarchy) {
  Rig rig;
  const int root = root_nodes(bind).front();
  const std::vector<BoneBasis> bases = bone_bases(bind);
  std::set<std::string> taken;
  for (const Bone& bone : bind.bones) taken.insert(bone.name);
  rig.is_hierarchy = is_hierarchy && bind.nodes.size() == bind.bones.size() + 1;
  rig.joint_of_bone.assign(bind.bones.size(), -1);
  RigJoint first{free_name("root", taken)};
  first.bind.translation() = bind.nodes[root].position;
  rig.joints.push_back(first);
  const std::vector<Step> steps = steps_from(bind, root);
  for (const auto& [bone, before] : steps) {
    rig.joint_of_bone[bone.bone] = static_cast<int>(rig.joints.size());
    const int parent = rig.is_hierarchy && before >= 0 ? rig.joint_of_bone[before] : 0;
    rig.joints.push_back(
        {bind.bones[bone.bone].name, parent, bone.bone, bone_frame(bind, bases[bone.bone], bone.bone, bone.end)});
  }
  if (!rig.is_hierarchy) return rig;
  const auto at = bones_at_nodes(bind);
  for (const Step& step : steps) {
    const int far = end_node(bind, step.bone.bone, opposite(step.bone.end)), joint = rig.joint_of_bone[step.bone.bone];
    if (at[far].size() > 1) continue;
    RigJoint end{free_name(rig.joints[joint].name + "_end", taken), joint, -1, rig.joints[joint].bind};
    end.bind.translation() = bind.nodes[far].position;
    rig.joints.push_back(end);
  }
  return rig;
}

std::vector<JointTransform> bind_transforms(const Rig& rig) {
  std::vector<Eigen::Isometry3d> frames;
  for (const RigJoint& joint : rig.joints) frames.push_back(joint.bind);
  return local_transforms(rig, frames);
}

AnimatedRig animate_rig(const Skeleton& bind, std::span<const NamedAnimation> animations) {
  std::vector<PosedSkeletons> posed;
  bool is_hierarchy = true;
  for (const NamedAnimation& named : animations) {
    posed.push_back(sample(bind, named.animation));
    is_hierarchy = is_hierarchy && !is_stretched(bind, posed.back());
  }
  AnimatedRig result{make_rig(bind, is_hierarchy), {}};
  for (std::size_t i = 0; i < posed.size(); ++i)
    result.clips.push_back(make_clip(animations[i].name, result.rig, bind, posed[i]));
  return result;
}

}  // namespace skeletex
