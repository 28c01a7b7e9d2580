// SPDX-License-Identifier: MIT
#include "skeletex/compact/layer_planes.h"

#include <algorithm>
#include <cstdint>
#include <span>

#include "skeletex/compact/patch_grid.h"
#include "skeletex/geometry/parallel.h"

namespace skeletex {
namespace {

constexpr int kMostValue = 1 << 28;  // whatever a damaged file says

int bounded(std::int64_t value) { return static_cast<int>(std::clamp<std::int64_t>(value, -kMostValue, kMostValue)); }

/// A plane of a patch at its size in the model.
PlaneGrid decode_plane(const CompactPatch& patch, const CompactPlane& plane, int width, int height) {
  PlaneGrid grid = coarse_plane(patch, plane);
  for (int step = 0; grid.columns != width || grid.intervals + 1 != height; ++step) {
    const bool rows = step_doubles_rows(patch, step);
    std::vector<int> added = halfway_values(grid, rows);
    if (step < static_cast<int>(plane.steps.size()) && !plane.steps[step].empty())
      for (std::size_t i = 0; i < added.size(); ++i)
        added[i] = bounded(added[i] + std::int64_t{64} * plane.steps[step][i]);
    grid = refined_plane(grid, rows, added);
  }
  return grid;
}

/// What a texel's numbers mean.
/// \param values  per plane
void finish_values(const CompactLayer& layer, std::span<double> values) {
  if (layer.is_bone_weights)
    for (double& value : values) value = std::max(value, 0.0);
  if (!layer.is_colour()) return;
  values[0] += values[1], values[2] += values[1];
  for (double& root : values.first(3)) root = std::max(root, 0.0) * std::max(root, 0.0);
}

/// The planes of a layer, or of the weights, in one patch.
void store_planes(const CompactModel& compact, const CompactLayer& layer, int first_plane, BoneIndex bone,
                  const SkeletexModel& model, std::vector<std::vector<float>>& planes) {
  const Rectangle& r = model.patches[bone].rectangle;
  const CompactPatch& patch = compact.patches[bone];
  std::vector<PlaneGrid> grids;
  for (int k = 0; k < layer.planes; ++k) {
    const CompactPlane& plane = patch.planes[first_plane + k];
    grids.push_back(plane.base.empty() ? PlaneGrid{} : decode_plane(patch, plane, r.width, r.height));
  }
  std::vector<double> values(planes.size());
  for (int i = 0; i < r.width * r.height; ++i) {
    for (std::size_t k = 0; k < planes.size(); ++k)
      values[k] = grids[k].values.empty() ? 0 : layer.offset + layer.step / 64 * grids[k].values[i];
    finish_values(layer, values);
    const std::size_t texel = static_cast<std::size_t>(r.y + i / r.width) * model.texture.width + r.x + i % r.width;
    for (std::size_t k = 0; k < planes.size(); ++k) planes[k][texel] = static_cast<float>(values[k]);
  }
}

}  // namespace

PlaneGrid coarse_plane(const CompactPatch& patch, const CompactPlane& plane) {
  PlaneGrid grid{patch.intervals, patch.columns, {}};
  for (const int value : plane.base) grid.values.push_back(bounded(std::int64_t{64} * value));
  return grid;
}

std::vector<int> halfway_values(const PlaneGrid& grid, bool refines_rows) {
  std::vector<int> values;
  const int rows = refines_rows ? grid.intervals : grid.intervals + 1;
  values.reserve(static_cast<std::size_t>(rows) * grid.columns);
  for (int row = 0; row < rows; ++row)
    for (int column = 0; column < grid.columns; ++column)
      values.push_back((grid.values[grid.index(row, column)] +
                        grid.values[refines_rows ? grid.index(row + 1, column) : grid.index(row, column + 1)]) >>
                       1);
  return values;
}

PlaneGrid refined_plane(const PlaneGrid& grid, bool refines_rows, const std::vector<int>& added) {
  PlaneGrid fine;
  fine.intervals = refines_rows ? 2 * grid.intervals : grid.intervals;
  fine.columns = refines_rows ? grid.columns : 2 * grid.columns;
  fine.values.resize(static_cast<std::size_t>(fine.intervals + 1) * fine.columns);
  for (int row = 0; row <= grid.intervals; ++row)
    for (int column = 0; column < grid.columns; ++column) {
      const int i = grid.index(row, column);
      fine.values[refines_rows ? fine.index(2 * row, column) : fine.index(row, 2 * column)] = grid.values[i];
      if (refines_rows && row == grid.intervals) continue;
      fine.values[refines_rows ? fine.index(2 * row + 1, column) : fine.index(row, 2 * column + 1)] = added[i];
    }
  return fine;
}

int plane_count(const CompactModel& compact) {
  int count = 0;
  for (const CompactLayer& layer : compact.layers) count += layer.planes;
  return count;
}

void decode_layers(SkeletexModel& model, const CompactModel& compact) {
  const std::size_t texels = static_cast<std::size_t>(model.texture.width) * model.texture.height;
  int first_plane = 0;
  for (const CompactLayer& layer : compact.layers) {
    std::vector<std::vector<float>> planes(layer.planes, std::vector<float>(texels, 0));
    for_each_index(model.patches.size(), [&](std::size_t bone) {
      store_planes(compact, layer, first_plane, static_cast<int>(bone), model, planes);
    });
    first_plane += layer.planes;
    if (layer.is_bone_weights)
      model.bone_weights = std::move(planes);
    else
      model.layers.push_back(
          {layer.name, layer.is_colour() ? LayerKind::kColour : LayerKind::kNumber, std::move(planes)});
  }
}

}  // namespace skeletex
