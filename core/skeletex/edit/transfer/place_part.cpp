// SPDX-License-Identifier: MIT
#include "skeletex/edit/transfer/place_part.h"

#include <cmath>
#include <numbers>

#include "skeletex/skeleton/separation_planes.h"

namespace skeletex {
namespace {

TransferParameters parameters_of(const TransferTables& tables) {
  return {static_cast<int>(tables.rows.size()), static_cast<int>(tables.columns.size())};
}

}  // namespace

DevicePlanes points_in_bone_axes(ClContext& context, const SkeletexModel& model) {
  const SeparationPlanes separation(model.skeleton);
  const FrameTables tables = in_bone_axes(frame_tables(model.skeleton, separation, model.patches, model.origin));
  const DeviceLattice lattice = upload_lattice(context, tables, model.patches, model.texture, RowChoice::kAll);
  DevicePlanes points = allocate_planes(context, lattice.vertex_count);
  displace(context, lattice, points);
  return points;
}

DevicePlanes place_part(ClContext& context, const TransferTables& tables, const DevicePlanes& source,
                        const DevicePlanes& target) {
  DevicePlanes points = allocate_planes(context, tables.point_count);
  context.launch({"transfer.cl", "place_part"}, row_range(context, tables.rows.size()), parameters_of(tables),
                 context.upload(tables.rows), context.upload(tables.patches), context.upload(tables.columns),
                 context.upload(tables.corrections), source.x, source.y, source.z, target.x, target.y, target.z,
                 points.x, points.y, points.z);
  return points;
}

DevicePlanes read_source(ClContext& context, const TransferTables& tables, const DevicePlanes& points) {
  DevicePlanes read = allocate_planes(context, tables.point_count);
  context.launch({"transfer.cl", "read_source"}, row_range(context, tables.rows.size()), parameters_of(tables),
                 context.upload(tables.rows), context.upload(tables.patches), context.upload(tables.columns), points.x,
                 points.y, points.z, read.x, read.y, read.z);
  return read;
}

void keep_target(ClContext& context, const TransferTables& tables, const DevicePlanes& target, DevicePlanes& texels) {
  context.launch({"transfer.cl", "keep_target"}, row_range(context, tables.rows.size()), parameters_of(tables),
                 context.upload(tables.rows), context.upload(tables.patches), context.upload(tables.columns), target.x,
                 target.y, target.z, texels.x, texels.y, texels.z);
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
