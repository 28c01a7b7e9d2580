// SPDX-License-Identifier: MIT
#include "skeletex/compact/encode/encode_layers.h"

#include <algorithm>
#include <cmath>

#include "skeletex/compact/encode/rounding.h"
#include "skeletex/compact/layer_planes.h"
#include "skeletex/geometry/parallel.h"

namespace skeletex {
namespace {

/// Residuals of colours below kLeastKept steps are dropped in the kSparseLevels finest levels. Most of them lie at
/// edges of the picture, where they are not seen.
constexpr int kSparseLevels = 4, kLeastKept = 3;

/// A layer, or the weights, with the planes that it is made from.
struct Source {
  CompactLayer layer;
  const std::vector<std::vector<float>>* planes;
};

std::vector<Source> sources_of(const SkeletexModel& model, int steps) {
  std::vector<Source> sources;
  for (const Layer& layer : model.layers) {
    if (layer.kind == LayerKind::kNormal) continue;
    CompactLayer code{layer.name, static_cast<int>(layer.planes.size()), false, 0, 1.0 / steps};
    if (!code.is_colour()) {
      float least = INFINITY, most = -INFINITY;
      for (const std::vector<float>& plane : layer.planes)
        for (const Patch& patch : model.patches)
          for (int row = 0; row < patch.rectangle.height; ++row) {
            const auto first = plane.begin() +
                               static_cast<std::ptrdiff_t>(patch.rectangle.y + row) * model.texture.width +
                               patch.rectangle.x;
            const auto [low, high] = std::minmax_element(first, first + patch.rectangle.width);
            least = std::min(least, *low), most = std::max(most, *high);
          }
      code.offset = least;
      code.step = most > least ? (static_cast<double>(most) - least) / steps : 1;
    }
    sources.push_back({code, &layer.planes});
  }
  if (!model.bone_weights.empty())
    sources.push_back({{"", static_cast<int>(model.bone_weights.size()), true, 0, 1.0 / steps}, &model.bone_weights});
  return sources;
}

/// Values at places of a patch, in steps.
class PatchValues {
 public:
  PatchValues(const SkeletexModel& model, const Source& source, BoneIndex bone)
      : source_(source), rectangle_(model.patches[bone].rectangle), width_(model.texture.width) {}

  std::vector<std::vector<double>> at(const std::vector<Place>& places) const {
    std::vector<std::vector<double>> values(source_.planes->size(), std::vector<double>(places.size()));
    for (std::size_t i = 0; i < places.size(); ++i) {
      for (std::size_t k = 0; k < values.size(); ++k) values[k][i] = sample((*source_.planes)[k], places[i]);
      if (source_.layer.is_bone_weights) normalize(values, i);
      if (source_.layer.is_colour()) {
        for (int k = 0; k < 3; ++k) values[k][i] = std::sqrt(std::max(values[k][i], 0.0));
        values[0][i] -= values[1][i], values[2][i] -= values[1][i];
      }
      for (std::vector<double>& plane : values) plane[i] = (plane[i] - source_.layer.offset) / source_.layer.step;
    }
    return values;
  }

 private:
  double texel(const std::vector<float>& plane, int row, int column) const {
    return plane[static_cast<std::size_t>(rectangle_.y + row) * width_ + rectangle_.x + column];
  }
  double sample(const std::vector<float>& plane, const Place& place) const {
    const auto [r, c, next, s, t] = cell_at(rectangle_.height, rectangle_.width, place);
    return (1 - s) * ((1 - t) * texel(plane, r, c) + t * texel(plane, r, next)) +
           s * ((1 - t) * texel(plane, r + 1, c) + t * texel(plane, r + 1, next));
  }
  static void normalize(std::vector<std::vector<double>>& values, std::size_t i) {
    double sum = 0;
    for (const std::vector<double>& plane : values) sum += plane[i];
    for (std::vector<double>& plane : values) plane[i] = sum > 0 ? plane[i] / sum : 0;
  }

  const Source& source_;
  Rectangle rectangle_;
  int width_;
};

/// \param values  at the finest grid's points, in steps
CompactPlane encode_plane(const CompactPatch& patch, const std::vector<double>& values, bool is_colour,
                          double rounding) {
  CompactPlane plane;
  if (std::all_of(values.begin(), values.end(), [](double v) { return std::abs(v) < 0.5; })) return plane;
  const int row_steps = __builtin_popcount(patch.row_steps), column_steps = patch.step_count - row_steps;
  const int columns = patch.columns << column_steps;
  // A point of a coarse grid is one of the finest.
  int between_rows = 1 << row_steps, between_columns = 1 << column_steps;
  const auto value_at = [&](int row, int column) {
    return values[static_cast<std::size_t>(row) * between_rows * columns +
                  static_cast<std::size_t>(column) * between_columns];
  };
  for (int row = 0; row <= patch.intervals; ++row)
    for (int column = 0; column < patch.columns; ++column) plane.base.push_back(rounded(value_at(row, column)));
  PlaneGrid grid = coarse_plane(patch, plane);
  for (int step = 0; step < patch.step_count; ++step) {
    const bool rows = (patch.row_steps >> step & 1) != 0;
    (rows ? between_rows : between_columns) /= 2;
    const int least = is_colour && step >= patch.step_count - kSparseLevels ? kLeastKept : 1;
    std::vector<int> added = halfway_values(grid, rows), residuals(added.size());
    for (std::size_t i = 0; i < added.size(); ++i) {
      const int row = static_cast<int>(i) / grid.columns, column = static_cast<int>(i) % grid.columns;
      const double value = rows ? value_at(2 * row + 1, column) : value_at(row, 2 * column + 1);
      residuals[i] = rounded_towards_zero(value - added[i] / 64.0, rounding);
      if (std::abs(residuals[i]) < least) residuals[i] = 0;
      added[i] += 64 * residuals[i];
    }
    grid = refined_plane(grid, rows, added);
    if (std::all_of(residuals.begin(), residuals.end(), [](int r) { return r == 0; })) residuals.clear();
    plane.steps.push_back(std::move(residuals));
  }
  return plane;
}

}  // namespace

bool has_coded_layers(const SkeletexModel& model) {
  return !model.bone_weights.empty() || std::any_of(model.layers.begin(), model.layers.end(), [](const Layer& layer) {
    return layer.kind != LayerKind::kNormal;
  });
}

void encode_layers(CompactModel& compact, const SkeletexModel& model, const std::vector<std::vector<Place>>& places,
                   int steps, double rounding) {
  const std::vector<Source> sources = sources_of(model, steps);
  for (const Source& source : sources) compact.layers.push_back(source.layer);
  for_each_index(compact.patches.size(), [&](std::size_t bone) {
    for (const Source& source : sources)
      for (const std::vector<double>& values : PatchValues(model, source, static_cast<int>(bone)).at(places[bone]))
        compact.patches[bone].planes.push_back(
            encode_plane(compact.patches[bone], values, source.layer.is_colour(), rounding));
  });
}

}  // namespace skeletex
