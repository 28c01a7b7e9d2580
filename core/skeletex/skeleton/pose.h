// SPDX-License-Identifier: MIT
#pragma once
#include <Eigen/Geometry>
#include <cstdint>
#include <string>
#include <vector>

#include "skeletex/skeleton/skeleton.h"

namespace skeletex {

/// A pose of one skeleton (paper 3.4): turned bones or moved nodes, and a roll per bone. Empty vectors mean "as bound".
struct Pose {
  /// Per bone, about its node nearer to the root, in the bind pose's world axes; applied down the hierarchy, so a bone
  /// carries everything below it along. Trees only.
  std::vector<Eigen::Quaterniond> rotations;
  /// Per node, its new position (world units). Not together with rotations.
  std::vector<Vec3> nodes;
  /// Per bone, radians about its posed direction from head to tail: turns s, moves no node and no other bone.
  std::vector<double> rolls;
  /// Of the whole skeleton, world units. Not together with nodes.
  Vec3 translation = Vec3::Zero();
};

/// Poses over time.
struct PoseFrame {
  double time = 0;
  Pose pose;
  std::string name{};  ///< for tables and messages; may be empty
};
struct PoseAnimation {
  std::vector<PoseFrame> frames;  ///< by growing time, at least one
};
/// The pose at a time. Rotations are interpolated by slerp, the shorter way, bone by bone; nodes and rolls linearly.
/// Times outside the animation give its first or last frame. Where only one of two neighbouring frames gives a value,
/// the other counts as the bind pose.
/// \throw InputError when one of the two frames turns bones and the other one moves
/// nodes
Pose pose_at(const Skeleton& bind, const PoseAnimation& animation, double time);

/// The root of each component's hierarchy: the node that the most bones point away from, and the first of several such.
/// In a hierarchy all bones point away from it. One node per component, in the order of the nodes.
std::vector<int> root_nodes(const Skeleton& skeleton);

/// Per bone whether it is in a cycle: without it, its ends would still hang together. Such bones cannot be turned.
std::vector<bool> bones_in_cycles(const Skeleton& skeleton);

/// The bind skeleton in a pose: node positions, and every bone's s.
///
/// Rotations carry s along, and the bones of a cycle as one. When nodes move, each bone needs a rotation that takes it
/// to its new direction:
///   - In a tree one rotation is fitted to the directions of all bones (Kabsch); a bone's weight is a tenth of that of
///     the bone before it, seen from the tree's centre, the node with the shortest ways to all others. From the centre
///     on, every bone then takes the smallest rotation relative to the bone before.
///   - In a graph with cycles there is no bone before. Every bone takes the smallest rotation relative to one fit of
///     the whole component, and then a roll about itself; the rolls spread the remaining twist evenly over all joints.
/// Either way, a rigid motion of all nodes is that motion of all bases, and neither names nor order nor direction of
/// the bones matter.
/// \throw InputError when sizes do not match, a bone of a cycle is to be turned, or a bone has no length; it names the
///        bone
Skeleton apply_pose(const Skeleton& bind, const Pose& pose);

/// A random pose: every bone that is neither at a root nor in a cycle turns about an axis that is uniform on the
/// sphere, by an angle that is uniform in [0, largest]. The same seed gives the same pose on every machine.
/// \param largest  radians
/// \throw InputError when all bones are in cycles
Pose make_random_pose(const Skeleton& skeleton, double largest, std::uint64_t seed);

}  // namespace skeletex
