// SPDX-License-Identifier: MIT
#include "skeletex/convert/layers/read_layers.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "skeletex/geometry/half_edge_table.h"
#include "skeletex/geometry/parallel.h"
#include "skeletex/reconstruct/layers/layer_values.h"
#include "skeletex/reconstruct/reconstruct_mesh.h"

namespace skeletex {
namespace {

constexpr std::size_t kBlock = 1 << 12;

/// Normals at points of a mesh. A point on an edge or a vertex that separates several has their mean: it stands for
/// both sides.
class SurfaceNormals {
 public:
  SurfaceNormals(const TriangleMesh& mesh, CornerValues<Vec3> normals) : mesh_(mesh), normals_(std::move(normals)) {
    if (normals_.corners.empty()) return;
    edges_ = link_half_edges(mesh.triangles, static_cast<int>(mesh.positions.size()));
    vertex_normals_.assign(mesh.positions.size(), Vec3::Zero());
    for (std::size_t t = 0; t < mesh.triangles.size(); ++t)
      for (int k = 0; k < 3; ++k) vertex_normals_[mesh.triangles[t][k]] += normals_.values[normals_.corners[t][k]];
    for (Vec3& normal : vertex_normals_) normal.normalize();
  }

  Vec3 at(const SurfacePoint& point) const {
    Vec3 normal = in_triangle(point.triangle, point.weights);
    if (!normals_.corners.empty()) {
      constexpr float kOnEdge = 1e-3f;
      const Triangle& t = mesh_.triangles[point.triangle];
      int zeros = 0, zero = 0, vertex = 0;
      for (int k = 0; k < 3; ++k) {
        if (point.weights[k] < kOnEdge)
          ++zeros, zero = k;
        else
          vertex = k;
      }
      if (zeros == 2) normal = vertex_normals_[t[vertex]];
      if (zeros == 1) normal += across(point, (zero + 1) % 3);
    }
    return normal.normalized();
  }

 private:
  Vec3 in_triangle(TriangleIndex triangle, const Eigen::Vector3f& weights) const {
    const Triangle& corners = normals_.of(mesh_, triangle);
    Vec3 normal = Vec3::Zero();
    for (int k = 0; k < 3; ++k) normal += static_cast<double>(weights[k]) * normals_.values[corners[k]];
    return normal;
  }
  /// The normal on the other side of the edge that begins at corner k.
  Vec3 across(const SurfacePoint& point, int k) const {
    const int twin = edges_.twins[3 * point.triangle + k];
    if (twin < 0) return Vec3::Zero();
    Eigen::Vector3f weights = Eigen::Vector3f::Zero();
    weights[twin % 3] = point.weights[(k + 1) % 3];
    weights[(twin + 1) % 3] = point.weights[k];
    return in_triangle(twin / 3, weights);
  }

  const TriangleMesh& mesh_;
  CornerValues<Vec3> normals_;
  HalfEdgeTable edges_;               ///< where corners have normals of their own
  std::vector<Vec3> vertex_normals_;  ///< the same
};

/// Those of the file, turned where they look inwards for the most part; else computed.
CornerValues<Vec3> normals_of(const TriangleMesh& mesh, const MeshAttributes& attributes, double crease_angle) {
  if (attributes.normals.empty()) {
    if (crease_angle < std::numbers::pi) return creased_normals(mesh, crease_angle);
    return {vertex_normals(mesh), {}};
  }
  CornerValues<Vec3> normals = attributes.normals;
  double outward = 0;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    const Vec3 area = area_vector(mesh, mesh.triangles[t]);
    for (const int corner : normals.of(mesh, t)) outward += normals.values[corner].dot(area);
  }
  if (outward < 0)
    for (Vec3& normal : normals.values) normal = -normal;
  return normals;
}

/// Calls act(texel, point) for the texels that have one, on all processors.
template <class Act>
void for_each_point(std::span<const SurfacePoint> points, const Act& act) {
  for_each_index(points.size(), kBlock, [&](std::size_t i) {
    if (points[i].triangle >= 0) act(i, points[i]);
  });
}

std::vector<float> read_numbers(const TriangleMesh& mesh, const VertexNumbers& numbers,
                                std::span<const SurfacePoint> points) {
  std::vector<float> values(points.size(), 0.f);
  for_each_point(points, [&](std::size_t i, const SurfacePoint& point) {
    const Triangle& t = mesh.triangles[point.triangle];
    for (int k = 0; k < 3; ++k) values[i] += point.weights[k] * numbers.values[t[k]];
  });
  return values;
}

bool is_taken(const std::string& name, const std::vector<VertexNumbers>& taken) {
  return name.empty() || name == kNormalLayer || name == kColourLayer ||
         std::any_of(taken.begin(), taken.end(), [&](const VertexNumbers& numbers) { return numbers.name == name; });
}

}  // namespace

SurfaceColours::SurfaceColours(const TriangleMesh& mesh, const MeshAttributes& attributes)
    : mesh_(mesh), attributes_(attributes) {
  for (std::size_t i = 0; i < linear_.size(); ++i) linear_[i] = linear_from_srgb(static_cast<float>(i) / 255);
}

Colour SurfaceColours::at(const SurfacePoint& point) const {
  Colour colour = Colour::Ones();
  if (!attributes_.colours.empty()) {
    colour.setZero();
    const Triangle& corners = attributes_.colours.of(mesh_, point.triangle);
    for (int k = 0; k < 3; ++k) colour += point.weights[k] * attributes_.colours.values[corners[k]];
  }
  const int number = attributes_.triangle_materials.empty() ? -1 : attributes_.triangle_materials[point.triangle];
  if (number < 0) return colour;
  const Material& material = attributes_.materials[number];
  colour = colour.cwiseProduct(material.base);
  if (material.image.empty() || attributes_.texture_coordinates.empty()) return colour;
  const Triangle& corners = attributes_.texture_coordinates.of(mesh_, point.triangle);
  Eigen::Vector2f uv = Eigen::Vector2f::Zero();
  for (int k = 0; k < 3; ++k) {
    if (corners[k] < 0) return colour;
    uv += point.weights[k] * attributes_.texture_coordinates.values[corners[k]];
  }
  if (!uv.allFinite()) return colour;
  // Pixel centres lie at halves; beyond its sides the picture repeats.
  const ColourImage& image = material.image;
  const float x = (uv.x() - std::floor(uv.x())) * static_cast<float>(image.width) - 0.5f,
              y = (1 - (uv.y() - std::floor(uv.y()))) * static_cast<float>(image.height) - 0.5f;
  const auto column = static_cast<int>(std::floor(x)), row = static_cast<int>(std::floor(y));
  const float s = x - std::floor(x), t = y - std::floor(y);
  Colour picture = Colour::Zero();
  for (int i = 0; i < 2; ++i)
    for (int j = 0; j < 2; ++j) {
      const std::size_t pixel =
          static_cast<std::size_t>((row + i + image.height) % image.height) * static_cast<std::size_t>(image.width) +
          static_cast<std::size_t>((column + j + image.width) % image.width);
      const std::uint8_t* rgba = image.rgba.data() + 4 * pixel;
      picture += (i == 0 ? 1 - t : t) * (j == 0 ? 1 - s : s) *
                 Colour(linear_[rgba[0]], linear_[rgba[1]], linear_[rgba[2]], static_cast<float>(rgba[3]) / 255);
    }
  return colour.cwiseProduct(picture);
}

bool has_layers(const MeshAttributes& attributes, const LayerOptions& options) {
  return options.has_normals || (options.has_colours && has_colour(attributes)) ||
         (options.has_numbers && !attributes.numbers.empty());
}

MeshAttributes attributes_at(const TriangleMesh& mesh, const MeshAttributes& attributes,
                             std::span<const SurfacePoint> points, const LayerOptions& options) {
  MeshAttributes at;
  if (options.has_normals) {
    const SurfaceNormals surface(mesh, normals_of(mesh, attributes, options.crease_angle));
    at.normals.values.assign(points.size(), Vec3::Zero());
    for_each_point(points, [&](std::size_t i, const SurfacePoint& point) { at.normals.values[i] = surface.at(point); });
  }
  if (options.has_colours && has_colour(attributes)) {
    const SurfaceColours surface(mesh, attributes);
    at.colours.values.assign(points.size(), Colour(0, 0, 0, 1));
    for_each_point(points, [&](std::size_t i, const SurfacePoint& point) { at.colours.values[i] = surface.at(point); });
  }
  if (options.has_numbers)
    for (const VertexNumbers& numbers : attributes.numbers)
      at.numbers.push_back({numbers.name, read_numbers(mesh, numbers, points)});
  return at;
}

namespace {

/// Takes colours and normals from the nearest points of the file's surface, on the side where the mesh looks.
/// \param points  of the mesh, as `attributes`
/// \param frame  of the mesh
void take_from_original(ClContext& context, const AttributedMesh& original, const TriangleMesh& mesh,
                        const UnitFrame& frame, std::span<const SurfacePoint> points, MeshAttributes& attributes) {
  constexpr float kOnEdge = 1e-3f;
  constexpr double kSameSide = 0.5, kFlat = 0.9;  // cosines
  LayerOptions options;
  options.has_normals = !attributes.normals.empty() && !original.attributes.normals.empty();
  options.has_colours = !attributes.colours.empty();
  options.has_numbers = false;
  const TriangleMesh surface = in_frame(original.mesh, frame);
  MeshAttributes those =
      attributes_at(surface, original.attributes, points_on_original(context, surface, mesh, points), options);
  if (!those.colours.empty()) attributes.colours = std::move(those.colours);
  if (!options.has_normals) return;
  for_each_point(points, [&](std::size_t i, const SurfacePoint& point) {
    const Vec3 outward = area_vector(mesh, mesh.triangles[point.triangle]).normalized();
    Vec3& normal = attributes.normals.values[i];
    // On a sharp edge the normal stands for both sides, of which the file's is one.
    if (point.weights.minCoeff() < kOnEdge && normal.dot(outward) < kFlat) return;
    const double cosine = those.normals.values[i].dot(outward);
    if (std::abs(cosine) > kSameSide) normal = (cosine < 0 ? -1 : 1) * those.normals.values[i];
  });
}

}  // namespace

ReadLayers read_layers(ClContext& context, const PreparedModel& model, const TriangleMesh& mesh,
                       const TriangleTree& tree, const MeshAttributes& given, const LayerOptions& options) {
  ReadLayers result;
  if (!has_layers(given, options)) return result;
  MeshAttributes attributes = given;
  attributes.numbers.clear();
  for (const VertexNumbers& numbers : given.numbers) {
    const auto bad =
        std::find_if(numbers.values.begin(), numbers.values.end(), [](float x) { return !std::isfinite(x); });
    if (bad != numbers.values.end())
      result.notes.push_back(fmt::format("the numbers \"{}\" are left out: that of vertex {} is not finite",
                                         numbers.name, bad - numbers.values.begin()));
    else if (is_taken(numbers.name, attributes.numbers))
      result.notes.push_back(fmt::format("the numbers \"{}\" are left out: another layer has this name", numbers.name));
    else
      attributes.numbers.push_back(numbers);
  }
  const std::vector<SurfacePoint> points = surface_points(context, model, mesh, tree);
  MeshAttributes texels = attributes_at(mesh, attributes, points, options);
  if (given.original) take_from_original(context, *given.original, mesh, model.model.skeleton.frame, points, texels);
  result.layers = layers_of_texels(model, texels);
  return result;
}

std::vector<Layer> read_layers_of(ClContext& context, const PreparedModel& from, const PreparedModel& to) {
  if (from.model.layers.empty()) return {};
  const TriangleMesh mesh = reconstruct_bind_mesh(context, from).mesh;
  const MeshAttributes attributes = vertex_attributes(from);
  LayerOptions options;
  options.has_normals = !attributes.normals.empty();
  return read_layers(context, to, mesh, build_triangle_tree(mesh), attributes, options).layers;
}

}  // namespace skeletex
