// SPDX-License-Identifier: MIT
#include "skeletex/encode/read_texels.h"

#include <algorithm>
#include <limits>

namespace skeletex {
namespace {

constexpr int kNoTriangle = std::numeric_limits<int>::max();  // as in encode.cl
constexpr std::array<std::size_t, 2> kTexelGroup{64, 1};

bool is_pole(ChartVertex kind) { return kind == ChartVertex::kHeadPole || kind == ChartVertex::kTailPole; }

/// A number as two floats whose sum is exact to 2^-48.
struct SplitValues {
  std::vector<float> high, low;
  void push_back(double value) {
    high.push_back(static_cast<float>(value));
    low.push_back(static_cast<float>(value - high.back()));
  }
};

/// All VSM charts, concatenated for the kernels.
struct ChartPlanes {
  int triangle_count = 0;
  std::vector<int> corners, turns;  // three planes of triangle_count
  std::vector<int> poles, patches;
  std::vector<int> first_triangle;  // per bone, and the end
  SplitValues u, v;
  std::vector<float> x, y, z;
};

ChartPlanes concatenate(const TexelSources& sources, const Vec3& origin) {
  ChartPlanes planes;
  for (std::size_t bone = 0; bone < sources.charts.size(); ++bone) {
    planes.first_triangle.push_back(planes.triangle_count);
    if (sources.patches[bone].method == Method::kVsm) planes.triangle_count += static_cast<int>(sources.charts[bone].triangles.size());
  }
  planes.first_triangle.push_back(planes.triangle_count);
  const int count = planes.triangle_count;
  planes.corners.resize(3 * static_cast<std::size_t>(count));
  planes.turns.resize(3 * static_cast<std::size_t>(count));
  planes.poles.resize(count, 0);
  planes.patches.resize(count);
  for (std::size_t bone = 0; bone < sources.charts.size(); ++bone) {
    if (sources.patches[bone].method != Method::kVsm) continue;
    const Chart& chart = sources.charts[bone];
    const int base = static_cast<int>(planes.x.size());
    for (std::size_t i = 0; i < chart.positions.size(); ++i) {
      planes.u.push_back(chart.u[i]);
      planes.v.push_back(is_pole(chart.kinds[i]) ? 0 : chart.v[i]);
      const Vec3 p = chart.positions[i] - origin;
      planes.x.push_back(static_cast<float>(p[0]));
      planes.y.push_back(static_cast<float>(p[1]));
      planes.z.push_back(static_cast<float>(p[2]));
    }
    for (std::size_t t = 0; t < chart.triangles.size(); ++t) {
      const int at = planes.first_triangle[bone] + static_cast<int>(t);
      int pole = -1;
      for (int k = 0; k < 3; ++k)
        if (is_pole(chart.kinds[chart.triangles[t][k]])) pole = k;
      const int shift = pole < 0 ? 0 : (pole + 1) % 3;  // the pole becomes corner 2
      for (int k = 0; k < 3; ++k) {
        const int from = (k + shift) % 3;
        planes.corners[k * static_cast<std::size_t>(count) + at] = base + chart.triangles[t][from];
        planes.turns[k * static_cast<std::size_t>(count) + at] = from == pole ? 0 : chart.turns[t][from];
      }
      if (pole >= 0) planes.poles[at] = chart.kinds[chart.triangles[t][pole]] == ChartVertex::kTailPole ? 1 : -1;
      planes.patches[at] = static_cast<int>(bone);
    }
  }
  return planes;
}

/// Distances along the rays of one SPD patch; a missed texel takes the mean of the nearest hits of its column, weighted
/// by nearness, or of its row where the whole column missed. \return texels filled
int fill_missed(const SpdHits& hits, const Rectangle& r, std::vector<float>& distances) {
  distances = hits.distances;
  int missed = 0;
  const auto fill_line = [&](const std::vector<int>& known, int line_begin, int stride, int count) {
    if (known.empty()) return;
    for (int i = 0; i < count; ++i) {
      float& value = distances[line_begin + i * stride];
      if (value >= 0) continue;
      const auto after = std::lower_bound(known.begin(), known.end(), i);
      if (after == known.begin()) value = distances[line_begin + *after * stride];
      else if (after == known.end()) value = distances[line_begin + known.back() * stride];
      else {
        const int a = *(after - 1), b = *after;
        const float t = static_cast<float>(i - a) / static_cast<float>(b - a);
        value = (1 - t) * distances[line_begin + a * stride] + t * distances[line_begin + b * stride];
      }
    }
  };
  for (int row = 1; row + 1 < r.height; ++row)
    for (int j = 0; j < r.width; ++j)
      if (hits.triangles[row * r.width + j] < 0) {
        distances[row * r.width + j] = -1;
        ++missed;
      }
  if (missed == 0) return 0;
  std::vector<int> known;
  for (int j = 0; j < r.width; ++j) {
    known.clear();
    for (int row = 1; row + 1 < r.height; ++row)
      if (distances[row * r.width + j] >= 0) known.push_back(row - 1);
    fill_line(known, r.width + j, r.width, r.height - 2);
  }
  for (int row = 1; row + 1 < r.height; ++row) {
    known.clear();
    for (int j = 0; j < r.width; ++j)
      if (distances[row * r.width + j] >= 0) known.push_back(j);
    fill_line(known, row * r.width, 1, r.width);
  }
  return missed;
}

}  // namespace

TexelResult read_texels(ClContext& context, const Skeleton& skeleton, const Walls& walls, const TexelSources& sources, int texture_width, int texture_height,
                        const Vec3& origin, bool has_prefilter) {
  const std::size_t texels = static_cast<std::size_t>(texture_width) * texture_height;
  const int bones = static_cast<int>(sources.patches.size());
  TexelResult result;
  result.report.sampled_triangle_fractions.resize(bones, 0);
  result.report.missed_texels.resize(bones, 0);

  std::vector<int> texel_patches(texels, -1);
  for (int bone = 0; bone < bones; ++bone) {
    const Rectangle& r = sources.patches[bone].rectangle;
    for (int row = 0; row < r.height; ++row)
      std::fill_n(texel_patches.begin() + (r.y + row) * static_cast<std::size_t>(texture_width) + r.x, r.width, bone);
  }
  const FrameTables tables = frame_tables(skeleton, walls, {sources.patches.begin(), sources.patches.end()}, origin);
  const auto owner = context.upload(texel_patches);
  const auto patches = context.upload(tables.patches);
  const auto rows = context.upload(tables.rows);
  const auto columns = context.upload(tables.columns);
  auto x = context.allocate<float>(texels), y = context.allocate<float>(texels), z = context.allocate<float>(texels);
  context.fill(x, 0.f), context.fill(y, 0.f), context.fill(z, 0.f);
  const ClRange over_texels({static_cast<std::size_t>(texture_width), static_cast<std::size_t>(texture_height)}, kTexelGroup);

  // Maps: which triangle covers each texel, and its point there.
  const ChartPlanes planes = concatenate(sources, origin);
  std::vector<int> texel_triangles;
  if (planes.triangle_count > 0) {
    SplitValues row_u;
    for (const Patch& patch : sources.patches)
      for (const double u : patch.row_u) row_u.push_back(u);
    const int count = planes.triangle_count;
    const auto corners = context.upload(planes.corners), turns = context.upload(planes.turns), poles = context.upload(planes.poles);
    const auto triangle_patches = context.upload(planes.patches);
    const auto u_high = context.upload(planes.u.high), u_low = context.upload(planes.u.low);
    const auto v_high = context.upload(planes.v.high), v_low = context.upload(planes.v.low);
    const auto row_high = context.upload(row_u.high), row_low = context.upload(row_u.low);
    const auto vertex_x = context.upload(planes.x), vertex_y = context.upload(planes.y), vertex_z = context.upload(planes.z);
    auto covering = context.allocate<int>(texels);
    context.fill(covering, kNoTriangle);
    auto is_read = context.allocate<int>(count);
    context.fill(is_read, 0);
    context.launch({"encode.cl", "cover_texels"}, ClRange(count, 8), count, corners, turns, poles, triangle_patches, u_high, u_low, v_high, v_low, patches,
                   row_high, row_low, texture_width, covering);
    // A texel that rounding leaves to no triangle takes that of a neighbour in its row; its point is clamped into it.
    texel_triangles = context.download(covering);
    bool has_filled = false;
    for (int bone = 0; bone < bones; ++bone) {
      if (sources.patches[bone].method != Method::kVsm) continue;
      const Rectangle& r = sources.patches[bone].rectangle;
      for (int row = 1; row + 1 < r.height; ++row) {
        int* line = texel_triangles.data() + (r.y + row) * static_cast<std::size_t>(texture_width) + r.x;
        for (int j = 0; j < r.width; ++j) {
          if (line[j] != kNoTriangle) continue;
          ++result.report.missed_texels[bone];
          has_filled = true;
          for (int step = 1; step < r.width && line[j] == kNoTriangle; ++step) {
            line[j] = line[(j + step) % r.width];
            if (line[j] == kNoTriangle) line[j] = line[(j + r.width - step) % r.width];
          }
        }
      }
    }
    if (has_filled) context.write(covering, texel_triangles);
    context.launch({"encode.cl", "read_surface"}, over_texels, texture_width, texture_height, count, owner, covering, corners, turns, poles, u_high, u_low,
                   v_high, v_low, vertex_x, vertex_y, vertex_z, patches, row_high, row_low, x, y, z, is_read);
    const std::vector<int> marks = context.download(is_read);
    for (int bone = 0; bone < bones; ++bone) {
      const int begin = planes.first_triangle[bone], end = planes.first_triangle[bone + 1];
      if (end > begin) result.report.sampled_triangle_fractions[bone] = static_cast<double>(std::count(marks.begin() + begin, marks.begin() + end, 1)) / (end - begin);
    }
  }

  // Rays.
  std::vector<float> distances(texels, -1);
  bool has_spd = false;
  for (int bone = 0; bone < bones; ++bone) {
    if (sources.patches[bone].method != Method::kSpd) continue;
    has_spd = true;
    const Rectangle& r = sources.patches[bone].rectangle;
    std::vector<float> filled;
    result.report.missed_texels[bone] = fill_missed(sources.spd_hits[bone], r, filled);
    for (int row = 0; row < r.height; ++row)
      std::copy_n(filled.begin() + static_cast<std::size_t>(row) * r.width, r.width, distances.begin() + (r.y + row) * static_cast<std::size_t>(texture_width) + r.x);
    std::vector<int> seen = sources.spd_hits[bone].triangles;
    std::sort(seen.begin(), seen.end());
    seen.erase(std::unique(seen.begin(), seen.end()), seen.end());
    if (!seen.empty() && seen.front() < 0) seen.erase(seen.begin());
    result.report.sampled_triangle_fractions[bone] = static_cast<double>(seen.size()) / static_cast<double>(sources.charts[bone].triangles.size());
  }
  if (has_spd) {
    const auto device_distances = context.upload(distances);
    context.launch({"encode.cl", "place_spd_points"}, over_texels, texture_width, texture_height, owner, device_distances, patches, rows, columns, x, y, z);
  }

  // End rows: seams and poles.
  std::vector<int> end_texels;
  std::array<std::vector<float>, 3> end_values;
  for (int bone = 0; bone < bones; ++bone) {
    const Rectangle& r = sources.patches[bone].rectangle;
    for (const int end : {0, 1}) {
      const std::vector<Vec3>& points = sources.end_points[bone][end];
      const int row = r.y + (end == 0 ? 0 : r.height - 1);
      for (int j = 0; j < r.width; ++j) {
        end_texels.push_back(row * texture_width + r.x + j);
        const Vec3 p = (points.size() == 1 ? points[0] : points[j]) - origin;
        for (int i = 0; i < 3; ++i) end_values[i].push_back(static_cast<float>(p[i]));
      }
    }
  }
  const auto place = context.upload(end_texels);
  const auto place_x = context.upload(end_values[0]), place_y = context.upload(end_values[1]), place_z = context.upload(end_values[2]);
  context.launch({"encode.cl", "place_points"}, ClRange(end_texels.size()), static_cast<int>(end_texels.size()), place, place_x, place_y, place_z, x, y, z);

  if (has_prefilter) {
    auto fx = context.allocate<float>(texels), fy = context.allocate<float>(texels), fz = context.allocate<float>(texels);
    context.launch({"encode.cl", "prefilter_positions"}, over_texels, texture_width, texture_height, owner, patches, x, y, z, fx, fy, fz);
    x = fx, y = fy, z = fz;
  }
  auto along = context.allocate<float>(texels), around = context.allocate<float>(texels), out = context.allocate<float>(texels);
  context.launch({"encode.cl", "encode_texels"}, over_texels, texture_width, texture_height, owner, patches, rows, columns, x, y, z, along, around, out);
  result.texture = {texture_width, texture_height, context.download(along), context.download(around), context.download(out)};
  return result;
}

}  // namespace skeletex
