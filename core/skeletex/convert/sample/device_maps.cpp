// SPDX-License-Identifier: MIT
#include "skeletex/convert/sample/device_maps.h"

#include <algorithm>

namespace skeletex {
namespace {

/// A number as two floats whose sum is exact to 2^-48.
struct SplitValues {
  std::vector<float> high, low;
  void push_back(double value) {
    high.push_back(static_cast<float>(value));
    low.push_back(static_cast<float>(value - high.back()));
  }
};

}  // namespace

DeviceLayout upload_layout(ClContext& context, std::span<const Patch> patches, const FrameTables& tables, int width,
                           int height) {
  DeviceLayout layout{width, height, {}, {}};
  std::vector<int> texel_patches(layout.size(), -1);
  for (std::size_t bone = 0; bone < patches.size(); ++bone) {
    const Rectangle& r = patches[bone].rectangle;
    for (int row = 0; row < r.height; ++row)
      std::fill_n(texel_patches.begin() + (r.y + row) * static_cast<std::size_t>(width) + r.x, r.width,
                  static_cast<int>(bone));
  }
  layout.texel_patches = context.upload(texel_patches);
  layout.patches = context.upload(tables.patches);
  return layout;
}

DeviceMaps upload_maps(ClContext& context, std::span<const Chart> charts, std::span<const Patch> patches,
                       const Vec3& origin) {
  DeviceMaps maps;
  for (std::size_t bone = 0; bone < charts.size(); ++bone) {
    maps.first_triangle.push_back(maps.triangle_count);
    if (!is_height_field(patches[bone].method)) maps.triangle_count += static_cast<int>(charts[bone].triangles.size());
  }
  maps.first_triangle.push_back(maps.triangle_count);
  const std::size_t count = maps.triangle_count;
  std::vector<int> corners(3 * count), turns(3 * count), across(3 * count), poles(count, 0), triangle_patches(count);
  SplitValues u, v, row_u;
  std::vector<float> x, y, z;
  for (std::size_t bone = 0; bone < charts.size(); ++bone) {
    const int base = static_cast<int>(x.size());
    maps.first_vertex.push_back(base);
    if (is_height_field(patches[bone].method)) continue;
    const Chart& chart = charts[bone];
    for (std::size_t i = 0; i < chart.positions.size(); ++i) {
      u.push_back(chart.u[i]);
      v.push_back(is_pole(chart.kinds[i]) ? 0 : chart.v[i]);
      const Vec3 p = chart.positions[i] - origin;
      x.push_back(static_cast<float>(p[0]));
      y.push_back(static_cast<float>(p[1]));
      z.push_back(static_cast<float>(p[2]));
    }
    for (std::size_t t = 0; t < chart.triangles.size(); ++t) {
      const std::size_t at = maps.first_triangle[bone] + t;
      int pole = -1;
      for (int k = 0; k < 3; ++k)
        if (is_pole(chart.kinds[chart.triangles[t][k]])) pole = k;
      const int shift = pole < 0 ? 0 : (pole + 1) % 3;  // the pole becomes corner 2
      for (int k = 0; k < 3; ++k) {
        const int from = (k + shift) % 3;
        corners[k * count + at] = base + chart.triangles[t][from];
        turns[k * count + at] = from == pole ? 0 : chart.turns[t][from];
        const int twin = chart.half_edges.twins[3 * t + (from + 1) % 3];
        across[k * count + at] = twin < 0 ? -1 : maps.first_triangle[bone] + twin / 3;
      }
      if (pole >= 0) poles[at] = chart.kinds[chart.triangles[t][pole]] == ChartVertex::kTailPole ? 1 : -1;
      triangle_patches[at] = static_cast<int>(bone);
    }
  }
  for (const Patch& patch : patches)
    for (const double value : patch.row_u) row_u.push_back(value);

  maps.corners = context.upload(corners), maps.turns = context.upload(turns), maps.across = context.upload(across);
  maps.poles = context.upload(poles), maps.triangle_patches = context.upload(triangle_patches);
  maps.u_high = context.upload(u.high), maps.u_low = context.upload(u.low);
  maps.v_high = context.upload(v.high), maps.v_low = context.upload(v.low);
  maps.x = context.upload(x), maps.y = context.upload(y), maps.z = context.upload(z);
  maps.row_high = context.upload(row_u.high), maps.row_low = context.upload(row_u.low);
  return maps;
}

}  // namespace skeletex
