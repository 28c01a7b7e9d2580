// SPDX-License-Identifier: MIT
#pragma once
#include <span>
#include <vector>

#include "skeletex/convert/parameterize/chart.h"
#include "skeletex/device/context.h"
#include "skeletex/skeleton/frame.h"

namespace skeletex {

/// Planes of points on the device, one value per texel.
struct TexelPoints {
  ClBuffer<float> x, y, z;
};

/// The rectangles of a texture on the device.
struct DeviceLayout {
  int width = 0, height = 0;      ///< of the texture
  ClBuffer<int> texel_patches;    ///< per texel its patch, -1 between rectangles
  ClBuffer<PatchRecord> patches;  ///< see frame_tables
  std::size_t size() const { return static_cast<std::size_t>(width) * height; }
  /// One work-item per texel.
  ClRange range() const { return {{static_cast<std::size_t>(width), static_cast<std::size_t>(height)}, {64, 1}}; }
};
DeviceLayout upload_layout(ClContext& context, std::span<const Patch> patches, const FrameTables& tables, int width,
                           int height);

/// The maps of all VSM patches behind each other on the device, see kernels/encode.cl. Coordinates are pairs of floats
/// (high + low); a triangle's pole, where it has one, is its corner 2.
struct DeviceMaps {
  int triangle_count = 0;
  ClBuffer<int> corners, turns;  ///< three planes of triangle_count
  ClBuffer<int> across;          ///< the triangles behind the edges opposite to the corners, three planes; -1: none
  ClBuffer<int> poles, triangle_patches;
  ClBuffer<float> u_high, u_low, v_high, v_low;
  ClBuffer<float> x, y, z;            ///< vertices, relative to the origin
  ClBuffer<float> row_high, row_low;  ///< row_u of all patches, in the order of the row table
  std::vector<int> first_triangle;    ///< per bone, and the end
  std::vector<int> first_vertex;      ///< per bone; of other methods' patches the next one's
};
/// \param origin  world position that device coordinates are relative to
DeviceMaps upload_maps(ClContext& context, std::span<const Chart> charts, std::span<const Patch> patches,
                       const Vec3& origin);

}  // namespace skeletex
