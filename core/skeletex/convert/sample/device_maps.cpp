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

namespace {

/// The planes of all maps on the host.
struct HostMaps {
  std::vector<int> corners, turns, across, poles, triangle_patches;
  SplitValues u, v;
  std::vector<float> x, y, z;
};

void append_vertices(const Chart& chart, const Vec3& origin, HostMaps& maps) {
  for (std::size_t i = 0; i < chart.positions.size(); ++i) {
    maps.u.push_back(chart.u[i]);
    maps.v.push_back(is_pole(chart.kinds[i]) ? 0 : chart.v[i]);
    const Vec3 p = chart.positions[i] - origin;
    maps.x.push_back(static_cast<float>(p[0]));
    maps.y.push_back(static_cast<float>(p[1]));
    maps.z.push_back(static_cast<float>(p[2]));
  }
}

/// \param first  the number of the chart's first triangle    \param base  of its first vertex
void set_triangle(const Chart& chart, std::size_t triangle, int first, int base, HostMaps& maps) {
  const std::size_t at = first + triangle, count = maps.poles.size();
  const Triangle& vertices = chart.triangles[triangle];
  int pole = -1;
  for (int k = 0; k < 3; ++k)
    if (is_pole(chart.kinds[vertices[k]])) pole = k;
  const int shift = pole < 0 ? 0 : (pole + 1) % 3;  // the pole becomes corner 2
  for (int k = 0; k < 3; ++k) {
    const int from = (k + shift) % 3;
    maps.corners[k * count + at] = base + vertices[from];
    maps.turns[k * count + at] = from == pole ? 0 : chart.turns[triangle][from];
    const int twin = chart.half_edges.twins[3 * triangle + (from + 1) % 3];
    maps.across[k * count + at] = twin < 0 ? -1 : first + twin / 3;
  }
  if (pole >= 0) maps.poles[at] = chart.kinds[vertices[pole]] == ChartVertex::kTailPole ? 1 : -1;
}

}  // namespace

DeviceMaps upload_maps(ClContext& context, std::span<const Chart> charts, std::span<const Patch> patches,
                       const Vec3& origin) {
  DeviceMaps maps;
  for (std::size_t bone = 0; bone < charts.size(); ++bone) {
    maps.first_triangle.push_back(maps.triangle_count);
    if (!is_height_field(patches[bone].method)) maps.triangle_count += static_cast<int>(charts[bone].triangles.size());
  }
  maps.first_triangle.push_back(maps.triangle_count);
  const std::size_t count = maps.triangle_count;
  HostMaps host;
  for (std::vector<int>* plane : {&host.corners, &host.turns, &host.across}) plane->resize(3 * count);
  host.poles.assign(count, 0), host.triangle_patches.resize(count);
  for (std::size_t bone = 0; bone < charts.size(); ++bone) {
    const int base = static_cast<int>(host.x.size()), first = maps.first_triangle[bone];
    maps.first_vertex.push_back(base);
    if (is_height_field(patches[bone].method)) continue;
    append_vertices(charts[bone], origin, host);
    for (std::size_t t = 0; t < charts[bone].triangles.size(); ++t) set_triangle(charts[bone], t, first, base, host);
    std::fill_n(host.triangle_patches.begin() + first, charts[bone].triangles.size(), static_cast<int>(bone));
  }
  SplitValues row_u;
  for (const Patch& patch : patches)
    for (const double value : patch.row_u) row_u.push_back(value);

  maps.corners = context.upload(host.corners), maps.turns = context.upload(host.turns);
  maps.across = context.upload(host.across);
  maps.poles = context.upload(host.poles), maps.triangle_patches = context.upload(host.triangle_patches);
  maps.u_high = context.upload(host.u.high), maps.u_low = context.upload(host.u.low);
  maps.v_high = context.upload(host.v.high), maps.v_low = context.upload(host.v.low);
  maps.x = context.upload(host.x), maps.y = context.upload(host.y), maps.z = context.upload(host.z);
  maps.row_high = context.upload(row_u.high), maps.row_low = context.upload(row_u.low);
  return maps;
}

}  // namespace skeletex
