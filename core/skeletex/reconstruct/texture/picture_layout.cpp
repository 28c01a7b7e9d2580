// SPDX-License-Identifier: MIT
#include "skeletex/reconstruct/texture/picture_layout.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>

#include "skeletex/io/image_file.h"
#include "skeletex/model/error.h"
#include "skeletex/reconstruct/texture/corner_coordinates.h"

namespace skeletex {

PictureLayout lay_out_picture(const SkeletexModel& texels, const PreparedModel& model) {
  const std::vector<Patch>& patches = texels.patches;
  PictureLayout layout;
  // Triangles that cross column 0 go on past the last one, by up to two columns of the mesh.
  layout.repeated = 1;
  for (std::size_t i = 0; i < patches.size(); ++i)
    layout.repeated =
        std::max(layout.repeated, 2 * patches[i].rectangle.width / model.model.patches[i].rectangle.width);
  std::vector<int> order(patches.size());
  std::iota(order.begin(), order.end(), 0);
  std::sort(order.begin(), order.end(), [&](int a, int b) {
    const int first = patches[a].rectangle.height, second = patches[b].rectangle.height;
    return first != second ? first > second : a < b;
  });
  const auto outer_width = [&](const Patch& patch) { return patch.rectangle.width + layout.repeated + 2 * kGutter; };
  double area = 0;
  for (const Patch& patch : patches) {
    area += static_cast<double>(outer_width(patch)) * (patch.rectangle.height + 2 * kGutter);
    layout.width = std::max(layout.width, outer_width(patch));
  }
  layout.width = std::max(layout.width, static_cast<int>(std::ceil(std::sqrt(1.1 * area))));
  layout.places.resize(patches.size());
  int x = 0, y = 0, shelf = 0;
  for (const int i : order) {
    if (x + outer_width(patches[i]) > layout.width) x = 0, y += shelf, shelf = 0;
    layout.places[i] = {x + kGutter, y + kGutter};
    x += outer_width(patches[i]);
    shelf = std::max(shelf, patches[i].rectangle.height + 2 * kGutter);
  }
  layout.height = y + shelf;
  if (layout.width > kMaxImageSize || layout.height > kMaxImageSize)
    throw InputError(fmt::format("the picture would have {} x {} pixels, more than {}; take a smaller size",
                                 layout.width, layout.height, kMaxImageSize));
  return layout;
}

CornerValues<Eigen::Vector2f> picture_coordinates(const PictureLayout& layout, const SkeletexModel& texels,
                                                  const PreparedModel& model, const TriangleMesh& mesh) {
  CornerValues<Eigen::Vector2f> coordinates;
  const std::vector<int> bones = triangle_bones(model.lattice, mesh.triangles);
  const std::vector<std::array<double, 2>> corners = corner_coordinates(model, mesh);
  std::map<std::array<float, 2>, int> numbers;  // of coordinates
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    const Rectangle& r = texels.patches[bones[t]].rectangle;
    const auto& [x, y] = layout.places[bones[t]];
    // v runs on past 1 where the triangle crosses column 0, and begins at or above 0.
    const double turns = std::floor(std::min({corners[3 * t][1], corners[3 * t + 1][1], corners[3 * t + 2][1]}));
    Triangle triangle{};
    for (int k = 0; k < 3; ++k) {
      const auto& [u, v] = corners[3 * t + static_cast<std::size_t>(k)];
      const Eigen::Vector2f place(static_cast<float>((x + (v - turns) * r.width + 0.5) / layout.width),
                                  static_cast<float>(1 - (y + u * (r.height - 1) + 0.5) / layout.height));
      const auto [found, is_new] = numbers.try_emplace({place.x(), place.y()}, static_cast<int>(numbers.size()));
      if (is_new) coordinates.values.push_back(place);
      triangle[k] = found->second;
    }
    coordinates.corners.push_back(triangle);
  }
  return coordinates;
}

}  // namespace skeletex
