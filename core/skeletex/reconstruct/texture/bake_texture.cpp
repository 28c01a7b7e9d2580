// SPDX-License-Identifier: MIT
#include "skeletex/reconstruct/texture/bake_texture.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>

#include "skeletex/io/image_file.h"
#include "skeletex/io/mesh_file.h"
#include "skeletex/model/error.h"
#include "skeletex/reconstruct/layers/layer_values.h"
#include "skeletex/reconstruct/texture/corner_coordinates.h"

namespace skeletex {
namespace {

constexpr int kGutter = 4;  // pixels around each patch

/// Where each patch begins in the picture, without its border.
struct Shelves {
  int width = 0, height = 0;
  std::vector<std::array<int, 2>> places;
};
/// Patches side by side, the tallest first.
/// \param repeated  columns that each has more than it has texels: its first ones again
Shelves place_patches(const std::vector<Patch>& patches, int repeated) {
  std::vector<int> order(patches.size());
  std::iota(order.begin(), order.end(), 0);
  std::sort(order.begin(), order.end(), [&](int a, int b) {
    const int first = patches[a].rectangle.height, second = patches[b].rectangle.height;
    return first != second ? first > second : a < b;
  });
  const auto outer_width = [&](const Patch& patch) { return patch.rectangle.width + repeated + 2 * kGutter; };
  double area = 0;
  Shelves shelves;
  for (const Patch& patch : patches) {
    area += static_cast<double>(outer_width(patch)) * (patch.rectangle.height + 2 * kGutter);
    shelves.width = std::max(shelves.width, outer_width(patch));
  }
  shelves.width = std::max(shelves.width, static_cast<int>(std::ceil(std::sqrt(1.1 * area))));
  shelves.places.resize(patches.size());
  int x = 0, y = 0, shelf = 0;
  for (const int i : order) {
    if (x + outer_width(patches[i]) > shelves.width) x = 0, y += shelf, shelf = 0;
    shelves.places[i] = {x + kGutter, y + kGutter};
    x += outer_width(patches[i]);
    shelf = std::max(shelf, patches[i].rectangle.height + 2 * kGutter);
  }
  shelves.height = y + shelf;
  return shelves;
}

void paint_patch(const SkeletexModel& model, const Layer& layer, int bone, const std::array<int, 2>& place,
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
  // Triangles that cross column 0 go on past the last one, by up to two columns of the mesh.
  int repeated = 1;
  for (std::size_t i = 0; i < model.patches.size(); ++i)
    repeated = std::max(repeated, 2 * model.patches[i].rectangle.width / prepared.model.patches[i].rectangle.width);
  const Shelves shelves = place_patches(model.patches, repeated);
  if (shelves.width > kMaxImageSize || shelves.height > kMaxImageSize)
    throw InputError(fmt::format("the picture would have {} x {} pixels, more than {}; reconstruct at a smaller size",
                                 shelves.width, shelves.height, kMaxImageSize));
  BakedTexture baked;
  baked.image = {shelves.width, shelves.height,
                 std::vector<std::uint8_t>(std::size_t{4} * static_cast<std::size_t>(shelves.width) *
                                           static_cast<std::size_t>(shelves.height))};
  for (int bone = 0; bone < static_cast<int>(model.patches.size()); ++bone)
    paint_patch(model, *layer, bone, shelves.places[bone], repeated, baked.image);

  const std::vector<int> bones = triangle_bones(prepared.lattice, mesh.triangles);
  const std::vector<std::array<double, 2>> corners = corner_coordinates(prepared, mesh);
  std::map<std::array<float, 2>, int> numbers;  // of coordinates
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    const Rectangle& r = model.patches[bones[t]].rectangle;
    const auto& [x, y] = shelves.places[bones[t]];
    // v runs on past 1 where the triangle crosses column 0, and begins at or above 0.
    const double turns = std::floor(std::min({corners[3 * t][1], corners[3 * t + 1][1], corners[3 * t + 2][1]}));
    Triangle triangle{};
    for (int k = 0; k < 3; ++k) {
      const auto& [u, v] = corners[3 * t + static_cast<std::size_t>(k)];
      const Eigen::Vector2f place(static_cast<float>((x + (v - turns) * r.width + 0.5) / shelves.width),
                                  static_cast<float>(1 - (y + u * (r.height - 1) + 0.5) / shelves.height));
      const auto [found, is_new] = numbers.try_emplace({place.x(), place.y()}, static_cast<int>(numbers.size()));
      if (is_new) baked.coordinates.values.push_back(place);
      triangle[k] = found->second;
    }
    baked.coordinates.corners.push_back(triangle);
  }
  return baked;
}

}  // namespace skeletex
