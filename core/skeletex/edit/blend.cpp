// SPDX-License-Identifier: MIT
#include "skeletex/edit/blend.h"

#include <algorithm>
#include <cmath>

namespace skeletex {

void append_columns(const Overlay& overlay, int bone, int width, BlendTables& tables) {
  std::vector<double> head(width), tail(width);
  double twist = 0;
  for (int j = 0; j < width; ++j) {
    const double turn = static_cast<double>(j) / width;
    head[j] = overlay.model_turn(bone, BoneEnd::kHead, turn);
    tail[j] = overlay.model_turn(bone, BoneEnd::kTail, turn);
    twist += (tail[j] - head[j]) / width;
  }
  // Angles have no whole turns: between the ends the shorter way.
  const double whole = std::round(twist), columns = overlay.model().patches[overlay.model_bone(bone)].rectangle.width;
  for (int j = 0; j < width; ++j) {
    tables.head_columns.push_back(static_cast<float>(columns * head[j]));
    tables.tail_columns.push_back(static_cast<float>(columns * (tail[j] - whole)));
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
  context.launch({"blend.cl", "blend_texels"}, row_range(context, rows.size()), static_cast<int>(rows.size()), tables.source_count,
                 static_cast<int>(result.patches.size()), texture_width, static_cast<int>(tables.head_columns.size()), context.upload(rows),
                 context.upload(result.patches), context.upload(result.rows), context.upload(tables.sources), context.upload(tables.rows),
                 context.upload(columns), texels.x, texels.y, texels.z, blended.x, blended.y, blended.z);
}

}  // namespace skeletex
