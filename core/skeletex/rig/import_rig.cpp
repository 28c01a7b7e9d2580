// SPDX-License-Identifier: MIT
#include "skeletex/rig/import_rig.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <optional>
#include <set>

#include "skeletex/convert/layers/surface_points.h"
#include "skeletex/geometry/parallel.h"
#include "skeletex/rig/joint_skeleton.h"
#include "skeletex/rig/rig_animation.h"
#include "skeletex/skeleton/free_name.h"

namespace skeletex {
namespace {

/// The weights of joints as weights of bones. A joint with several bones shares its weight among them by how near they
/// are: in its own poses they move alike.
/// \param weights  per vertex: joints with their weights
template <class Weight>
VertexBoneWeights weights_of_bones(const TriangleMesh& mesh, const std::vector<std::vector<Weight>>& weights,
                                   const JointSkeleton& joints) {
  VertexBoneWeights result(weights.size());
  for (std::size_t v = 0; v < result.size(); ++v) {
    std::map<int, double> by_bone;
    for (const auto& [joint, weight] : weights[v]) {
      const std::vector<int>& bones = joints.bones_of_joint[joint];
      std::vector<double> shares;
      double sum = 0;
      for (const BoneIndex bone : bones) {
        const double distance = distance_to_bone(mesh.positions[v], end_position(joints.skeleton, bone, BoneEnd::kHead),
                                                 end_position(joints.skeleton, bone, BoneEnd::kTail));
        shares.push_back(1 / std::max(std::pow(distance, 4), 1e-60));
        sum += shares.back();
      }
      for (std::size_t i = 0; i < bones.size(); ++i) by_bone[bones[i]] += weight * shares[i] / sum;
    }
    for (const auto& [bone, weight] : by_bone) result[v].push_back({bone, weight});
  }
  return result;
}

using Planes = std::vector<std::vector<float>>;

/// Sum over all bones of the differences between a texel's weights and others; 0 to 2 where both add up to 1.
double difference(const Planes& planes, std::size_t texel, const std::vector<double>& weights) {
  double sum = 0;
  for (std::size_t b = 0; b < planes.size(); ++b) sum += std::abs(planes[b][texel] - weights[b]);
  return sum;
}

/// The mean of the four texels around one, so far away; nothing where one of them is outside of the rectangle or they
/// do not agree.
std::optional<std::vector<double>> mean_around(const Planes& planes, const Rectangle& r, int width, int x, int y,
                                               int distance) {
  constexpr double kAgree = 0.5;
  if (x - distance < r.x || x + distance >= r.x + r.width || y - distance < r.y || y + distance >= r.y + r.height)
    return std::nullopt;
  const int texel = y * width + x;
  const std::array<int, 4> around{texel - distance, texel + distance, texel - distance * width,
                                  texel + distance * width};
  std::vector<double> mean(planes.size(), 0);
  for (std::size_t b = 0; b < planes.size(); ++b)
    for (const int other : around) mean[b] += planes[b][other] / 4;
  for (const int other : around)
    if (difference(planes, other, mean) > kAgree) return std::nullopt;
  return mean;
}

/// Where another part of the mesh touches, the point nearest to a texel may be one of that part, as of a hip beside a
/// thumb. A texel whose weights have little in common with those of the texels around it, one to three away, which
/// agree with each other, takes their mean.
void replace_outliers(const SkeletexModel& model, Planes& planes) {
  constexpr int kFarthest = 3;
  constexpr double kDiffers = 1;
  const Planes before = planes;
  const int width = model.texture.width;
  const auto replace = [&](const Rectangle& r, int x, int y) {
    for (int distance = 1; distance <= kFarthest; ++distance) {
      const auto mean = mean_around(before, r, width, x, y, distance);
      if (!mean) continue;
      const int texel = y * width + x;
      if (difference(before, texel, *mean) < kDiffers) return;
      for (std::size_t b = 0; b < planes.size(); ++b) planes[b][texel] = static_cast<float>((*mean)[b]);
      return;
    }
  };
  for_each_index(model.patches.size(), [&](std::size_t p) {
    const Rectangle& r = model.patches[p].rectangle;
    for (int y = r.y; y < r.y + r.height; ++y)
      for (int x = r.x; x < r.x + r.width; ++x) replace(r, x, y);
  });
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
  const AttributedMesh* original = weighted_original(surface.attributes);
  rig.weights = original ? weights_of_bones(original->mesh, original->weights, joints)
                         : weights_of_bones(surface.mesh, surface.weights, joints);
  std::set<std::string> taken;
  for (const GltfAnimation& animation : scene.animations) {
    RigAnimation read = read_rig_animation(scene, surface, joints, animation);
    rig.notes.insert(rig.notes.end(), read.notes.begin(), read.notes.end());
    if (read.animation.frames.empty()) continue;
    const std::string name = free_name(animation.name.empty() ? "animation" : animation.name, taken);
    rig.animations.push_back({name, std::move(read.animation)});
  }
  rig.skeleton = std::move(joints.skeleton);
  return rig;
}

std::vector<std::vector<float>> weight_planes(ClContext& context, const PreparedModel& model, const TriangleMesh& mesh,
                                              const TriangleTree& tree, const AttributedMesh* original,
                                              const VertexBoneWeights& weights) {
  std::vector<SurfacePoint> points = surface_points(context, model, mesh, tree);
  if (original)
    points = points_on_original(context, in_frame(original->mesh, model.model.skeleton.frame), mesh, points);
  const std::vector<Triangle>& triangles = original ? original->mesh.triangles : mesh.triangles;
  Planes planes(model.model.skeleton.bones.size(), std::vector<float>(points.size(), 0.f));
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (points[i].triangle < 0) continue;
    const Triangle& triangle = triangles[points[i].triangle];
    for (int k = 0; k < 3; ++k)
      for (const auto& [bone, weight] : weights[triangle[k]])
        planes[bone][i] += points[i].weights[k] * static_cast<float>(weight);
  }
  replace_outliers(model.model, planes);
  return planes;
}

}  // namespace skeletex
