// SPDX-License-Identifier: MIT
#pragma once
#include <array>
#include <vector>

#include "skeletex/model/mesh_attributes.h"
#include "skeletex/reconstruct/prepared_model.h"

namespace skeletex {

/// Pixels around each patch of a picture.
inline constexpr int kGutter = 4;

/// Where the patches of a model lie in a picture, a pixel per texel, with a border of kGutter pixels around each.
struct PictureLayout {
  int width = 0, height = 0;
  int repeated = 0;  ///< columns that each patch has more than it has texels: its first ones again
  std::vector<std::array<int, 2>> places;  ///< per patch: pixel of row 0, column 0, from the left and from the top
};

/// Patches side by side, the tallest first.
/// \param texels  the model whose texels are the pixels
/// \param model   the model, of the size of the mesh that reads the picture
/// \throw InputError when the picture would be too large
PictureLayout lay_out_picture(const SkeletexModel& texels, const PreparedModel& model);

/// Where the corners of a mesh read such a picture.
/// \param mesh  of the model, in its bind pose
CornerValues<Eigen::Vector2f> picture_coordinates(const PictureLayout& layout, const SkeletexModel& texels,
                                                  const PreparedModel& model, const TriangleMesh& mesh);

}  // namespace skeletex
