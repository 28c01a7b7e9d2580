// SPDX-License-Identifier: MIT
#include "skeletex/reconstruct/texture/bake_texture.h"

#include <algorithm>

#include "skeletex/io/mesh_file.h"
#include "skeletex/model/error.h"
#include "skeletex/reconstruct/layers/layer_values.h"
#include "skeletex/reconstruct/texture/picture_layout.h"

namespace skeletex {
namespace {

void paint_patch(const SkeletexModel& model, const Layer& layer, BoneIndex bone, const std::array<int, 2>& place,
                 int repeated, ColourImage& image) {
  const Rectangle& r = model.patches[bone].rectangle;
  for (int row = -kGutter; row < r.height + kGutter; ++row)
    for (int column = -kGutter; column < r.width + repeated + kGutter; ++column) {
      const std::size_t texel = static_cast<std::size_t>(r.y + std::clamp(row, 0, r.height - 1)) *
                                    static_cast<std::size_t>(model.texture.width) +
                                static_cast<std::size_t>(r.x + ((column % r.width) + r.width) % r.width);
      Colour colour = Colour::Ones();
      for (std::size_t k = 0; k < layer.planes.size(); ++k) colour[static_cast<int>(k)] = layer.planes[k][texel];
      const VertexColour bytes = bytes_of(colour);
      std::uint8_t* const pixel =
          image.rgba.data() + 4 * (static_cast<std::size_t>(place[1] + row) * static_cast<std::size_t>(image.width) +
                                   static_cast<std::size_t>(place[0] + column));
      pixel[0] = bytes.r, pixel[1] = bytes.g, pixel[2] = bytes.b, pixel[3] = bytes.a;
    }
}

}  // namespace

BakedTexture bake_texture(const SkeletexModel& model, const PreparedModel& prepared, const TriangleMesh& mesh) {
  const auto layer = std::find_if(model.layers.begin(), model.layers.end(),
                                  [](const Layer& l) { return l.kind == LayerKind::kColour; });
  if (layer == model.layers.end())
    throw InputError("the model has no colours to make a picture of; encode a mesh with colours");
  const PictureLayout layout = lay_out_picture(model, prepared);
  BakedTexture baked;
  baked.image = {layout.width, layout.height,
                 std::vector<std::uint8_t>(std::size_t{4} * static_cast<std::size_t>(layout.width) *
                                           static_cast<std::size_t>(layout.height))};
  for (BoneIndex bone = 0; bone < static_cast<int>(model.patches.size()); ++bone)
    paint_patch(model, *layer, bone, layout.places[bone], layout.repeated, baked.image);
  baked.coordinates = picture_coordinates(layout, model, prepared, mesh);
  return baked;
}

}  // namespace skeletex
