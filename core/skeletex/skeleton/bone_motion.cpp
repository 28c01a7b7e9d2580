// SPDX-License-Identifier: MIT
#include "skeletex/skeleton/bone_motion.h"

#include <algorithm>

namespace skeletex {
namespace {

Eigen::Matrix3d matrix_of(const BoneBasis& basis) {
  Eigen::Matrix3d matrix;
  matrix << basis.s, basis.b, basis.o;
  return matrix;
}

/// Gives every quaternion the sign that is nearer to the one of the bone before it, breadth first.
void align_signs(const Skeleton& skeleton, std::vector<BoneMotion>& motions) {
  const auto at = bones_at_nodes(skeleton);
  std::vector<bool> is_done(motions.size(), false);
  for (int start = 0; start < static_cast<int>(motions.size()); ++start) {
    if (is_done[start]) continue;
    std::vector<int> queue{start};
    is_done[start] = true;
    for (std::size_t i = 0; i < queue.size(); ++i) {
      const Bone& bone = skeleton.bones[queue[i]];
      for (const NodeIndex node : {bone.head, bone.tail})
        for (const BoneAtNode& next : at[node]) {
          if (is_done[next.bone]) continue;
          is_done[next.bone] = true;
          Eigen::Quaterniond& rotation = motions[next.bone].rotation;
          if (rotation.dot(motions[queue[i]].rotation) < 0) rotation.coeffs() = -rotation.coeffs();
          queue.push_back(next.bone);
        }
    }
  }
}

}  // namespace

std::vector<BoneMotion> bone_motions(const Skeleton& bind, const Skeleton& posed) {
  const std::vector<BoneBasis> before = bone_bases(bind), after = bone_bases(posed);
  std::vector<BoneMotion> motions(bind.bones.size());
  for (BoneIndex bone = 0; bone < static_cast<int>(motions.size()); ++bone) {
    BoneMotion& motion = motions[bone];
    motion.rotation = Eigen::Quaterniond(matrix_of(after[bone]) * matrix_of(before[bone]).transpose()).normalized();
    motion.bind_head = end_position(bind, bone, BoneEnd::kHead);
    motion.translation = end_position(posed, bone, BoneEnd::kHead) - motion.rotation * motion.bind_head;
    const double length = bone_length(bind, bone);
    motion.bind_axis = before[bone].o / length;
    const double growth = bone_length(posed, bone) - length;
    // Rotations keep lengths up to rounding; only a pose that moves nodes changes them.
    if (std::abs(growth) > 1e-9 * length) motion.stretch = growth * after[bone].o;
  }
  align_signs(bind, motions);
  return motions;
}

Eigen::Vector4d dual_part(const BoneMotion& motion, const Vec3& bind_origin, const Vec3& posed_origin) {
  const Vec3 translation = motion.rotation * bind_origin + motion.translation - posed_origin;
  const Eigen::Quaterniond dual =
      Eigen::Quaterniond(0, translation.x(), translation.y(), translation.z()) * motion.rotation;
  return 0.5 * Eigen::Vector4d(dual.w(), dual.x(), dual.y(), dual.z());
}

Vec3 blend_motions(std::span<const BoneMotion> motions, std::span<const BoneWeight> weights, const Vec3& point) {
  Eigen::Vector4d real = Eigen::Vector4d::Zero(), dual = Eigen::Vector4d::Zero();
  Vec3 stretch = Vec3::Zero();
  double sum = 0;
  for (const auto& [bone, weight] : weights) {
    const BoneMotion& motion = motions[bone];
    real +=
        weight * Eigen::Vector4d(motion.rotation.w(), motion.rotation.x(), motion.rotation.y(), motion.rotation.z());
    dual += weight * dual_part(motion, Vec3::Zero(), Vec3::Zero());
    stretch += weight * std::clamp((point - motion.bind_head).dot(motion.bind_axis), 0.0, 1.0) * motion.stretch;
    sum += weight;
  }
  const double length = real.norm();
  real /= length;
  dual /= length;
  const Vec3 v = real.tail<3>(), d = dual.tail<3>();
  return point + 2 * v.cross(v.cross(point) + real[0] * point) + 2 * (real[0] * d - dual[0] * v + v.cross(d)) +
         stretch / sum;
}

}  // namespace skeletex
