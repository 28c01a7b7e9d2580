// SPDX-License-Identifier: MIT
#include "skeletex/model/mesh_attributes.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numeric>
#include <type_traits>

#include "skeletex/math/portable.h"

namespace skeletex {

float power(float x, double exponent) { return static_cast<float>(portable::pow(x, exponent)); }
float linear_from_srgb(float x) { return x <= 0.04045f ? x / 12.92f : power((x + 0.055f) / 1.055f, 2.4); }
float srgb_from_linear(float x) { return x <= 0.0031308f ? 12.92f * x : 1.055f * power(x, 1 / 2.4) - 0.055f; }

const AttributedMesh* weighted_original(const MeshAttributes& attributes) {
  const AttributedMesh* original = attributes.original.get();
  return original != nullptr && !original->weights.empty() ? original : nullptr;
}

bool has_colour(const MeshAttributes& attributes) {
  // Many files give every mesh one plain material, which says nothing of its surface.
  const std::vector<Material>& materials = attributes.materials;
  return !attributes.colours.empty() || std::any_of(materials.begin(), materials.end(), [&](const Material& material) {
    return !material.image.empty() || material.base != materials[0].base;
  });
}

void turn_over(MeshAttributes& attributes, const std::vector<bool>& is_turned) {
  const auto turn = [&](std::vector<Triangle>& corners) {
    for (std::size_t t = 0; t < corners.size(); ++t)
      if (is_turned.empty() || is_turned[t]) std::swap(corners[t][1], corners[t][2]);
  };
  turn(attributes.normals.corners);
  turn(attributes.colours.corners);
  turn(attributes.texture_coordinates.corners);
}

SplitMesh split_vertices(const TriangleMesh& mesh, const MeshAttributes& attributes) {
  SplitMesh split;
  if (attributes.normals.corners.empty() && attributes.colours.corners.empty() &&
      attributes.texture_coordinates.corners.empty()) {
    split = {mesh, attributes, std::vector<int>(mesh.positions.size())};
    std::iota(split.sources.begin(), split.sources.end(), 0);
    return split;
  }
  split.mesh.triangles.resize(mesh.triangles.size());
  split.attributes.materials = attributes.materials;
  split.attributes.triangle_materials = attributes.triangle_materials;
  for (const VertexNumbers& numbers : attributes.numbers) split.attributes.numbers.push_back({numbers.name, {}});
  std::map<std::array<int, 4>, int> made;  // of a vertex, a normal, a colour and texture coordinates
  const auto take = [](const auto& from, int index, auto& to) {
    using Value = typename std::decay_t<decltype(from.values)>::value_type;
    if (!from.empty()) to.values.push_back(index < 0 ? Value(Value::Zero()) : from.values[index]);
  };
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t)
    for (int k = 0; k < 3; ++k) {
      const auto index = [&](const auto& values) { return values.empty() ? -1 : values.of(mesh, t)[k]; };
      const int vertex = mesh.triangles[t][k], normal = index(attributes.normals), colour = index(attributes.colours),
                texture = index(attributes.texture_coordinates);
      const auto [found, is_new] =
          made.try_emplace({vertex, normal, colour, texture}, static_cast<int>(split.mesh.positions.size()));
      split.mesh.triangles[t][k] = found->second;
      if (!is_new) continue;
      split.mesh.positions.push_back(mesh.positions[vertex]);
      split.sources.push_back(vertex);
      take(attributes.normals, normal, split.attributes.normals);
      take(attributes.colours, colour, split.attributes.colours);
      take(attributes.texture_coordinates, texture, split.attributes.texture_coordinates);
      for (std::size_t i = 0; i < attributes.numbers.size(); ++i)
        split.attributes.numbers[i].values.push_back(attributes.numbers[i].values[vertex]);
    }
  return split;
}

}  // namespace skeletex
