// SPDX-License-Identifier: MIT
#include "skeletex/edit/morph/blend.h"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>

namespace skeletex {
namespace {

/// A column rounded to a whole one when it is as near as the accuracy of seams, so that texels are read bit by bit.
double rounded_column(double column) {
  return std::abs(column - std::round(column)) < 1e-3 ? std::round(column) : column;
}

/// Values around a bone, convolved with a Gaussian.
std::vector<double> smoothed_around(const std::vector<double>& values) {
  constexpr double kWidth = 0.05;  // turns
  const int count = static_cast<int>(values.size()),
            radius = std::min((count - 1) / 2, static_cast<int>(std::ceil(3 * kWidth * count)));
  std::vector<double> shares;
  double total = 0;
  for (int k = -radius; k <= radius; ++k)
    total += shares.emplace_back(std::exp(-0.5 * std::pow(k / (kWidth * count), 2)));
  // With `radius` values more on either side, every result is one scalar product of plain arrays: a live morph smooths
  // the columns of all bones in every frame.
  std::vector<double> around(values.end() - radius, values.end());
  around.insert(around.end(), values.begin(), values.end());
  around.insert(around.end(), values.begin(), values.begin() + radius);
  const Eigen::Map<const Eigen::VectorXd> share(shares.data(), 2 * radius + 1);
  std::vector<double> result(count);
  for (int j = 0; j < count; ++j)
    result[j] = share.dot(Eigen::Map<const Eigen::VectorXd>(around.data() + j, 2 * radius + 1)) / total;
  return result;
}

/// The model's v at each column of the result, at head and tail, with no whole turn between the two.
std::array<std::vector<double>, 2> places_of_columns(const SeamMap& map, BoneIndex bone, int width) {
  std::array<std::vector<double>, 2> places;
  double twist = 0;
  for (int j = 0; j < width; ++j) {
    for (const BoneEnd end : {BoneEnd::kHead, BoneEnd::kTail})
      places[static_cast<int>(end)].push_back(map.model_v(bone, end, static_cast<double>(j) / width));
    twist += (places[1][j] - places[0][j]) / width;
  }
  for (double& place : places[1]) place -= std::round(twist);
  return places;
}

/// The row of a patch of `model_height` rows at the same share of its height as a row of a patch of `height` rows.
double row_at_same_share(int row, int height, int model_height, bool is_reversed) {
  const double at = static_cast<double>(row) * (model_height - 1) / (height - 1);
  return is_reversed ? model_height - 1 - at : at;
}

int source_columns(const SeamMap& map, BoneIndex bone) {
  return map.model().patches[map.model_bone(bone)].rectangle.width;
}

/// The rows to do as the kernels take them.
std::vector<BlendRow> blend_rows(const std::vector<LatticeRow>& rows, const FrameTables& result, int texture_width) {
  std::vector<BlendRow> blend;
  for (const auto& [bone, row, vertex, quad] : rows) {
    const PatchRecord& patch = result.patches[bone];
    const RowRecord& record = result.rows[patch.row_begin + row];
    blend.push_back(
        {bone, (patch.y + row) * texture_width + patch.x, patch.width, patch.column_begin, record.u, record.axial});
  }
  return blend;
}

}  // namespace

std::array<std::vector<float>, 2> model_columns(const SeamMap& map, BoneIndex bone, int width) {
  const auto places = places_of_columns(map, bone, width);
  std::array<std::vector<float>, 2> columns;
  for (const int end : {0, 1})
    for (const double v : places[end])
      columns[end].push_back(static_cast<float>(rounded_column(source_columns(map, bone) * v)));
  return columns;
}

void append_columns(const SeamMap& map, BoneIndex bone, int width, BlendTables& tables) {
  const auto places = places_of_columns(map, bone, width);
  const double sign = map.sign(bone);
  std::array<std::vector<double>, 2> even;
  for (const int end : {0, 1}) {
    std::vector<double> offsets(width);
    for (int j = 0; j < width; ++j) offsets[j] = places[end][j] - sign * j / width;
    even[end] = smoothed_around(offsets);
  }
  const auto column = [&](double v) { return static_cast<float>(rounded_column(source_columns(map, bone) * v)); };
  for (int j = 0; j < width; ++j) {
    const double turn = sign * j / width;
    tables.columns.push_back(
        {column(places[0][j]), column(even[0][j] + turn), column(places[1][j]), column(even[1][j] + turn), 0, 0, 0, 0});
  }
}

void append_turned_columns(const SeamMap& map, const SeparationPlanes& separation, BoneIndex bone, int width,
                           BlendSource& source, BlendTables& tables) {
  append_columns(map, bone, width, tables);
  source.slope_begin = static_cast<int>(tables.slopes.size() / 2);
  std::array<std::vector<double>, 2> rises, even, slopes;
  BlendColumn* column = tables.columns.data() + tables.columns.size() - width;
  for (const int end : {0, 1}) {
    const auto at = static_cast<BoneEnd>(end);
    for (int j = 0; j < source.width; ++j)
      slopes[end].push_back(map.model_slope(bone, at, static_cast<double>(j) / source.width));
    const auto slope_of = [&](double x) {
      return slopes[end][static_cast<int>(x - source.width * std::floor(x / source.width)) % source.width];
    };
    for (int j = 0; j < width; ++j) {
      // Interpolated as in the kernel, so that the rise leads to the result's slope exactly.
      const double place = end == 0 ? column[j].head : column[j].tail, left = std::floor(place);
      rises[end].push_back(separation.slope(bone, at, static_cast<double>(j) / width) -
                           (1 - (place - left)) * slope_of(left) - (place - left) * slope_of(left + 1));
    }
    even[end] = smoothed_around(rises[end]);
  }
  for (int j = 0; j < source.width; ++j)
    for (const int end : {0, 1}) tables.slopes.push_back(static_cast<float>(slopes[end][j]));
  for (int j = 0; j < width; ++j, ++column) {
    column->head_rise = static_cast<float>(rises[0][j]);
    column->even_head_rise = static_cast<float>(even[0][j]);
    column->tail_rise = static_cast<float>(rises[1][j]);
    column->even_tail_rise = static_cast<float>(even[1][j]);
  }
}

void append_rows(const SeamMap& map, const std::vector<LatticeRow>& rows, const std::vector<Patch>& patches,
                 double weight, BlendTables& tables) {
  for (const auto& [bone, row, vertex, quad] : rows) {
    const int height = map.model().patches[map.model_bone(bone)].rectangle.height;
    const double at = row_at_same_share(row, patches[bone].rectangle.height, height, map.is_reversed(bone));
    tables.source_rows.push_back({static_cast<float>(at), static_cast<float>(weight)});
  }
}

double u_at_same_share(const Patch& model, int row, int height, bool is_reversed) {
  const double at = row_at_same_share(row, height, model.rectangle.height, is_reversed);
  const int below = std::clamp(static_cast<int>(at), 0, static_cast<int>(model.row_u.size()) - 2);
  const double u = model.row_u[below] + (at - below) * (model.row_u[below + 1] - model.row_u[below]);
  return is_reversed ? 1 - u : u;
}

void blend_texels(ClContext& context, const BlendTables& tables, const std::vector<LatticeRow>& rows,
                  const FrameTables& result, int texture_width, const DevicePlanes& texels, DevicePlanes& blended) {
  std::vector<float> slopes = tables.slopes;
  if (slopes.empty()) slopes.assign(2, 0.f);
  const BlendParameters parameters{static_cast<int>(rows.size()), tables.source_count,
                                   static_cast<int>(result.patches.size()), static_cast<int>(texels.count),
                                   static_cast<int>(blended.count)};
  context.launch({"blend.cl", "blend_texels"}, row_range(context, rows.size()), parameters,
                 context.upload(blend_rows(rows, result, texture_width)), context.upload(tables.sources),
                 context.upload(tables.source_rows), context.upload(tables.columns), context.upload(slopes),
                 context.upload(result.columns), texels.values, blended.values);
}

void mix_texels(ClContext& context, const DevicePlanes& first, const DevicePlanes& second, double share,
                int texture_width, DevicePlanes& mixed) {
  if (mixed.count != first.count) mixed = allocate_planes(context, first.count);
  const int height = static_cast<int>(first.count / texture_width);
  context.launch({"blend.cl", "mix_texels"}, row_range(context, height),
                 MixParameters{height, texture_width, static_cast<float>(share)}, first.values, second.values,
                 mixed.values);
}

void EndMoves::add(BoneEnd end, const Vec3& move) {
  for (int i = 0; i < 3; ++i) planes[static_cast<int>(end)][i].push_back(static_cast<float>(move[i]));
  if (!move.isZero(0)) is_empty = false;
}

void move_ends(ClContext& context, const EndMoves& moves, const std::vector<LatticeRow>& rows,
               const FrameTables& result, int texture_width, DevicePlanes& texels) {
  if (moves.is_empty) return;
  std::vector<float> all;
  for (const auto& end : moves.planes)
    for (const std::vector<float>& plane : end) all.insert(all.end(), plane.begin(), plane.end());
  context.launch({"blend.cl", "move_ends"}, row_range(context, rows.size()),
                 MoveEndsParameters{static_cast<int>(rows.size()), static_cast<int>(moves.planes[0][0].size()),
                                    static_cast<int>(texels.count)},
                 context.upload(blend_rows(rows, result, texture_width)), context.upload(all), texels.values);
}

}  // namespace skeletex
