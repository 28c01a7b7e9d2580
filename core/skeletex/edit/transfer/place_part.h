// SPDX-License-Identifier: MIT
#pragma once
#include <array>
#include <vector>

#include "skeletex/reconstruct/displace.h"
#include "transfer_structs.h"

namespace skeletex {

/// What the kernels of transfer.cl read besides points.
struct TransferTables {
  std::vector<TransferRow> rows;        ///< to do
  std::vector<TransferPatch> patches;   ///< per patch of the result
  std::vector<TransferColumn> columns;  ///< of the patches to do
  std::vector<float> corrections;       ///< planes; see place_part in kernels/transfer.cl
  std::size_t point_count = 0;          ///< of all rows to do

  std::size_t correction_size() const { return 2 * 2 * 3 * SKELETEX_TRANSFER_BANDS * columns.size(); }
  float& correction(BoneEnd end, int band, bool is_slope, int axis, std::size_t column) {
    const std::size_t plane =
        ((static_cast<std::size_t>(end) * SKELETEX_TRANSFER_BANDS + band) * 2 + (is_slope ? 1 : 0)) * 3 + axis;
    return corrections[plane * columns.size() + column];
  }
};

/// Queues the kernel.
/// \param source, target  points in bone axes
/// \return points in the axes of the result's bones
DevicePlanes place_part(ClContext& context, const TransferTables& tables, const DevicePlanes& source,
                        const DevicePlanes& target);

/// Queues the kernel.
/// \param points  of the source's rows
/// \return these points, read where place_part reads
DevicePlanes read_source(ClContext& context, const TransferTables& tables, const DevicePlanes& points);

/// Queues the kernel that restores the target's texels where its surface is kept.
void keep_target(ClContext& context, const TransferTables& tables, const DevicePlanes& target, DevicePlanes& texels);

/// Splits a periodic row of values into bands of waves whose sum it is: up to 2 waves around, then up to 4, 8, and so
/// on; the last band has all finer ones.
std::array<std::vector<double>, SKELETEX_TRANSFER_BANDS> wave_bands(const std::vector<double>& values);

}  // namespace skeletex
