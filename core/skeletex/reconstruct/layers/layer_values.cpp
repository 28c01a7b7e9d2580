// SPDX-License-Identifier: MIT
#include "skeletex/reconstruct/layers/layer_values.h"

#include <algorithm>
#include <cmath>

#include "skeletex/geometry/parallel.h"
#include "skeletex/model/octahedral.h"
#include "skeletex/reconstruct/layers/turn_normals.h"
#include "skeletex/reconstruct/reconstruct_mesh.h"

namespace skeletex {
namespace {

constexpr std::size_t kRowsAtOnce = 8;

/// Calls act(bone, row, texel) with the first texel of every row, on all processors.
template <class Act>
void for_each_row(const PreparedModel& prepared, const Act& act) {
  const std::vector<LatticeRow>& rows = prepared.all_rows;
  for_each_index(rows.size(), kRowsAtOnce, [&](std::size_t k) {
    const int bone = rows[k][0], row = rows[k][1];
    const Rectangle& r = prepared.model.patches[bone].rectangle;
    act(bone, row, static_cast<std::size_t>(r.y + row) * prepared.model.texture.width + r.x);
  });
}

/// Samples and corners of the seam at an end of a patch.
void read_end(const PreparedModel& prepared, std::span<const Vec3> positions, BoneIndex bone, BoneEnd end,
              std::vector<int>& columns, std::vector<VertexTexels>& vertices) {
  const EndSeam seam = end_seam(prepared.model, prepared.separation, prepared.lattice, positions, bone, end);
  const Rectangle& r = prepared.model.patches[bone].rectangle;
  const int line = (r.y + (end == BoneEnd::kHead ? 0 : r.height - 1)) * prepared.model.texture.width + r.x;
  for (std::size_t i = 0; i < seam.ring.vertices.size(); ++i) {
    const VertexIndex vertex = seam.ring.vertices[i];
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
  for_each_row(prepared, [&](BoneIndex bone, int row, std::size_t texel) {
    const Rectangle& r = model.patches[bone].rectangle;
    if (row == 0 || row == r.height - 1) return;
    const int first = lattice.first_inner[bone] + (row - 1) * r.width;
    for (int j = 0; j < r.width; ++j)
      vertices[first + j] = {static_cast<int>(texel) + j, static_cast<int>(texel) + j, 0};
  });
  for_each_pole(model, lattice, [&](VertexIndex vertex, int, int, std::size_t texel) {
    vertices[vertex] = {static_cast<int>(texel), static_cast<int>(texel), 0};
  });
  std::vector<Vec3> positions(lattice.vertex_count);
  place_seams(model, prepared.separation, lattice, positions);
  std::vector<int> columns(lattice.vertex_count, 0);  // of the patch that a seam's vertex reads
  for (BoneIndex bone = 0; bone < static_cast<int>(model.patches.size()); ++bone)
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
  for_each_row(prepared, [&](BoneIndex bone, int row, std::size_t texel) {
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
  for_each_row(prepared, [&](BoneIndex bone, int row, std::size_t texel) {
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

std::vector<Layer> layers_of_texels(const PreparedModel& prepared, const MeshAttributes& texels) {
  std::vector<Layer> layers;
  if (!texels.normals.empty()) {
    std::vector<Eigen::Vector3f> normals;
    normals.reserve(texels.normals.values.size());
    for (const Vec3& normal : texels.normals.values) normals.push_back(normal.cast<float>());
    layers.push_back(normal_layer(prepared, normals));
  }
  if (!texels.colours.empty()) {
    const std::vector<Colour>& colours = texels.colours.values;
    const bool is_opaque =
        std::all_of(colours.begin(), colours.end(), [](const Colour& colour) { return colour[3] == 1; });
    Layer layer{kColourLayer, LayerKind::kColour, {}};
    for (int k = 0; k < (is_opaque ? 3 : 4); ++k) {
      std::vector<float>& plane = layer.planes.emplace_back();
      plane.reserve(colours.size());
      for (const Colour& colour : colours) plane.push_back(colour[k]);
    }
    layers.push_back(std::move(layer));
  }
  for (const VertexNumbers& numbers : texels.numbers)
    layers.push_back({numbers.name, LayerKind::kNumber, {numbers.values}});
  return layers;
}

namespace {

/// Per texel the vertices that it lies between; of texels between rectangles vertex 0.
std::vector<VertexTexels> vertices_of_texels(const PreparedModel& prepared) {
  const SkeletexModel& model = prepared.model;
  const Lattice& lattice = prepared.lattice;
  std::vector<VertexTexels> texels(static_cast<std::size_t>(model.texture.width) * model.texture.height);
  std::vector<Vec3> positions(lattice.vertex_count);
  place_seams(model, prepared.separation, lattice, positions);
  const auto end_columns = [&](BoneIndex bone, BoneEnd end, VertexTexels* row) {
    const int width = model.patches[bone].rectangle.width, pole = lattice.poles[bone][static_cast<int>(end)];
    if (pole >= 0) {
      std::fill_n(row, width, VertexTexels{pole, pole, 0});
      return;
    }
    const EndSeam seam = end_seam(model, prepared.separation, lattice, positions, bone, end);
    const std::vector<int>& ring = seam.ring.vertices;
    for (int j = 0; j < width; ++j) {
      const double v = static_cast<double>(j) / width, turn = v + std::ceil(seam.turns[0] - v);
      const auto next = std::upper_bound(seam.turns.begin(), seam.turns.end(), turn) - seam.turns.begin();
      const double before = seam.turns[next - 1],
                   after = next == std::ssize(ring) ? seam.turns[0] + 1 : seam.turns[next];
      row[j] = {ring[next - 1], ring[next == std::ssize(ring) ? 0 : next],
                static_cast<float>(after > before ? (turn - before) / (after - before) : 0)};
    }
  };
  for_each_row(prepared, [&](BoneIndex bone, int row, std::size_t texel) {
    const int width = model.patches[bone].rectangle.width, height = model.patches[bone].rectangle.height;
    if (row == 0 || row == height - 1) {
      end_columns(bone, row == 0 ? BoneEnd::kHead : BoneEnd::kTail, texels.data() + texel);
      return;
    }
    const int first = lattice.first_inner[bone] + (row - 1) * width;
    for (int j = 0; j < width; ++j) texels[texel + j] = {first + j, first + j, 0};
  });
  return texels;
}

}  // namespace

std::vector<Layer> layers_of_vertices(const PreparedModel& prepared, const MeshAttributes& vertices) {
  const std::vector<VertexTexels> places = vertices_of_texels(prepared);
  MeshAttributes texels;
  const auto mix = [&places](const auto& from, auto& to) {
    if (from.empty()) return;
    to.reserve(places.size());
    for (const VertexTexels& at : places) {
      using Value = typename std::decay_t<decltype(from)>::value_type;
      const auto share = static_cast<typename Value::Scalar>(at.share);
      to.push_back(at.share == 0 ? from[at.first] : Value((1 - share) * from[at.first] + share * from[at.second]));
    }
  };
  mix(vertices.normals.values, texels.normals.values);
  mix(vertices.colours.values, texels.colours.values);
  for (const VertexNumbers& numbers : vertices.numbers)
    texels.numbers.push_back({numbers.name, values_at(places, numbers.values)});
  return layers_of_texels(prepared, texels);
}

void turn_normal_layer(const PreparedModel& prepared, const TriangleMesh& mesh, std::span<const Vec3> positions,
                       SkeletexModel& result) {
  const auto is_normal = [](const Layer& l) { return l.kind == LayerKind::kNormal; };
  const auto layer = std::find_if(result.layers.begin(), result.layers.end(), is_normal);
  const auto before = std::find_if(prepared.model.layers.begin(), prepared.model.layers.end(), is_normal);
  if (layer == result.layers.end() || before == prepared.model.layers.end()) return;
  const std::vector<Vec3> normals = normals_at(texels_of_vertices(prepared), texel_normals(prepared, *before));
  const std::vector<Vec3> turned = turn_normals(mesh, normals, positions);
  MeshAttributes vertices;
  vertices.normals.values = turned;
  const std::vector<Layer> made = layers_of_vertices(prepared, vertices);
  const std::vector<VertexTexels> places = vertices_of_texels(prepared);
  for (std::size_t i = 0; i < places.size(); ++i)
    if (turned[places[i].first] != normals[places[i].first] || turned[places[i].second] != normals[places[i].second])
      for (int k = 0; k < 2; ++k) layer->planes[k][i] = made[0].planes[k][i];
}

}  // namespace skeletex
