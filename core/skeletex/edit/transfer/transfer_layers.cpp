// SPDX-License-Identifier: MIT
#include "skeletex/edit/transfer/transfer_layers.h"

#include <algorithm>

#include "skeletex/convert/layers/read_layers.h"
#include "skeletex/reconstruct/layers/layer_values.h"
#include "skeletex/reconstruct/layers/turn_normals.h"
#include "skeletex/reconstruct/reconstruct_mesh.h"

namespace skeletex {
namespace {

constexpr double kReach = 0.01;  // diagonals

/// Per texel of the result: the place on the source, world units, and the source's share; 0 outside the parts.
struct PartTexels {
  std::vector<Vec3> places;
  std::vector<float> shares;
};
PartTexels part_texels(ClContext& context, const TransferInput& input, const Placement& placement) {
  const SkeletexModel& target = input.target;
  const std::size_t count = static_cast<std::size_t>(target.texture.width) * target.texture.height;
  PartTexels texels{std::vector<Vec3>(count, Vec3::Zero()), std::vector<float>(count, 0.f)};
  const BonePoints source = download_points(
      context, read_source(context, placement.tables, row_points(context, input.regular_source, RowChoice::kAll)));
  for (const TransferRow& row : placement.tables.rows) {
    const Placement::Owner& owner = placement.owners[row.patch];
    const Rectangle& r = target.patches[row.patch].rectangle;
    const double fade = std::max(1.0, owner.pair->width_in_rows(owner.index));
    for (int j = 0; j < r.width; ++j) {
      const TransferColumn& column = placement.tables.columns[placement.tables.patches[row.patch].column_begin + j];
      // Only where the target keeps a seam is there a boundary.
      const double before = column.first_row < 0 ? fade : row.row - static_cast<double>(column.first_row),
                   after = static_cast<int>(column.last_row) >= r.height
                               ? fade
                               : static_cast<double>(column.last_row) - row.row,
                   inside = std::min(before, after);
      const std::size_t texel = static_cast<std::size_t>(r.y + row.row) * target.texture.width + r.x + j;
      texels.places[texel] = input.source.origin + source.at(static_cast<std::size_t>(row.vertex) + j);
      const double share = std::clamp(inside / fade, 0.0, 1.0);
      texels.shares[texel] = static_cast<float>(share * share * (3 - 2 * share));
    }
  }
  return texels;
}

template <class T>
void mix_into(const std::vector<T>& source, std::span<const float> shares, std::vector<T>& target) {
  for (std::size_t i = 0; i < target.size(); ++i)
    if (shares[i] > 0) target[i] = (1 - shares[i]) * target[i] + shares[i] * source[i];
}

/// The parts of the result's mesh on the source.
struct PartSurface {
  TriangleMesh mesh;          ///< the result's vertices, in the parts at their places on the source; triangles there
  std::vector<float> shares;  ///< of the source, per vertex
};
PartSurface part_surface(const PreparedModel& result, const TriangleMesh& mesh, const PartTexels& texels) {
  PartSurface part{{mesh.positions, {}}, {}};
  for (const VertexTexels& at : texels_of_vertices(result)) {
    const bool is_inside = texels.shares[at.first] > 0 && texels.shares[at.second] > 0;
    if (is_inside)
      part.mesh.positions[part.shares.size()] = static_cast<double>(1 - at.share) * texels.places[at.first] +
                                                static_cast<double>(at.share) * texels.places[at.second];
    part.shares.push_back(is_inside ? (1 - at.share) * texels.shares[at.first] + at.share * texels.shares[at.second]
                                    : 0.f);
  }
  for (const Triangle& t : mesh.triangles)
    if (std::all_of(t.begin(), t.end(), [&](int v) { return part.shares[v] > 0; })) part.mesh.triangles.push_back(t);
  return part;
}

/// The source's attributes there.
MeshAttributes read_source_attributes(ClContext& context, const SkeletexModel& source, const TriangleMesh& part) {
  const PreparedModel prepared(source);
  const TriangleMesh mesh = reconstruct_bind_mesh(context, prepared).mesh;
  const std::vector<Vec3> outward = vertex_normals(part);
  std::vector<Probe> probes;
  for (std::size_t i = 0; i < outward.size(); ++i)
    probes.push_back({part.positions[i], outward[i], kReach * source.diagonal});
  return attributes_at(mesh, vertex_attributes(prepared),
                       find_surface_points(context, mesh, build_triangle_tree(mesh), probes));
}

/// \param positions  of the result's vertices
void mix_attributes(const MeshAttributes& own, const PartSurface& part, std::span<const Vec3> positions,
                    MeshAttributes& blended) {
  if (!blended.normals.empty()) {
    const std::vector<Vec3> turned = turn_normals(part.mesh, own.normals.values, positions);
    for (std::size_t i = 0; i < turned.size(); ++i)
      if (part.shares[i] > 0) blended.normals.values[i] = turned[i];
  }
  if (!own.colours.empty() && !blended.colours.empty())
    mix_into(own.colours.values, part.shares, blended.colours.values);
  for (VertexNumbers& numbers : blended.numbers)
    for (const VertexNumbers& from : own.numbers)
      if (from.name == numbers.name) mix_into(from.values, part.shares, numbers.values);
}

/// Sets the texels outside the parts to those of the target.
void keep_outside(const Layer& kept, const PartTexels& texels, Layer& layer) {
  for (std::size_t k = 0; k < std::min(layer.planes.size(), kept.planes.size()); ++k)
    for (std::size_t i = 0; i < texels.shares.size(); ++i)
      if (texels.shares[i] == 0) layer.planes[k][i] = kept.planes[k][i];
}

}  // namespace

std::vector<Layer> transfer_layers(ClContext& context, const TransferInput& input, const Placement& placement,
                                   const SkeletexModel& result) {
  if (result.layers.empty()) return {};
  const PartTexels texels = part_texels(context, input, placement);
  const PreparedModel prepared(result);
  const TriangleMesh mesh = reconstruct_bind_mesh(context, prepared).mesh;
  const PartSurface part = part_surface(prepared, mesh, texels);
  MeshAttributes blended = vertex_attributes(prepared);
  mix_attributes(read_source_attributes(context, input.source, part.mesh), part, mesh.positions, blended);
  std::vector<Layer> layers = layers_of_vertices(prepared, blended);
  for (Layer& layer : layers)
    if (const Layer* const kept = find_layer(input.target, layer.name)) keep_outside(*kept, texels, layer);
  return layers;
}

}  // namespace skeletex
