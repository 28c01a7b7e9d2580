// SPDX-License-Identifier: MIT
#include "skeletex/convert/resample/resample_layers.h"

#include <algorithm>

#include "skeletex/convert/resample/filter_taps.h"
#include "skeletex/geometry/parallel.h"
#include "skeletex/reconstruct/layers/layer_values.h"

namespace skeletex {

std::vector<float> resample_plane(std::span<const float> values, const SkeletexModel& model,
                                  const SkeletexModel& result) {
  std::vector<float> filtered(static_cast<std::size_t>(result.texture.width) * result.texture.height, 0.f);
  for_each_index(model.patches.size(), [&](std::size_t bone) {
    const Rectangle &from = model.patches[bone].rectangle, &to = result.patches[bone].rectangle;
    const auto taps = [](int old_count, int new_count, bool is_periodic) {
      return filter_taps(old_count, new_count, is_periodic,
                         new_count < old_count ? ResampleFilter::kAverage : ResampleFilter::kLinear, 0);
    };
    const FilterTaps rows = taps(from.height, to.height, false), columns = taps(from.width, to.width, true);
    std::vector<float> line(from.width);  // a new row of old columns
    for (int row = 0; row < to.height; ++row) {
      std::fill(line.begin(), line.end(), 0.f);
      for (int k = 0; k < rows.taps[row][1]; ++k) {
        const float weight = rows.weights[rows.taps[row][2] + k];
        const float* old =
            values.data() + static_cast<std::size_t>(from.y + rows.taps[row][0] + k) * model.texture.width + from.x;
        for (int j = 0; j < from.width; ++j) line[j] += weight * old[j];
      }
      float* made = filtered.data() + static_cast<std::size_t>(to.y + row) * result.texture.width + to.x;
      for (int j = 0; j < to.width; ++j)
        for (int k = 0; k < columns.taps[j][1]; ++k)
          made[j] += columns.weights[columns.taps[j][2] + k] * line[(columns.taps[j][0] + k) % from.width];
    }
  });
  return filtered;
}

void resample_layers(const PreparedModel& prepared, SkeletexModel& result) {
  const PreparedModel made(result);
  for (Layer& layer : result.layers) {
    if (layer.kind != LayerKind::kNormal) {
      for (std::vector<float>& plane : layer.planes) plane = resample_plane(plane, prepared.model, result);
      continue;
    }
    const std::vector<Eigen::Vector3f> old = texel_normals(prepared, layer);
    std::vector<Eigen::Vector3f> normals(static_cast<std::size_t>(result.texture.width) * result.texture.height);
    std::vector<float> plane(old.size());
    for (int axis = 0; axis < 3; ++axis) {
      for (std::size_t i = 0; i < old.size(); ++i) plane[i] = old[i][axis];
      const std::vector<float> filtered = resample_plane(plane, prepared.model, result);
      for (std::size_t i = 0; i < normals.size(); ++i) normals[i][axis] = filtered[i];
    }
    layer.planes = normal_layer(made, normals).planes;
  }
}

}  // namespace skeletex
