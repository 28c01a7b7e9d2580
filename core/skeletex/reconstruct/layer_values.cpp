// SPDX-License-Identifier: MIT
#include "skeletex/reconstruct/layer_values.h"

#include <algorithm>
#include <cmath>

#include "skeletex/geometry/parallel.h"
#include "skeletex/model/octahedral.h"
#include "skeletex/reconstruct/reconstruct_mesh.h"

namespace skeletex {
namespace {

constexpr std::size_t kRowsAtOnce = 8;

/// Calls act(bone, row, texel) with the first texel of every row, on all processors.
template <class Act>
void for_each_row(const PreparedModel& prepared, const Act& act) {
  const std::vector<LatticeRow>& rows = prepared.all_rows;
  for_each_block(rows.size(), kRowsAtOnce, [&](std::size_t, std::size_t begin, std::size_t end) {
    for (std::size_t k = begin; k < end; ++k) {
      const int bone = rows[k][0], row = rows[k][1];
      const Rectangle& r = prepared.model.patches[bone].rectangle;
      act(bone, row, static_cast<std::size_t>(r.y + row) * prepared.model.texture.width + r.x);
    }
  });
}

/// Samples and corners of the seam at an end of a patch.
void read_end(const PreparedModel& prepared, std::span<const Vec3> positions, int bone, BoneEnd end,
              std::vector<int>& columns, std::vector<VertexTexels>& vertices) {
  const EndSeam seam = end_seam(prepared.model, prepared.separation, prepared.lattice, positions, bone, end);
  const Rectangle& r = prepared.model.patches[bone].rectangle;
  const int line = (r.y + (end == BoneEnd::kHead ? 0 : r.height - 1)) * prepared.model.texture.width + r.x;
  for (std::size_t i = 0; i < seam.ring.vertices.size(); ++i) {
    const int vertex = seam.ring.vertices[i];
    if (columns[vertex] >= r.width) continue;
    columns[vertex] = r.width;
    const double x = (seam.turns[i] - std::floor(seam.turns[i])) * r.width;
    const int column = static_cast<int>(x) % r.width;
    vertices[vertex] = {line + column, line + (column + 1) % r.width, static_cast<float>(x - std::floor(x))};
  }
}

}  // namespace

std::vector<VertexTexels> texels_of_vertices(const PreparedModel& prepared) {
  const SkeletexModel& model = prepared.model;
  const Lattice& lattice = prepared.lattice;
  std::vector<VertexTexels> vertices(lattice.vertex_count);
  for_each_row(prepared, [&](int bone, int row, std::size_t texel) {
    const Rectangle& r = model.patches[bone].rectangle;
    if (row == 0 || row == r.height - 1) return;
    const int first = lattice.first_inner[bone] + (row - 1) * r.width;
    for (int j = 0; j < r.width; ++j)
      vertices[first + j] = {static_cast<int>(texel) + j, static_cast<int>(texel) + j, 0};
  });
  for_each_pole(model, lattice, [&](int vertex, int, int, std::size_t texel) {
    vertices[vertex] = {static_cast<int>(texel), static_cast<int>(texel), 0};
  });
  std::vector<Vec3> positions(lattice.vertex_count);
  place_seams(model, prepared.separation, lattice, positions);
  std::vector<int> columns(lattice.vertex_count, 0);  // of the patch that a seam's vertex reads
  for (int bone = 0; bone < static_cast<int>(model.patches.size()); ++bone)
    for (const BoneEnd end : {BoneEnd::kHead, BoneEnd::kTail})
      read_end(prepared, positions, bone, end, columns, vertices);
  return vertices;
}

const Layer* find_layer(const SkeletexModel& model, const std::string& name) {
  const auto found =
      std::find_if(model.layers.begin(), model.layers.end(), [&](const Layer& layer) { return layer.name == name; });
  return found == model.layers.end() ? nullptr : &*found;
}

std::vector<float> values_at(std::span<const VertexTexels> vertices, std::span<const float> plane) {
  std::vector<float> values;
  values.reserve(vertices.size());
  for (const VertexTexels& at : vertices)
    values.push_back((1 - at.share) * plane[at.first] + at.share * plane[at.second]);
  return values;
}

std::vector<Eigen::Vector3f> texel_normals(const PreparedModel& prepared, const Layer& layer) {
  std::vector<Eigen::Vector3f> normals(layer.planes[0].size(), Eigen::Vector3f::Zero());
  for_each_row(prepared, [&](int bone, int row, std::size_t texel) {
    for (int j = 0; j < prepared.model.patches[bone].rectangle.width; ++j, ++texel)
      normals[texel] =
          texel_axes(prepared.tables, bone, row, j) * direction_of({layer.planes[0][texel], layer.planes[1][texel]});
  });
  return normals;
}

std::vector<Vec3> normals_at(std::span<const VertexTexels> vertices, std::span<const Eigen::Vector3f> normals) {
  std::vector<Vec3> result;
  result.reserve(vertices.size());
  for (const VertexTexels& at : vertices) {
    const Eigen::Vector3f mean = (1 - at.share) * normals[at.first] + at.share * normals[at.second];
    const Eigen::Vector3f& normal = mean.squaredNorm() > 0 ? mean : normals[at.first];
    result.push_back(normal.cast<double>().normalized());
  }
  return result;
}

Layer normal_layer(const PreparedModel& prepared, std::span<const Eigen::Vector3f> normals) {
  Layer layer{kNormalLayer, LayerKind::kNormal, {}};
  layer.planes.assign(2, std::vector<float>(normals.size(), 0.f));
  for_each_row(prepared, [&](int bone, int row, std::size_t texel) {
    for (int j = 0; j < prepared.model.patches[bone].rectangle.width; ++j, ++texel) {
      const Eigen::Vector2f p = octahedral_of(texel_axes(prepared.tables, bone, row, j).transpose() * normals[texel]);
      layer.planes[0][texel] = p.x(), layer.planes[1][texel] = p.y();
    }
  });
  return layer;
}

MeshAttributes vertex_attributes(const PreparedModel& prepared) {
  MeshAttributes attributes;
  if (prepared.model.layers.empty()) return attributes;
  const std::vector<VertexTexels> vertices = texels_of_vertices(prepared);
  for (const Layer& layer : prepared.model.layers) {
    if (layer.kind == LayerKind::kNormal) {
      attributes.normals.values = normals_at(vertices, texel_normals(prepared, layer));
    } else if (layer.kind == LayerKind::kColour && attributes.colours.empty()) {
      attributes.colours.values.assign(vertices.size(), Colour::Ones());
      for (std::size_t k = 0; k < layer.planes.size(); ++k) {
        const std::vector<float> values = values_at(vertices, layer.planes[k]);
        for (std::size_t i = 0; i < values.size(); ++i) attributes.colours.values[i][static_cast<int>(k)] = values[i];
      }
    } else if (layer.kind == LayerKind::kNumber) {
      attributes.numbers.push_back({layer.name, values_at(vertices, layer.planes[0])});
    }
  }
  return attributes;
}

}  // namespace skeletex
