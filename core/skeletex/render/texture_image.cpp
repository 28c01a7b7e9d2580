// SPDX-License-Identifier: MIT
#include "skeletex/render/texture_image.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "skeletex/render/colours.h"

namespace skeletex {
namespace {

/// What 99 of 100 values lie below in size.
float robust_size(std::vector<float> values) {
  for (float& x : values) x = std::abs(x);
  const auto at = values.begin() + static_cast<std::ptrdiff_t>((values.size() - 1) * 99 / 100);
  std::nth_element(values.begin(), at, values.end());
  return std::max(*at, 1e-30f);
}

/// Pixels of the picture in a texture's shape, its longer side about `pixels`.
Image canvas(const DisplacementTexture& texture, int pixels, double& scale) {
  scale = static_cast<double>(pixels) / std::max(texture.width, texture.height);
  Image image = make_image(std::max(1, static_cast<int>(std::lround(texture.width * scale))),
                           std::max(1, static_cast<int>(std::lround(texture.height * scale))));
  return image;
}

void outline(Image& image, const Rectangle& rectangle, double scale, const LinearRgb& colour) {
  const int left = static_cast<int>(rectangle.x * scale), top = static_cast<int>(rectangle.y * scale);
  const int right = std::min(image.width, static_cast<int>((rectangle.x + rectangle.width) * scale)) - 1;
  const int bottom = std::min(image.height, static_cast<int>((rectangle.y + rectangle.height) * scale)) - 1;
  const auto set = [&](int x, int y) { std::copy(colour.begin(), colour.end(), image.at(x, y)); };
  for (int x = left; x <= right; ++x) set(x, top), set(x, bottom);
  for (int y = top; y <= bottom; ++y) set(left, y), set(right, y);
}

}  // namespace

Image map_image(const SkeletexModel& model, int pixels) {
  const DisplacementTexture& texture = model.texture;
  double scale = 1;
  Image image = canvas(texture, pixels, scale);
  const float along = robust_size(texture.along), around = robust_size(texture.around), out = robust_size(texture.out);
  const auto byte = [](float x) { return static_cast<unsigned char>(std::lround(255 * std::clamp(x, 0.0f, 1.0f))); };
  for (int y = 0; y < image.height; ++y)
    for (int x = 0; x < image.width; ++x) {
      const int column = std::min(texture.width - 1, static_cast<int>(x / scale)),
                row = std::min(texture.height - 1, static_cast<int>(y / scale));
      const std::size_t at = static_cast<std::size_t>(row) * texture.width + column;
      const LinearRgb colour =
          to_linear({byte(0.5f + 0.5f * texture.along[at] / along), byte(0.5f + 0.5f * texture.around[at] / around),
                     byte(texture.out[at] / out)});
      std::copy(colour.begin(), colour.end(), image.at(x, y));
      image.at(x, y)[3] = 1;
    }
  for (const Patch& patch : model.patches) outline(image, patch.rectangle, scale, {1, 1, 1});
  return image;
}

Image layout_image(const SkeletexModel& model, int pixels) {
  double scale = 1;
  Image image = canvas(model.texture, pixels, scale);
  fill_background(image, {1, 1, 1});
  for (std::size_t bone = 0; bone < model.patches.size(); ++bone) {
    const Rectangle& rectangle = model.patches[bone].rectangle;
    const LinearRgb colour = to_linear(bone_colour(static_cast<int>(bone)));
    for (int y = static_cast<int>(rectangle.y * scale);
         y < std::min(image.height, static_cast<int>((rectangle.y + rectangle.height) * scale)); ++y)
      for (int x = static_cast<int>(rectangle.x * scale);
           x < std::min(image.width, static_cast<int>((rectangle.x + rectangle.width) * scale)); ++x)
        std::copy(colour.begin(), colour.end(), image.at(x, y));
    outline(image, rectangle, scale, {0.02f, 0.02f, 0.02f});
  }
  for (std::size_t bone = 0; bone < model.patches.size(); ++bone) {
    const Rectangle& rectangle = model.patches[bone].rectangle;
    const std::string& name = model.skeleton.bones[bone].name;
    const double size =
        std::min({0.022 * pixels, 0.7 * rectangle.height * scale,
                  1.5 * rectangle.width * scale / std::max<double>(1, static_cast<double>(name.size()))});
    if (size < 5) continue;
    draw_text(image, (rectangle.x + 0.5 * rectangle.width) * scale,
              (rectangle.y + 0.5 * rectangle.height) * scale + 0.35 * size, name,
              {.size = size, .colour = {0.05, 0.05, 0.05}, .is_centred = true});
  }
  return image;
}

}  // namespace skeletex
