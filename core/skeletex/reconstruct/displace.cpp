// SPDX-License-Identifier: MIT
#include "skeletex/reconstruct/displace.h"

#include <algorithm>
#include <utility>

#include "reconstruct_structs.h"

namespace skeletex {

ClRange row_range(const ClContext& context, std::size_t rows) {
  const std::size_t group = context.row_items();
  return {{rows * group, 1}, {group, 1}};
}

DevicePlanes allocate_planes(ClContext& context, std::size_t count) {
  return {context.allocate<float>(3 * count), count};
}

DevicePlanes upload_planes(ClContext& context, std::span<const float> x, std::span<const float> y,
                           std::span<const float> z) {
  std::vector<float> values;
  values.reserve(3 * x.size());
  for (const std::span<const float>& plane : {x, y, z}) values.insert(values.end(), plane.begin(), plane.end());
  return {context.upload(values), x.size()};
}

DevicePlanes upload_texels(ClContext& context, const DisplacementTexture& texture) {
  return upload_planes(context, texture.along, texture.around, texture.out);
}

std::array<std::vector<float>, 3> download_planes(ClContext& context, const DevicePlanes& planes) {
  const ClMapping<float> values = context.map(planes.values);
  std::array<std::vector<float>, 3> copies;
  for (std::size_t i = 0; i < 3; ++i)
    copies[i].assign(values.data() + i * planes.count, values.data() + (i + 1) * planes.count);
  return copies;
}

void download_points(ClContext& context, const DevicePlanes& points, const Vec3& origin, std::span<Vec3> positions) {
  const ClMapping<float> values = context.map(points.values);
  for (int axis = 0; axis < 3; ++axis) {
    const float* const plane = values.data() + static_cast<std::size_t>(axis) * points.count;
    for (std::size_t i = 0; i < points.count; ++i) positions[i][axis] = origin[axis] + static_cast<double>(plane[i]);
  }
}

void download_texels(ClContext& context, const DevicePlanes& texels, DisplacementTexture& texture) {
  auto [along, around, out] = download_planes(context, texels);
  texture.along = std::move(along), texture.around = std::move(around), texture.out = std::move(out);
}

DeviceTables upload_tables(ClContext& context, const FrameTables& tables) {
  return {context.upload(tables.patches), context.upload(tables.rows), upload_columns(context, tables.columns),
          static_cast<int>(tables.columns.size())};
}

FrameTables in_bone_axes(FrameTables tables) {
  for (PatchRecord& record : tables.patches)
    for (int i = 0; i < 3; ++i) {
      record.head[i] = 0;
      record.s[i] = i == 0;
      record.b[i] = i == 1;
      record.axis[i] = i == 2;
    }
  return tables;
}

DeviceLattice upload_lattice(ClContext& context, const FrameTables& tables, const std::vector<Patch>& patches,
                             const DisplacementTexture& texture, RowChoice choice) {
  DeviceLattice lattice;
  lattice.texture_width = texture.width;
  lattice.texels = upload_texels(context, texture);
  lattice.tables = upload_tables(context, tables);
  lattice.rows = context.upload(lattice_rows(patches, choice));
  for (const Patch& patch : patches)
    lattice.vertex_count += static_cast<std::size_t>(patch.rectangle.width) *
                            (patch.rectangle.height - (choice == RowChoice::kInner ? 2 : 0));
  return lattice;
}

DisplaceParameters displace_parameters(std::size_t row_count, int texture_width, const DeviceTables& tables,
                                       const DevicePlanes& texels, const DevicePlanes& points) {
  return {static_cast<int>(row_count),
          texture_width,
          tables.column_count,
          static_cast<int>(texels.count),
          static_cast<int>(points.count),
          1};
}

void displace(ClContext& context, const DeviceLattice& lattice, DevicePlanes& points) {
  context.launch({"reconstruct.cl", "displace"}, row_range(context, lattice.rows.size),
                 displace_parameters(lattice.rows.size, lattice.texture_width, lattice.tables, lattice.texels, points),
                 lattice.rows, lattice.tables.patches, lattice.tables.rows, lattice.tables.columns,
                 lattice.texels.values, points.values);
}

void enter_tangent_space(ClContext& context, const DeviceTables& tables, const ClBuffer<LatticeRow>& rows,
                         int texture_width, const DevicePlanes& points, DevicePlanes& texels) {
  context.launch({"reconstruct.cl", "enter_tangent_space"}, row_range(context, rows.size),
                 displace_parameters(rows.size, texture_width, tables, texels, points), rows, tables.patches,
                 tables.rows, tables.columns, points.values, texels.values);
}

DeviceLattice upload_lattice(ClContext& context, const PreparedModel& model, RowChoice choice) {
  return upload_lattice(context, model.tables, model.model.patches, model.model.texture, choice);
}

namespace {

DevicePlanes points_of(ClContext& context, const DeviceLattice& lattice) {
  DevicePlanes points = allocate_planes(context, lattice.vertex_count);
  displace(context, lattice, points);
  return points;
}

}  // namespace

DevicePlanes row_points(ClContext& context, const PreparedModel& model, RowChoice choice) {
  return points_of(context, upload_lattice(context, model, choice));
}

DevicePlanes points_in_bone_axes(ClContext& context, const PreparedModel& model) {
  return points_of(context, upload_lattice(context, in_bone_axes(model.tables), model.model.patches,
                                           model.model.texture, RowChoice::kAll));
}

}  // namespace skeletex
