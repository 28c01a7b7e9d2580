// SPDX-License-Identifier: MIT
#include "skeletex/rig/import_rig.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "skeletex/convert/layers/surface_points.h"
#include "skeletex/rig/joint_skeleton.h"
#include "skeletex/rig/rig_animation.h"

namespace skeletex {
namespace {

/// The weights of joints as weights of bones. A joint with several bones shares its weight among them by how near they
/// are: in its own poses they move alike.
std::vector<std::vector<BoneWeight>> weights_of_bones(const GltfSurface& surface, const JointSkeleton& joints) {
  std::vector<std::vector<BoneWeight>> result(surface.weights.size());
  for (std::size_t v = 0; v < result.size(); ++v) {
    std::map<int, double> by_bone;
    for (const JointWeight& weight : surface.weights[v]) {
      const std::vector<int>& bones = joints.bones_of_joint[weight.node];
      std::vector<double> shares;
      double sum = 0;
      for (const int bone : bones) {
        const double distance =
            distance_to_bone(surface.mesh.positions[v], end_position(joints.skeleton, bone, BoneEnd::kHead),
                             end_position(joints.skeleton, bone, BoneEnd::kTail));
        shares.push_back(1 / std::max(std::pow(distance, 4), 1e-60));
        sum += shares.back();
      }
      for (std::size_t i = 0; i < bones.size(); ++i) by_bone[bones[i]] += weight.weight * shares[i] / sum;
    }
    for (const auto& [bone, weight] : by_bone) result[v].push_back({bone, weight});
  }
  return result;
}

}  // namespace

ImportedRig import_rig(const GltfScene& scene, const GltfSurface& surface,
                       const std::function<Skeleton(const Skeleton&)>& repair) {
  ImportedRig rig;
  rig.notes = scene.notes;
  rig.notes.insert(rig.notes.end(), surface.notes.begin(), surface.notes.end());
  rig.joints_in_file = static_cast<int>(std::count(surface.is_joint.begin(), surface.is_joint.end(), true));
  if (rig.joints_in_file == 0) return rig;
  JointSkeleton joints = make_joint_skeleton(scene, surface);
  rig.notes.insert(rig.notes.end(), joints.notes.begin(), joints.notes.end());
  if (joints.skeleton.bones.empty()) return rig;
  if (repair) joints = with_skeleton(joints, repair(joints.skeleton));
  rig.weights = weights_of_bones(surface, joints);
  std::set<std::string> taken;
  for (const GltfAnimation& animation : scene.animations) {
    RigAnimation read = read_rig_animation(scene, surface, joints, animation);
    rig.notes.insert(rig.notes.end(), read.notes.begin(), read.notes.end());
    if (read.animation.frames.empty()) continue;
    const std::string wanted = animation.name.empty() ? "animation" : animation.name;
    std::string name = wanted;
    for (int i = 2; !taken.insert(name).second; ++i) name = fmt::format("{}_{}", wanted, i);
    rig.animations.push_back({name, std::move(read.animation)});
  }
  rig.skeleton = std::move(joints.skeleton);
  return rig;
}

std::vector<std::vector<float>> weight_planes(ClContext& context, const PreparedModel& model, const TriangleMesh& mesh,
                                              const TriangleTree& tree,
                                              std::span<const std::vector<BoneWeight>> weights) {
  const std::vector<SurfacePoint> points = surface_points(context, model, mesh, tree);
  std::vector<std::vector<float>> planes(model.model.skeleton.bones.size(), std::vector<float>(points.size(), 0.f));
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (points[i].triangle < 0) continue;
    const Triangle& triangle = mesh.triangles[points[i].triangle];
    for (int k = 0; k < 3; ++k)
      for (const auto& [bone, weight] : weights[triangle[k]])
        planes[bone][i] += points[i].weights[k] * static_cast<float>(weight);
  }
  return planes;
}

}  // namespace skeletex
