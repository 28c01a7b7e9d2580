// SPDX-License-Identifier: MIT
#pragma once
#include <Eigen/Geometry>
#include <span>
#include <vector>

#include "skeletex/skeleton/skeleton.h"

namespace skeletex {

/// How a pose moves a bone: x becomes rotation * x + translation (world units), and a point along the bone follows when
/// the pose makes the bone longer or shorter.
struct BoneMotion {
  Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();
  Vec3 translation = Vec3::Zero();
  Vec3 bind_head = Vec3::Zero();
  Vec3 bind_axis = Vec3::Zero();  ///< unit vector from head to tail in the bind pose, divided by the bone's length
  Vec3 stretch = Vec3::Zero();    ///< what the posed tail has moved away from the rotated bind tail
};

/// The motion of every bone. The signs of the quaternions follow the skeleton from bone to bone, so that a blend of
/// neighbouring bones takes the way that the joint between them has turned.
/// \param bind, posed  the same skeleton in two poses, see apply_pose; bones without an s take that of bone_bases
std::vector<BoneMotion> bone_motions(const Skeleton& bind, const Skeleton& posed);

/// How much each bone moves a point.
struct BoneWeight {
  BoneIndex bone;
  double weight = 0;
};
/// Per vertex of a mesh.
using VertexBoneWeights = std::vector<std::vector<BoneWeight>>;

/// A point moved by blended dual quaternions (Kavan et al., Geometric Skinning with Approximate Dual Quaternion
/// Blending, 2008).
/// \param weights  at least one above 0; their sum does not matter
Vec3 blend_motions(std::span<const BoneMotion> motions, std::span<const BoneWeight> weights, const Vec3& point);

/// The dual part of a motion's dual quaternion, (w, x, y, z), for points that are relative to `bind_origin` before and
/// to `posed_origin` afterwards.
Eigen::Vector4d dual_part(const BoneMotion& motion, const Vec3& bind_origin, const Vec3& posed_origin);

}  // namespace skeletex
