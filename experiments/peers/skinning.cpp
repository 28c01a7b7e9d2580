// SPDX-License-Identifier: MIT
#include "peers/skinning.h"

#include <Eigen/Geometry>
#include <Eigen/SparseCholesky>
#include <algorithm>
#include <stdexcept>

namespace skeletex {

VertexWeights diffused_weights(const TriangleMesh& bind, std::span<const int> own, int bone_count, double width) {
  const int count = static_cast<int>(bind.positions.size());
  const double time = width * width;
  Eigen::VectorXd mass = Eigen::VectorXd::Zero(count);
  std::vector<Eigen::Triplet<double>> entries;
  for (const Triangle& t : bind.triangles) {
    const double area = std::max(area_vector(bind, t).norm(), 1e-300);
    for (int c = 0; c < 3; ++c) {
      const int k = t[c], i = t[(c + 1) % 3], j = t[(c + 2) % 3];
      const double half_cotangent =
          time * 0.5 * (bind.positions[i] - bind.positions[k]).dot(bind.positions[j] - bind.positions[k]) / (2 * area);
      entries.emplace_back(i, j, -half_cotangent);
      entries.emplace_back(j, i, -half_cotangent);
      entries.emplace_back(i, i, half_cotangent);
      entries.emplace_back(j, j, half_cotangent);
      mass[k] += area / 3;
    }
  }
  for (int i = 0; i < count; ++i) entries.emplace_back(i, i, mass[i]);
  Eigen::SparseMatrix<double> system(count, count);
  system.setFromTriplets(entries.begin(), entries.end());
  const Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> solver(system);
  if (solver.info() != Eigen::Success) throw std::runtime_error("the weights' system of equations has no solution");
  VertexWeights weights(count);
  for (int bone = 0; bone < bone_count; ++bone) {
    Eigen::VectorXd right = Eigen::VectorXd::Zero(count);
    for (int i = 0; i < count; ++i)
      if (own[i] == bone) right[i] = mass[i];
    const Eigen::VectorXd solution = solver.solve(right);
    for (int i = 0; i < count; ++i)
      if (solution[i] > 0) weights[i].push_back({bone, solution[i]});
  }
  for (auto& vertex : weights) {
    double sum = 0;
    for (const BoneWeight& weight : vertex) sum += weight.weight;
    for (BoneWeight& weight : vertex) weight.weight /= sum;
  }
  return weights;
}

std::vector<Vec3> skin_linearly(std::span<const Vec3> bind, const VertexWeights& weights,
                                std::span<const BoneMotion> motions) {
  std::vector<Vec3> positions(bind.size(), Vec3::Zero());
  for (std::size_t i = 0; i < bind.size(); ++i)
    for (const auto& [bone, weight] : weights[i])
      positions[i] += weight * (motions[bone].rotation * bind[i] + motions[bone].translation);
  return positions;
}

std::vector<Vec3> skin_by_dual_quaternions(std::span<const Vec3> bind, const VertexWeights& weights,
                                           std::span<const BoneMotion> motions) {
  std::vector<Vec3> positions;
  positions.reserve(bind.size());
  for (std::size_t i = 0; i < bind.size(); ++i) positions.push_back(blend_motions(motions, weights[i], bind[i]));
  return positions;
}

}  // namespace skeletex
