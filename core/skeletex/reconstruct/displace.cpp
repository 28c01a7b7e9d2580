// SPDX-License-Identifier: MIT
#include "skeletex/reconstruct/displace.h"

#include <algorithm>

namespace skeletex {

std::vector<RowItem> row_items(const std::vector<Patch>& patches, RowChoice choice) {
  const int margin = choice == RowChoice::kInner ? 1 : 0;
  std::vector<RowItem> items;
  int vertex = 0;
  for (int bone = 0; bone < static_cast<int>(patches.size()); ++bone) {
    const Rectangle& rectangle = patches[bone].rectangle;
    for (int row = margin; row < rectangle.height - margin; ++row, vertex += rectangle.width)
      for (int column = 0; column < rectangle.width; column += kItemColumns) items.push_back({bone, row, column, vertex + column});
  }
  return items;
}

DevicePlanes allocate_planes(ClContext& context, std::size_t size) {
  return {context.allocate<float>(size), context.allocate<float>(size), context.allocate<float>(size)};
}

DeviceLattice upload_lattice(ClContext& context, const FrameTables& tables, const std::vector<Patch>& patches, const DisplacementTexture& texture,
                             RowChoice choice) {
  DeviceLattice lattice;
  lattice.texture_width = texture.width;
  lattice.texels = {context.upload(texture.along), context.upload(texture.around), context.upload(texture.out)};
  lattice.patches = context.upload(tables.patches);
  lattice.rows = context.upload(tables.rows);
  lattice.columns = context.upload(tables.columns);
  lattice.items = context.upload(row_items(patches, choice));
  for (const Patch& patch : patches)
    lattice.vertex_count += static_cast<std::size_t>(patch.rectangle.width) * (patch.rectangle.height - (choice == RowChoice::kInner ? 2 : 0));
  return lattice;
}

void displace(ClContext& context, const DeviceLattice& lattice, DevicePlanes& points) {
  context.launch({"reconstruct.cl", "displace"}, {{kItemColumns, lattice.items.size}, {kItemColumns, 1}}, static_cast<int>(lattice.items.size),
                 lattice.texture_width, lattice.items, lattice.patches, lattice.rows, lattice.columns, lattice.texels.x, lattice.texels.y,
                 lattice.texels.z, points.x, points.y, points.z);
}

}  // namespace skeletex
