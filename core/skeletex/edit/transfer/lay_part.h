// SPDX-License-Identifier: MIT
#pragma once
#include <array>
#include <vector>

#include "skeletex/reconstruct/displace.h"
#include "transfer_structs.h"

namespace skeletex {

/// What the kernel lay_part reads beside the source's points.
struct LaidTables {
  std::vector<LatticeRow> rows;     ///< to do; their vertices number the points that come out
  std::vector<LaidRow> laid_rows;   ///< per row to do
  std::vector<LaidPatch> patches;   ///< per patch of the result
  std::vector<LaidColumn> columns;  ///< of the patches to do
  std::vector<float> corrections;   ///< planes as the kernel has them
  std::size_t correction_size() const { return 2 * 2 * 3 * SKELETEX_TRANSFER_BANDS * columns.size(); }
  float& correction(BoneEnd end, int band, bool is_slope, int axis, std::size_t column) {
    const std::size_t plane =
        ((static_cast<std::size_t>(end) * SKELETEX_TRANSFER_BANDS + band) * 2 + (is_slope ? 1 : 0)) * 3 + axis;
    return corrections[plane * columns.size() + column];
  }
};

/// Queues the kernel. \param source, target  points in bone axes   \return points in the axes of the result's bones
DevicePlanes lay_part(ClContext& context, const LaidTables& tables, const FrameTables& result,
                      const DevicePlanes& source, const DevicePlanes& target, std::size_t point_count);

/// Queues the kernel. \param points  of the source's rows   \return what lay_part would lay, where `points` have it
DevicePlanes read_part(ClContext& context, const LaidTables& tables, const FrameTables& result,
                       const DevicePlanes& points, std::size_t point_count);

/// Queues what gives the target's texels back where its surface is kept.
void keep_target(ClContext& context, const LaidTables& tables, const FrameTables& result, int texture_width,
                 const DevicePlanes& target, DevicePlanes& texels);

/// Splits a periodic row of values into bands of waves, whose sum it is: up to 2 waves around, then up to 4, 8, .., and
/// all finer ones in the last.
std::array<std::vector<double>, SKELETEX_TRANSFER_BANDS> wave_bands(const std::vector<double>& values);

}  // namespace skeletex
