// SPDX-License-Identifier: MIT
#pragma once
#include "skeletex/model/mesh_attributes.h"
#include "skeletex/reconstruct/prepared_model.h"

namespace skeletex {

/// A picture of a layer of colours, and where the corners of a mesh read it.
struct BakedTexture {
  ColourImage image;
  CornerValues<Eigen::Vector2f> coordinates;
};
/// A pixel per texel, patch by patch, with a border of pixels around each that repeats what lies across: so neither
/// filters nor the first mip levels see seams.
/// \param colours  the model, of any size: the picture's
/// \param model    the model, of the size of the mesh
/// \param mesh     in its bind pose
/// \throw InputError when the model has no colours, or the picture would be too large
BakedTexture bake_texture(const SkeletexModel& colours, const PreparedModel& model, const TriangleMesh& mesh);

}  // namespace skeletex
