// SPDX-License-Identifier: MIT
#include "skeletex/edit/transfer/blend.h"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>

namespace skeletex {
namespace {

/// A column that is another one's own to the accuracy of seams is that one, so that its texels come out bit by bit.
double snapped(double column) { return std::abs(column - std::round(column)) < 1e-3 ? std::round(column) : column; }

/// Values around a bone, smoothed.
std::vector<double> evened(const std::vector<double>& values) {
  constexpr double kWidth = 0.05;  // turns
  const int count = static_cast<int>(values.size()),
            reach = std::min((count - 1) / 2, static_cast<int>(std::ceil(3 * kWidth * count)));
  std::vector<double> shares;
  double total = 0;
  for (int k = -reach; k <= reach; ++k)
    total += shares.emplace_back(std::exp(-0.5 * std::pow(k / (kWidth * count), 2)));
  // Once round and `reach` more on either side, so that every value is one scalar product of plain arrays: a live morph
  // does this for all columns of all bones in every frame.
  std::vector<double> around(values.end() - reach, values.end());
  around.insert(around.end(), values.begin(), values.end());
  around.insert(around.end(), values.begin(), values.begin() + reach);
  const Eigen::Map<const Eigen::VectorXd> share(shares.data(), 2 * reach + 1);
  std::vector<double> result;
  for (int j = 0; j < count; ++j)
    result.push_back(share.dot(Eigen::Map<const Eigen::VectorXd>(around.data() + j, 2 * reach + 1)) / total);
  return result;
}

/// The source's v at each column of the result, at head and tail, any lift; the two without whole turns between them.
std::array<std::vector<double>, 2> places_of_columns(const Overlay& overlay, int bone, int width) {
  std::array<std::vector<double>, 2> places;
  double twist = 0;
  for (int j = 0; j < width; ++j) {
    for (const BoneEnd end : {BoneEnd::kHead, BoneEnd::kTail})
      places[static_cast<int>(end)].push_back(overlay.model_v(bone, end, static_cast<double>(j) / width));
    twist += (places[1][j] - places[0][j]) / width;
  }
  for (double& place : places[1]) place -= std::round(twist);
  return places;
}

int source_columns(const Overlay& overlay, int bone) {
  return overlay.model().patches[overlay.model_bone(bone)].rectangle.width;
}

}  // namespace

void append_columns(const Overlay& overlay, int bone, int width, std::vector<float>& head_columns,
                    std::vector<float>& tail_columns) {
  const auto places = places_of_columns(overlay, bone, width);
  for (int j = 0; j < width; ++j) {
    head_columns.push_back(static_cast<float>(snapped(source_columns(overlay, bone) * places[0][j])));
    tail_columns.push_back(static_cast<float>(snapped(source_columns(overlay, bone) * places[1][j])));
  }
}

void append_columns(const Overlay& overlay, int bone, int width, BlendTables& tables) {
  const auto places = places_of_columns(overlay, bone, width);
  const double sign = overlay.is_reversed(bone) ? -1 : 1;
  std::array<std::vector<double>, 2> even;
  for (const int end : {0, 1}) {
    std::vector<double> offsets;
    for (int j = 0; j < width; ++j) offsets.push_back(places[end][j] - sign * j / width);
    even[end] = evened(offsets);
  }
  const auto column = [&](double v) { return static_cast<float>(snapped(source_columns(overlay, bone) * v)); };
  for (int j = 0; j < width; ++j) {
    const double turn = sign * j / width;
    tables.columns.push_back(
        {column(places[0][j]), column(even[0][j] + turn), column(places[1][j]), column(even[1][j] + turn), 0, 0, 0, 0});
  }
}

void append_turned_columns(const Overlay& overlay, const SeparationPlanes& separation, int bone, int width,
                           BlendSource& source, BlendTables& tables) {
  append_columns(overlay, bone, width, tables);
  source.slope_begin = static_cast<int>(tables.slopes.size() / 2);
  std::array<std::vector<double>, 2> rises, even, owns;
  for (const int end : {0, 1}) {
    const auto at = static_cast<BoneEnd>(end);
    std::vector<double> own;
    for (int j = 0; j < source.width; ++j)
      own.push_back(overlay.slope_at(bone, at, static_cast<double>(j) / source.width));
    for (int j = 0; j < width; ++j) {
      // As the kernel reads them, so that the rise leads to the result's slope exactly.
      const BlendColumn& column = tables.columns[tables.columns.size() - width + j];
      const double place = end == 0 ? column.head : column.tail, left = std::floor(place);
      const auto own_at = [&](double x) {
        return own[static_cast<int>(x - source.width * std::floor(x / source.width)) % source.width];
      };
      rises[end].push_back(separation.slope(bone, at, static_cast<double>(j) / width) -
                           (1 - (place - left)) * own_at(left) - (place - left) * own_at(left + 1));
    }
    even[end] = evened(rises[end]);
    owns[end] = std::move(own);
  }
  for (int j = 0; j < source.width; ++j)
    for (const int end : {0, 1}) tables.slopes.push_back(static_cast<float>(owns[end][j]));
  BlendColumn* column = tables.columns.data() + tables.columns.size() - width;
  for (int j = 0; j < width; ++j, ++column) {
    column->head_rise = static_cast<float>(rises[0][j]);
    column->even_head_rise = static_cast<float>(even[0][j]);
    column->tail_rise = static_cast<float>(rises[1][j]);
    column->even_tail_rise = static_cast<float>(even[1][j]);
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

void blend_texels(ClContext& context, const BlendTables& tables, const std::vector<LatticeRow>& rows,
                  const FrameTables& result, int texture_width, const DevicePlanes& texels, DevicePlanes& blended) {
  std::vector<float> slopes = tables.slopes;
  if (slopes.empty()) slopes.assign(2, 0.f);
  context.launch({"blend.cl", "blend_texels"}, row_range(context, rows.size()), static_cast<int>(rows.size()),
                 tables.source_count, static_cast<int>(result.patches.size()), texture_width, context.upload(rows),
                 context.upload(result.patches), context.upload(result.rows), context.upload(tables.sources),
                 context.upload(tables.rows), context.upload(tables.columns), context.upload(slopes),
                 context.upload(result.columns), static_cast<int>(texels.count), texels.values,
                 static_cast<int>(blended.count), blended.values);
}

void mix_texels(ClContext& context, const DevicePlanes& first, const DevicePlanes& second, double share,
                int texture_width, DevicePlanes& mixed) {
  if (mixed.count != first.count) mixed = allocate_planes(context, first.count);
  const int height = static_cast<int>(first.count / texture_width);
  context.launch({"blend.cl", "mix_texels"}, row_range(context, height), height, texture_width,
                 static_cast<float>(share), first.values, second.values, mixed.values);
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
  context.launch({"blend.cl", "move_ends"}, row_range(context, rows.size()), static_cast<int>(rows.size()),
                 texture_width, static_cast<int>(moves.planes[0][0].size()), context.upload(rows),
                 context.upload(result.patches), context.upload(result.rows), context.upload(all),
                 static_cast<int>(texels.count), texels.values);
}

}  // namespace skeletex
