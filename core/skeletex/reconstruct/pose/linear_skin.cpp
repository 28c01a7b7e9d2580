// SPDX-License-Identifier: MIT
#include "skeletex/reconstruct/pose/linear_skin.h"

#include <algorithm>

#include "skeletex/geometry/parallel.h"

namespace skeletex {
namespace {

/// Puts a bone in its place among the four strongest.
void insert(int bone, float weight, std::array<int, 4>& bones, std::array<float, 4>& weights) {
  for (int i = 0; i < 4; ++i)
    if (weight > weights[i]) {
      std::swap(bone, bones[i]);
      std::swap(weight, weights[i]);
    }
}

/// Scales weights to a sum of 1, which the first one meets to rounding.
void normalise(std::array<float, 4>& weights) {
  double sum = 0;
  for (const float weight : weights) sum += weight;
  for (float& weight : weights) weight = static_cast<float>(weight / sum);
  weights[0] = static_cast<float>(1 - (static_cast<double>(weights[1]) + weights[2] + weights[3]));
}

}  // namespace

VertexInfluences strongest_influences(const Skin& skin) {
  const std::size_t count = skin.inner_count + skin.shared_weights.size();
  VertexInfluences result{std::vector<std::array<int, 4>>(count), std::vector<std::array<float, 4>>(count)};
  for (const SkinBlock& block : skin.blocks)
    for (int k = 0; k < block.bone_count; ++k)
      for (int i = 0; i < block.vertex_count; ++i)
        insert(skin.block_bones[block.first_bone + k], skin.weights[block.first_weight + k * SKIN_BLOCK + i],
               result.bones[block.first_vertex + i], result.weights[block.first_vertex + i]);
  for (std::size_t i = 0; i < skin.shared_weights.size(); ++i)
    for (const auto& [bone, weight] : skin.shared_weights[i])
      insert(bone, static_cast<float>(weight), result.bones[skin.inner_count + i],
             result.weights[skin.inner_count + i]);
  for (std::array<float, 4>& weights : result.weights) normalise(weights);
  return result;
}

std::vector<Vec3> skin_linearly(std::span<const Vec3> positions, const VertexInfluences& influences,
                                std::span<const BoneMotion> motions) {
  std::vector<Eigen::Matrix3d> matrices;
  for (const BoneMotion& motion : motions)
    matrices.push_back(motion.rotation.toRotationMatrix() + motion.stretch * motion.bind_axis.transpose());
  std::vector<Vec3> moved(positions.size());
  for_each_index(positions.size(), 1 << 12, [&](std::size_t v) {
    Vec3 sum = Vec3::Zero();
    for (int i = 0; i < 4; ++i) {
      const float weight = influences.weights[v][i];
      if (weight == 0) continue;
      const BoneIndex bone = influences.bones[v][i];
      const BoneMotion& motion = motions[bone];
      sum += weight * (matrices[bone] * (positions[v] - motion.bind_head) + motion.rotation * motion.bind_head +
                       motion.translation);
    }
    moved[v] = sum;
  });
  return moved;
}

}  // namespace skeletex
