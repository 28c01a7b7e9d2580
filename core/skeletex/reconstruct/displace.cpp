// SPDX-License-Identifier: MIT
#include "skeletex/reconstruct/displace.h"

#include <algorithm>

namespace skeletex {

std::vector<LatticeRow> lattice_rows(const std::vector<Patch>& patches, RowChoice choice) {
  const int margin = choice == RowChoice::kInner ? 1 : 0;
  std::vector<LatticeRow> rows;
  int vertex = 0, quad = 0;
  for (int bone = 0; bone < static_cast<int>(patches.size()); ++bone) {
    const Rectangle& rectangle = patches[bone].rectangle;
    for (int row = margin; row < rectangle.height - margin; ++row) {
      rows.push_back({bone, row, vertex, quad});
      vertex += rectangle.width;
      if (row + 1 < rectangle.height - margin) quad += rectangle.width;
    }
  }
  return rows;
}

ClRange row_range(const ClContext& context, std::size_t rows) {
  const std::size_t group = context.row_items();
  return {{rows * group, 1}, {group, 1}};
}

DevicePlanes allocate_planes(ClContext& context, std::size_t size) {
  return {context.allocate<float>(size), context.allocate<float>(size), context.allocate<float>(size)};
}

DeviceTables upload_tables(ClContext& context, const FrameTables& tables) {
  const std::size_t count = tables.columns.size();
  std::vector<float> columns(4 * count);
  for (std::size_t i = 0; i < count; ++i) {
    columns[i] = tables.columns[i].cosine;
    columns[count + i] = tables.columns[i].sine;
    columns[2 * count + i] = tables.columns[i].slope_head;
    columns[3 * count + i] = tables.columns[i].slope_tail;
  }
  return {context.upload(tables.patches), context.upload(tables.rows), context.upload(columns),
          static_cast<int>(count)};
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
  lattice.texels = {context.upload(texture.along), context.upload(texture.around), context.upload(texture.out)};
  lattice.tables = upload_tables(context, tables);
  lattice.rows = context.upload(lattice_rows(patches, choice));
  for (const Patch& patch : patches)
    lattice.vertex_count += static_cast<std::size_t>(patch.rectangle.width) *
                            (patch.rectangle.height - (choice == RowChoice::kInner ? 2 : 0));
  return lattice;
}

void displace(ClContext& context, const DeviceLattice& lattice, DevicePlanes& points) {
  context.launch({"reconstruct.cl", "displace"}, row_range(context, lattice.rows.size),
                 static_cast<int>(lattice.rows.size), lattice.texture_width, lattice.tables.column_count, lattice.rows,
                 lattice.tables.patches, lattice.tables.rows, lattice.tables.columns, lattice.texels.x,
                 lattice.texels.y, lattice.texels.z, points.x, points.y, points.z);
}

DevicePlanes row_points(ClContext& context, const SkeletexModel& model, const SeparationPlanes& separation) {
  const DeviceLattice lattice =
      upload_lattice(context, frame_tables(model.skeleton, separation, model.patches, model.origin), model.patches,
                     model.texture, RowChoice::kAll);
  DevicePlanes points = allocate_planes(context, lattice.vertex_count);
  displace(context, lattice, points);
  return points;
}

}  // namespace skeletex
