// SPDX-License-Identifier: MIT
#pragma once
#include <span>
#include <vector>

#include "skeletex/convert/parameterize/chart.h"
#include "skeletex/device/context.h"
#include "skeletex/model/frame.h"
#include "skeletex/reconstruct/displace.h"
#include "texel_structs.h"

namespace skeletex {

/// The rectangles of a texture on the device.
struct DeviceLayout {
  int width = 0, height = 0;    ///< of the texture
  ClBuffer<int> texel_patches;  ///< per texel its patch, -1 between rectangles
  DeviceTables tables;          ///< see frame_tables
  std::size_t size() const { return static_cast<std::size_t>(width) * height; }
  /// One work-item per texel.
  ClRange range() const { return {{static_cast<std::size_t>(width), static_cast<std::size_t>(height)}, {64, 1}}; }
};
DeviceLayout upload_layout(ClContext& context, std::span<const Patch> patches, const FrameTables& tables, int width,
                           int height);

/// The maps of all VSM patches behind each other on the device, see kernels/map_triangle.h. Coordinates are pairs of
/// floats (high + low).
struct DeviceMaps {
  MapSizes sizes{};
  ClBuffer<int> triangles;          ///< planes of triangle_count, see MAP_CORNERS
  ClBuffer<float> values;           ///< u_high, u_low, v_high, v_low, x, y, z of vertices, then row_high, row_low
  std::vector<int> first_triangle;  ///< per bone, and the end
};
/// \param origin  world position that device coordinates are relative to
DeviceMaps upload_maps(ClContext& context, std::span<const Chart> charts, std::span<const Patch> patches,
                       const Vec3& origin);

}  // namespace skeletex
