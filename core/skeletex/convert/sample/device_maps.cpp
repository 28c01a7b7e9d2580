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
  DeviceLayout layout{width, height, {}, upload_tables(context, tables)};
  std::vector<int> texel_patches(layout.size(), -1);
  for (std::size_t bone = 0; bone < patches.size(); ++bone) {
    const Rectangle& r = patches[bone].rectangle;
    for (int row = 0; row < r.height; ++row)
      std::fill_n(texel_patches.begin() + (r.y + row) * static_cast<std::size_t>(width) + r.x, r.width,
                  static_cast<int>(bone));
  }
  layout.texel_patches = context.upload(texel_patches);
  return layout;
}

namespace {

/// The planes of all maps on the host.
struct HostMaps {
  std::size_t triangle_count = 0;
  std::vector<int> triangles;
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

/// \param first  the number of the chart's first triangle
/// \param base   of its first vertex
void set_triangle(const Chart& chart, PatchIndex patch, std::size_t triangle, int first, int base, HostMaps& maps) {
  const auto value = [&](int plane) -> int& { return maps.triangles[plane * maps.triangle_count + first + triangle]; };
  const Triangle& vertices = chart.triangles[triangle];
  int pole = -1;
  for (int k = 0; k < 3; ++k)
    if (is_pole(chart.kinds[vertices[k]])) pole = k;
  const int shift = pole < 0 ? 0 : (pole + 1) % 3;  // the pole becomes corner 2
  for (int k = 0; k < 3; ++k) {
    const int from = (k + shift) % 3;
    value(MAP_CORNERS + k) = base + vertices[from];
    value(MAP_TURNS + k) = from == pole ? 0 : chart.turns[triangle][from];
    const int twin = chart.half_edges.twins[3 * triangle + (from + 1) % 3];
    value(MAP_ACROSS + k) = twin < 0 ? -1 : first + twin / 3;
  }
  value(MAP_POLES) = pole < 0 ? 0 : chart.kinds[vertices[pole]] == ChartVertex::kTailPole ? 1 : -1;
  value(MAP_PATCHES) = patch;
}

}  // namespace

DeviceMaps upload_maps(ClContext& context, std::span<const Chart> charts, std::span<const Patch> patches,
                       const Vec3& origin) {
  DeviceMaps maps;
  HostMaps host;
  for (std::size_t bone = 0; bone < charts.size(); ++bone) {
    maps.first_triangle.push_back(static_cast<int>(host.triangle_count));
    if (!is_height_field(patches[bone].method)) host.triangle_count += charts[bone].triangles.size();
  }
  maps.first_triangle.push_back(static_cast<int>(host.triangle_count));
  host.triangles.resize(MAP_TRIANGLE_PLANES * host.triangle_count);
  for (std::size_t bone = 0; bone < charts.size(); ++bone) {
    if (is_height_field(patches[bone].method)) continue;
    const int base = static_cast<int>(host.x.size());
    append_vertices(charts[bone], origin, host);
    for (std::size_t t = 0; t < charts[bone].triangles.size(); ++t)
      set_triangle(charts[bone], static_cast<int>(bone), t, maps.first_triangle[bone], base, host);
  }
  SplitValues row_u;
  for (const Patch& patch : patches)
    for (const double value : patch.row_u) row_u.push_back(value);
  std::vector<float> values;
  for (const auto* plane :
       {&host.u.high, &host.u.low, &host.v.high, &host.v.low, &host.x, &host.y, &host.z, &row_u.high, &row_u.low})
    values.insert(values.end(), plane->begin(), plane->end());
  maps.sizes = {static_cast<int>(host.triangle_count), static_cast<int>(host.x.size()),
                static_cast<int>(row_u.high.size())};
  maps.triangles = context.upload(host.triangles), maps.values = context.upload(values);
  return maps;
}

}  // namespace skeletex
