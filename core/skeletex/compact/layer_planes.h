// SPDX-License-Identifier: MIT
#pragma once
#include <vector>

#include "skeletex/compact/compact_model.h"
#include "skeletex/model/texture.h"

namespace skeletex {

/// Values of a plane at a patch's grid, rows 0 to `intervals`, columns periodic; in 64ths of the layer's step.
struct PlaneGrid {
  int intervals = 0, columns = 0;
  std::vector<int> values;
  int index(int row, int column) const { return row * columns + column % columns; }
};

/// The coarse grid.
/// \pre the plane is not empty
PlaneGrid coarse_plane(const CompactPatch& patch, const CompactPlane& plane);

/// New values of a step, halfway between their parents: between columns row by row, or rows between rows.
std::vector<int> halfway_values(const PlaneGrid& grid, bool refines_rows);
/// The grid with new values added.
PlaneGrid refined_plane(const PlaneGrid& grid, bool refines_rows, const std::vector<int>& added);

/// Adds the layers, and the bone weights, to a model whose patches are those of the compact one, at any size.
void decode_layers(SkeletexModel& model, const CompactModel& compact);

/// How many planes all layers have, the bone weights among them.
int plane_count(const CompactModel& compact);

}  // namespace skeletex
