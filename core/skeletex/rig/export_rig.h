// SPDX-License-Identifier: MIT
#pragma once
#include <span>
#include <string>

#include "skeletex/device/context.h"
#include "skeletex/io/gltf/gltf_scene.h"
#include "skeletex/reconstruct/prepared_model.h"
#include "skeletex/reconstruct/texture/bake_displacement.h"
#include "skeletex/rig/joints.h"

namespace skeletex {

struct RigExportOptions {
  std::string name = "model";                                     ///< of the mesh
  Eigen::Quaterniond placement = Eigen::Quaterniond::Identity();  ///< turns the model to the scene's y up
  std::span<const NamedAnimation> animations = {};
  int texture_size = 0;  ///< texels along the model's longer side for a picture of its colours; 0: they go by vertex
  const SkeletexModel* original = nullptr;  ///< whose colours the picture has; none: the exported model's own
  /// A picture beside the file, whose texture coordinates and tangents the mesh gets. Not together with texture_size.
  const DisplacementPicture* displacement = nullptr;
};

/// A model as other programs animate it: its mesh in the bind pose with its normals and colours, a skin with four
/// weights per vertex (those of smooth poses), a joint per bone, and animations. Posed by linear blend skinning:
/// `Deformation::kLinear`.
/// \throw InputError when a pose does not fit the skeleton, or a picture is asked for and there are no colours;
///        DeviceError
GltfScene export_rig(ClContext& context, const PreparedModel& model, const RigExportOptions& options = {});

}  // namespace skeletex
