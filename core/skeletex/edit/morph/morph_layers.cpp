// SPDX-License-Identifier: MIT
#include "skeletex/edit/morph/morph_layers.h"

#include <algorithm>
#include <type_traits>

#include "skeletex/convert/layers/read_layers.h"
#include "skeletex/reconstruct/layers/layer_values.h"
#include "skeletex/reconstruct/layers/turn_normals.h"
#include "skeletex/reconstruct/reconstruct_mesh.h"

namespace skeletex {
namespace {

constexpr double kReach = 0.01;  // diagonals; corresponding places lie on the surface, but for curvature

/// The attributes of a model at places on it.
/// \param triangles  of the vertices that lie there
MeshAttributes attributes_of(ClContext& context, const LayerSource& source, const std::vector<Triangle>& triangles,
                             bool has_normals) {
  const PreparedModel prepared(source.model);
  const TriangleMesh mesh = reconstruct_bind_mesh(context, prepared).mesh;
  const std::vector<Vec3> outward = vertex_normals({source.positions, triangles});
  std::vector<Probe> probes;
  for (std::size_t i = 0; i < outward.size(); ++i)
    probes.push_back({source.positions[i], outward[i], kReach * source.model.diagonal});
  LayerOptions options;
  options.has_normals = has_normals;
  return attributes_at(mesh, vertex_attributes(prepared),
                       find_surface_points(context, mesh, build_triangle_tree(mesh), probes), options);
}

template <class T>
void add_weighted(const std::vector<T>& values, double weight, std::vector<T>& sum) {
  if (sum.empty()) sum.assign(values.size(), T(values[0] * 0));
  for (std::size_t i = 0; i < values.size(); ++i) {
    if constexpr (std::is_same_v<T, Vec3>)
      sum[i] += weight * values[i];
    else
      sum[i] += static_cast<float>(weight) * values[i];
  }
}

/// The mean of the sources that have a layer of some name.
void add_numbers(const MeshAttributes& from, double weight, std::vector<double>& weights,
                 std::vector<VertexNumbers>& sums) {
  for (const VertexNumbers& numbers : from.numbers) {
    const auto found =
        std::find_if(sums.begin(), sums.end(), [&](const VertexNumbers& sum) { return sum.name == numbers.name; });
    const std::size_t at = static_cast<std::size_t>(found - sums.begin());
    if (found == sums.end()) sums.push_back({numbers.name, {}}), weights.push_back(0);
    add_weighted(numbers.values, weight, sums[at].values);
    weights[at] += weight;
  }
}

}  // namespace

std::vector<Layer> blend_layers(ClContext& context, const SkeletexModel& result, std::span<const LayerSource> sources) {
  const auto has = [&](LayerKind kind) {
    return std::any_of(sources.begin(), sources.end(), [kind](const LayerSource& source) {
      return std::any_of(source.model.layers.begin(), source.model.layers.end(),
                         [kind](const Layer& layer) { return layer.kind == kind; });
    });
  };
  if (std::all_of(sources.begin(), sources.end(), [](const LayerSource& s) { return s.model.layers.empty(); }))
    return {};
  const PreparedModel prepared(result);
  const TriangleMesh mesh = reconstruct_bind_mesh(context, prepared).mesh;
  MeshAttributes mean;
  double colour_weight = 0;
  std::vector<double> number_weights;
  for (const LayerSource& source : sources) {
    const MeshAttributes at = attributes_of(context, source, mesh.triangles, has(LayerKind::kNormal));
    if (!at.normals.empty())
      add_weighted(turn_normals({source.positions, mesh.triangles}, at.normals.values, mesh.positions), source.weight,
                   mean.normals.values);
    if (!at.colours.empty()) {
      add_weighted(at.colours.values, source.weight, mean.colours.values);
      colour_weight += source.weight;
    }
    add_numbers(at, source.weight, number_weights, mean.numbers);
  }
  for (Vec3& normal : mean.normals.values) normal.normalize();
  for (Colour& colour : mean.colours.values) colour /= static_cast<float>(colour_weight);
  for (std::size_t i = 0; i < mean.numbers.size(); ++i)
    for (float& value : mean.numbers[i].values) value /= static_cast<float>(number_weights[i]);
  return layers_of_vertices(prepared, mean);
}

}  // namespace skeletex
