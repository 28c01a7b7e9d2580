// SPDX-License-Identifier: MIT
#include "skeletex/convert/sample/half_texels.h"

#include <cmath>

#include "skeletex/convert/snap/lattice_surface.h"

namespace skeletex {
namespace {

/// Over those that are not 0.
double root_mean_square(std::span<const float> squares) {
  double sum = 0;
  int count = 0;
  for (const float square : squares) sum += square, count += square > 0;
  return count > 0 ? std::sqrt(sum / count) : 0;
}

}  // namespace

RoundingReport round_to_half(ClContext& context, DiagonalRule rule, const std::vector<Patch>& patches,
                             const DeviceLayout& layout, const DevicePlanes& points, DevicePlanes& texels) {
  const auto diagonals =
      choose_diagonals(context, rule, quad_rows(patches), layout.tables.patches, layout.width, points);
  auto squares = context.allocate<float>(2 * layout.size());
  context.fill(squares, 0.f);
  const auto inner_rows = context.upload(lattice_rows(patches, RowChoice::kInner));
  context.launch({"half.cl", "round_texels"}, row_range(context, inner_rows.size),
                 TexelParameters{layout.width, static_cast<int>(layout.size()), static_cast<int>(inner_rows.size),
                                 layout.tables.column_count, 0},
                 inner_rows, layout.tables.patches, layout.tables.rows, layout.tables.columns, points.values, diagonals,
                 texels.values, squares);
  const ClMapping<float> mapped = context.map(squares);
  return {root_mean_square({mapped.data(), layout.size()}),
          root_mean_square({mapped.data() + layout.size(), layout.size()})};
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
  const RoundingReport report = round_to_half(context, model.diagonals, model.patches, layout, points, lattice.texels);
  RoundedModel rounded{model, report};
  download_texels(context, lattice.texels, rounded.model.texture);
  return rounded;
}

}  // namespace skeletex
