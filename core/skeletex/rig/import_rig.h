// SPDX-License-Identifier: MIT
#pragma once
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "skeletex/device/context.h"
#include "skeletex/geometry/triangle_tree.h"
#include "skeletex/io/gltf/gltf_surface.h"
#include "skeletex/reconstruct/prepared_model.h"
#include "skeletex/rig/joints.h"
#include "skeletex/skeleton/bone_motion.h"

namespace skeletex {

/// What a character of another program has beside its surface.
struct ImportedRig {
  Skeleton skeleton;  ///< without bones where the file has no skin
  /// Per vertex of the surface, or of its weighted_original; empty where the file has no skin.
  VertexBoneWeights weights;
  std::vector<NamedAnimation> animations;
  int joints_in_file = 0;
  std::vector<std::string> notes;  ///< what was merged, left out or only approximated
};

/// Skeleton, weights and animations of a glTF scene. A bone leads from a joint to each joint below it, and moves with
/// the upper one; joints without one below get a bone that ends where the surface that they move ends. Left out are
/// joints that move nothing, as far as nothing below them does, and a root of that kind; joints in one place are one
/// node; twist joints are merged into the bone along which they lie.
/// \param surface  of the scene
/// \param repair  when given, changes the skeleton before weights and poses are read for it
ImportedRig import_rig(const GltfScene& scene, const GltfSurface& surface,
                       const std::function<Skeleton(const Skeleton&)>& repair = {});

/// Per bone a plane of texels as SkeletexModel::bone_weights has them: the weights of a mesh's vertices where the
/// texels lie on it.
/// \param tree  of the mesh
/// \param original  weighted_original of the mesh; null: none
/// \param weights  per vertex of the original, else of the mesh
/// \throw DeviceError
std::vector<std::vector<float>> weight_planes(ClContext& context, const PreparedModel& model, const TriangleMesh& mesh,
                                              const TriangleTree& tree, const AttributedMesh* original,
                                              const VertexBoneWeights& weights);

}  // namespace skeletex
