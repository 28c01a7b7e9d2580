// SPDX-License-Identifier: MIT
#pragma once
#include <array>
#include <vector>

#include "skeletex/cl/context.h"
#include "skeletex/model/frame.h"
#include "skeletex/model/texture.h"

namespace skeletex {

/// A piece of a lattice row: patch, row, first column, number of its first vertex (see kernels/reconstruct.cl).
using RowItem = std::array<int, 4>;
/// Columns of a piece at most. Small enough that rows which are no multiple of it waste little.
inline constexpr int kItemColumns = 64;

enum class RowChoice { kAll, kInner };  ///< kInner leaves out rows 0 and height-1

/// The pieces of the chosen rows of every patch. Vertices are numbered patch by patch, row by row.
std::vector<RowItem> row_items(const std::vector<Patch>& patches, RowChoice choice);

/// Three planes of floats on the device.
struct DevicePlanes {
  ClBuffer<float> x, y, z;
};
DevicePlanes allocate_planes(ClContext& context, std::size_t size);

/// What the device needs to turn texels into points: texels, tables and the rows to do.
struct DeviceLattice {
  int texture_width = 0;
  std::size_t vertex_count = 0;
  DevicePlanes texels;  ///< along, around, out
  ClBuffer<PatchRecord> patches;
  ClBuffer<RowRecord> rows;
  ClBuffer<ColumnRecord> columns;
  ClBuffer<RowItem> items;
};
DeviceLattice upload_lattice(ClContext& context, const FrameTables& tables, const std::vector<Patch>& patches, const DisplacementTexture& texture,
                             RowChoice choice);

/// Queues the points of all items (one launch), relative to the origin of the tables.
void displace(ClContext& context, const DeviceLattice& lattice, DevicePlanes& points);

}  // namespace skeletex
