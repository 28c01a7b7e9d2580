// SPDX-License-Identifier: MIT
#include "skeletex/edit/blend.h"

#include <algorithm>
#include <cmath>

namespace skeletex {
namespace {

/// A column that is another one's own to the accuracy of seams is that one, so that its texels come out bit by bit.
double snapped(double column) { return std::abs(column - std::round(column)) < 1e-3 ? std::round(column) : column; }

}  // namespace

void append_columns(const Overlay& overlay, int bone, int width, std::vector<float>& head_columns, std::vector<float>& tail_columns) {
  std::vector<double> head(width), tail(width);
  double twist = 0;
  for (int j = 0; j < width; ++j) {
    const double turn = static_cast<double>(j) / width;
    head[j] = overlay.model_v(bone, BoneEnd::kHead, turn);
    tail[j] = overlay.model_v(bone, BoneEnd::kTail, turn);
    twist += (tail[j] - head[j]) / width;
  }
  // Angles have no whole turns: between the ends the shorter way.
  const double whole = std::round(twist), columns = overlay.model().patches[overlay.model_bone(bone)].rectangle.width;
  for (int j = 0; j < width; ++j) {
    head_columns.push_back(static_cast<float>(snapped(columns * head[j])));
    tail_columns.push_back(static_cast<float>(snapped(columns * (tail[j] - whole))));
  }
}

void append_slope_growths(const Overlay& overlay, const Walls& walls, int bone, int width, BlendTables& tables) {
  for (int j = 0; j < width; ++j) {
    const double turn = static_cast<double>(j) / width;
    const double growth = overlay.slope(bone, BoneEnd::kTail, turn) - overlay.slope(bone, BoneEnd::kHead, turn) -
                          (walls.slope(bone, BoneEnd::kTail, turn) - walls.slope(bone, BoneEnd::kHead, turn));
    tables.slope_growths.push_back(std::abs(growth) < 1e-5 ? 0.f : static_cast<float>(growth));
  }
}

double row_at_same_share(int row, int height, int source_height, bool is_reversed) {
  const double at = static_cast<double>(row) * (source_height - 1) / (height - 1);
  return is_reversed ? source_height - 1 - at : at;
}

double u_at_row(const Patch& patch, double row) {
  const int below = std::clamp(static_cast<int>(row), 0, static_cast<int>(patch.row_u.size()) - 2);
  return patch.row_u[below] + (row - below) * (patch.row_u[below + 1] - patch.row_u[below]);
}

void blend_texels(ClContext& context, const BlendTables& tables, const std::vector<LatticeRow>& rows, const FrameTables& result, int texture_width,
                  const DevicePlanes& texels, DevicePlanes& blended) {
  std::vector<float> columns = tables.head_columns;
  columns.insert(columns.end(), tables.tail_columns.begin(), tables.tail_columns.end());
  columns.insert(columns.end(), tables.slope_growths.begin(), tables.slope_growths.end());
  columns.resize(3 * tables.head_columns.size(), 0.f);
  context.launch({"blend.cl", "blend_texels"}, row_range(context, rows.size()), static_cast<int>(rows.size()), tables.source_count,
                 static_cast<int>(result.patches.size()), texture_width, static_cast<int>(tables.head_columns.size()), context.upload(rows),
                 context.upload(result.patches), context.upload(result.rows), context.upload(tables.sources), context.upload(tables.rows),
                 context.upload(columns), context.upload(result.columns), texels.x, texels.y, texels.z, blended.x, blended.y, blended.z);
}

void EndMoves::add(BoneEnd end, const Vec3& move) {
  for (int i = 0; i < 3; ++i) planes[static_cast<int>(end)][i].push_back(static_cast<float>(move[i]));
  if (!move.isZero(0)) is_empty = false;
}

void move_ends(ClContext& context, const EndMoves& moves, const std::vector<LatticeRow>& rows, const FrameTables& result, int texture_width,
               DevicePlanes& texels) {
  if (moves.is_empty) return;
  std::vector<float> all;
  for (const auto& end : moves.planes)
    for (const std::vector<float>& plane : end) all.insert(all.end(), plane.begin(), plane.end());
  context.launch({"blend.cl", "move_ends"}, row_range(context, rows.size()), static_cast<int>(rows.size()), texture_width,
                 static_cast<int>(moves.planes[0][0].size()), context.upload(rows), context.upload(result.patches), context.upload(result.rows),
                 context.upload(all), texels.x, texels.y, texels.z);
}

}  // namespace skeletex
