// SPDX-License-Identifier: MIT
#include "skeletex/model/mesh_attributes.h"

#include <algorithm>
#include <cmath>

namespace skeletex {

float linear_from_srgb(float x) { return x <= 0.04045f ? x / 12.92f : std::pow((x + 0.055f) / 1.055f, 2.4f); }
float srgb_from_linear(float x) { return x <= 0.0031308f ? 12.92f * x : 1.055f * std::pow(x, 1 / 2.4f) - 0.055f; }

bool has_colour(const MeshAttributes& attributes) {
  return !attributes.colours.empty() ||
         std::any_of(attributes.materials.begin(), attributes.materials.end(), [](const Material& material) {
           return material.base != Colour::Ones() || !material.image.empty() || !material.image_file.empty();
         });
}

void turn_over(MeshAttributes& attributes) {
  const auto turn = [](std::vector<Triangle>& corners) {
    for (Triangle& t : corners) std::swap(t[1], t[2]);
  };
  turn(attributes.normals.corners);
  turn(attributes.colours.corners);
  turn(attributes.texture_coordinates.corners);
}

}  // namespace skeletex
