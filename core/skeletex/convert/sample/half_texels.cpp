// SPDX-License-Identifier: MIT
#include "skeletex/convert/sample/half_texels.h"

#include <algorithm>
#include <cmath>

namespace skeletex {
namespace {

/// Over those that are not 0.
double root_mean_square(const ClMapping<float>& squares) {
  double sum = 0;
  int count = 0;
  for (std::size_t i = 0; i < squares.size(); ++i) sum += squares.data()[i], count += squares.data()[i] > 0;
  return count > 0 ? std::sqrt(sum / count) : 0;
}

/// Planes of one buffer as buffers of their own.
TexelPoints separate_planes(ClContext& context, const DevicePlanes& planes) {
  const auto [x, y, z] = download_planes(context, planes);
  return {context.upload(x), context.upload(y), context.upload(z)};
}

/// Which diagonals the decoder takes: per texel whether the quad to the right of and above it takes the second one.
ClBuffer<int> choose_diagonals(ClContext& context, DiagonalRule rule, const std::vector<Patch>& patches,
                               const DeviceLayout& layout, const TexelPoints& points) {
  constexpr int kBandRows = 16, kBandColumns = 64;  // of a group; columns as in lattice.cl
  std::vector<LatticeRow> rows = lattice_rows(patches, RowChoice::kInner);
  std::erase_if(rows, [&](const LatticeRow& row) { return row[1] == patches[row[0]].rectangle.height - 2; });
  const int count = static_cast<int>(rows.size());
  int widest = 0;
  for (const Patch& patch : patches) widest = std::max(widest, patch.rectangle.width);
  ClRange groups = row_range(context, (count + kBandRows - 1) / kBandRows);
  groups.global[1] = (widest + kBandColumns - 1) / kBandColumns;
  auto diagonals = context.allocate<int>(layout.size());
  context.fill(diagonals, 0);
  context.launch({"lattice.cl", "choose_diagonals"}, groups, count, kBandRows, layout.width,
                 static_cast<int>(rule == DiagonalRule::kSmooth), context.upload(rows), layout.patches, points.x,
                 points.y, points.z, diagonals);
  return diagonals;
}

}  // namespace

RoundingReport round_to_half(ClContext& context, DiagonalRule rule, const std::vector<Patch>& patches,
                             const DeviceLayout& layout, const ClBuffer<RowRecord>& rows,
                             const ClBuffer<ColumnRecord>& columns, const TexelPoints& points, TexelPoints& texels) {
  const auto diagonals = choose_diagonals(context, rule, patches, layout, points);
  auto nearest2 = context.allocate<float>(layout.size()), chosen2 = context.allocate<float>(layout.size());
  context.fill(nearest2, 0.f), context.fill(chosen2, 0.f);
  const auto inner_rows = context.upload(lattice_rows(patches, RowChoice::kInner));
  context.launch({"half.cl", "round_texels"}, row_range(context, inner_rows.size), static_cast<int>(inner_rows.size),
                 layout.width, inner_rows, layout.patches, rows, columns, points.x, points.y, points.z, diagonals,
                 texels.x, texels.y, texels.z, nearest2, chosen2);
  return {root_mean_square(context.map(nearest2)), root_mean_square(context.map(chosen2))};
}

RoundedModel round_to_half(ClContext& context, const SkeletexModel& model) {
  const DisplacementTexture& texture = model.texture;
  const FrameTables tables =
      frame_tables(model.skeleton, SeparationPlanes(model.skeleton), model.patches, model.origin);
  const DeviceLayout layout = upload_layout(context, model.patches, tables, texture.width, texture.height);
  // Rows whose points come at the places of their texels.
  DeviceLattice lattice = upload_lattice(context, tables, model.patches, texture, RowChoice::kAll);
  std::vector<LatticeRow> rows = lattice_rows(model.patches, RowChoice::kAll);
  for (LatticeRow& row : rows)
    row[2] = (model.patches[row[0]].rectangle.y + row[1]) * texture.width + model.patches[row[0]].rectangle.x;
  lattice.rows = context.upload(rows);
  DevicePlanes points = allocate_planes(context, layout.size());
  context.fill(points.values, 0.f);
  displace(context, lattice, points);
  TexelPoints texels = separate_planes(context, lattice.texels);
  const RoundingReport report =
      round_to_half(context, model.diagonals, model.patches, layout, context.upload(tables.rows),
                    context.upload(tables.columns), separate_planes(context, points), texels);
  RoundedModel rounded{model, report};
  rounded.model.texture = {texture.width, texture.height, context.download(texels.x), context.download(texels.y),
                           context.download(texels.z)};
  return rounded;
}

}  // namespace skeletex
