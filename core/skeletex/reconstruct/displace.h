// SPDX-License-Identifier: MIT
#pragma once
#include <array>
#include <bit>
#include <span>
#include <vector>

#include "skeletex/device/context.h"
#include "skeletex/model/texture.h"
#include "skeletex/reconstruct/prepared_model.h"

namespace skeletex {

/// One work-group per row: see kernels/reconstruct.cl.
ClRange row_range(const ClContext& context, std::size_t rows);

/// Three planes of floats on the device, behind each other in one buffer: x, y, z of points, or along, around, out of
/// texels.
struct DevicePlanes {
  ClBuffer<float> values;
  std::size_t count = 0;  ///< values per plane
};
/// Not initialised.
DevicePlanes allocate_planes(ClContext& context, std::size_t count);
/// \pre the planes have the same size
DevicePlanes upload_planes(ClContext& context, std::span<const float> x, std::span<const float> y,
                           std::span<const float> z);
DevicePlanes upload_texels(ClContext& context, const DisplacementTexture& texture);
/// Waits for the queue and copies the planes to the host.
std::array<std::vector<float>, 3> download_planes(ClContext& context, const DevicePlanes& planes);
/// The same as positions.
/// \param origin  world position that the points are relative to
/// \param positions  the first ones are set
void download_points(ClContext& context, const DevicePlanes& points, const Vec3& origin, std::span<Vec3> positions);
/// Waits for the queue and copies the planes to a texture, whose size is left as it is.
void download_texels(ClContext& context, const DevicePlanes& texels, DisplacementTexture& texture);

/// Records of four floats (ColumnRecord, PosedColumnRecord) as four planes behind each other.
template <class Record>
ClBuffer<float> upload_columns(ClContext& context, const std::vector<Record>& records) {
  std::vector<float> planes(4 * records.size());
  for (std::size_t i = 0; i < records.size(); ++i)
    for (std::size_t k = 0; k < 4; ++k)
      planes[k * records.size() + i] = std::bit_cast<std::array<float, 4>>(records[i])[k];
  return context.upload(planes);
}

/// The frame tables on the device. The columns are four planes: cosine, sine, slope_head, slope_tail.
struct DeviceTables {
  ClBuffer<PatchRecord> patches;
  ClBuffer<RowRecord> rows;
  ClBuffer<float> columns;
  int column_count = 0;
};
DeviceTables upload_tables(ClContext& context, const FrameTables& tables);

/// Tables whose points come out in each bone's own axes, from H along s, b, o. Filters and enter_tangent_space need no
/// world coordinates, and in these axes rounding is relative to the bone.
FrameTables in_bone_axes(FrameTables tables);

/// What the device needs to turn texels into points: the texels, the tables and the chosen rows.
struct DeviceLattice {
  int texture_width = 0;
  std::size_t vertex_count = 0;
  DevicePlanes texels;  ///< along, around, out
  DeviceTables tables;
  ClBuffer<LatticeRow> rows;
};
DeviceLattice upload_lattice(ClContext& context, const FrameTables& tables, const std::vector<Patch>& patches,
                             const DisplacementTexture& texture, RowChoice choice);
DeviceLattice upload_lattice(ClContext& context, const PreparedModel& model, RowChoice choice);

/// Queues the texels of points at the places of some rows (one launch): the inverse of displace.
/// \param points  of the rows, in each bone's own axes (in_bone_axes)
/// \param texels  of texture_width columns
void enter_tangent_space(ClContext& context, const DeviceTables& tables, const ClBuffer<LatticeRow>& rows,
                         int texture_width, const DevicePlanes& points, DevicePlanes& texels);

/// What the kernels between texels and points take as parameters (kernels/reconstruct_structs.h).
struct DisplaceParameters;
DisplaceParameters displace_parameters(std::size_t row_count, int texture_width, const DeviceTables& tables,
                                       const DevicePlanes& texels, const DevicePlanes& points);

/// Queues the points of all rows (one launch), relative to the origin of the tables.
void displace(ClContext& context, const DeviceLattice& lattice, DevicePlanes& points);

/// The points of a model's rows in its bind pose, relative to its origin.
DevicePlanes row_points(ClContext& context, const PreparedModel& model, RowChoice choice);
/// The same of all rows in the axes of their own bones, from their heads.
DevicePlanes points_in_bone_axes(ClContext& context, const PreparedModel& model);

}  // namespace skeletex
