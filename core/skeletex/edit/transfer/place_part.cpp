// SPDX-License-Identifier: MIT
#include "skeletex/edit/transfer/place_part.h"

#include <cmath>
#include <numbers>

namespace skeletex {
namespace {

TransferParameters parameters_of(const TransferTables& tables) {
  TransferParameters parameters{};
  parameters.row_count = static_cast<int>(tables.rows.size());
  parameters.column_count = static_cast<int>(tables.columns.size());
  parameters.point_count = static_cast<int>(tables.point_count);
  return parameters;
}

}  // namespace

DevicePlanes place_part(ClContext& context, const TransferTables& tables, const DevicePlanes& source,
                        const DevicePlanes& target) {
  DevicePlanes points = allocate_planes(context, tables.point_count);
  TransferParameters parameters = parameters_of(tables);
  parameters.source_count = static_cast<int>(source.count);
  parameters.target_count = static_cast<int>(target.count);
  context.launch({"transfer.cl", "place_part"}, row_range(context, tables.rows.size()), parameters,
                 context.upload(tables.rows), context.upload(tables.patches), context.upload(tables.columns),
                 context.upload(tables.corrections), source.values, target.values, points.values);
  return points;
}

DevicePlanes read_source(ClContext& context, const TransferTables& tables, const DevicePlanes& points) {
  DevicePlanes read = allocate_planes(context, tables.point_count);
  TransferParameters parameters = parameters_of(tables);
  parameters.source_count = static_cast<int>(points.count);
  context.launch({"transfer.cl", "read_source"}, row_range(context, tables.rows.size()), parameters,
                 context.upload(tables.rows), context.upload(tables.patches), context.upload(tables.columns),
                 points.values, read.values);
  return read;
}

void keep_target(ClContext& context, const TransferTables& tables, const DevicePlanes& target, DevicePlanes& texels) {
  TransferParameters parameters = parameters_of(tables);
  parameters.target_count = static_cast<int>(target.count);
  context.launch({"transfer.cl", "keep_target"}, row_range(context, tables.rows.size()), parameters,
                 context.upload(tables.rows), context.upload(tables.patches), context.upload(tables.columns),
                 target.values, texels.values);
}

std::array<std::vector<double>, SKELETEX_TRANSFER_BANDS> wave_bands(const std::vector<double>& values) {
  const std::size_t count = values.size();
  std::array<std::vector<double>, SKELETEX_TRANSFER_BANDS> bands;
  std::vector<double> rest = values;
  std::vector<double> cosines(count), sines(count);
  for (std::size_t i = 0; i < count; ++i) {
    cosines[i] = std::cos(2 * std::numbers::pi * static_cast<double>(i) / static_cast<double>(count));
    sines[i] = std::sin(2 * std::numbers::pi * static_cast<double>(i) / static_cast<double>(count));
  }
  std::size_t wave = 0;
  for (int band = 0; band + 1 < SKELETEX_TRANSFER_BANDS; ++band) {
    bands[band].assign(count, 0);
    for (const std::size_t up_to = std::size_t{2} << band; wave <= up_to && 2 * wave < count; ++wave) {
      double even = 0, odd = 0;
      for (std::size_t i = 0; i < count; ++i) {
        even += values[i] * cosines[wave * i % count];
        odd += values[i] * sines[wave * i % count];
      }
      const double weight = (wave == 0 ? 1.0 : 2.0) / static_cast<double>(count);
      for (std::size_t i = 0; i < count; ++i)
        bands[band][i] += weight * (even * cosines[wave * i % count] + odd * sines[wave * i % count]);
    }
    for (std::size_t i = 0; i < count; ++i) rest[i] -= bands[band][i];
  }
  bands.back() = std::move(rest);
  return bands;
}

}  // namespace skeletex
