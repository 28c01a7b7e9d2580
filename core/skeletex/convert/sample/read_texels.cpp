// SPDX-License-Identifier: MIT
#include "skeletex/convert/sample/read_texels.h"

#include <Eigen/Core>
#include <algorithm>
#include <future>
#include <limits>
#include <memory>

#include "skeletex/geometry/parallel.h"

namespace skeletex {
namespace {

constexpr int kNoTriangle = std::numeric_limits<int>::max();  // as in encode.cl
constexpr int kIsKept = 1, kNoneIsKept = 0;                   // what keeps a texel from being filtered

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
      if (after == known.begin())
        value = distances[line_begin + *after * stride];
      else if (after == known.end())
        value = distances[line_begin + known.back() * stride];
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

/// Texels that rounding leaves to no triangle take that of a neighbour in their row; their points are clamped into it.
/// \return per patch how many
std::vector<int> fill_uncovered(std::span<const Patch> patches, int texture_width, std::vector<int>& texel_triangles) {
  std::vector<int> counts(patches.size(), 0);
  for (std::size_t bone = 0; bone < patches.size(); ++bone) {
    if (is_height_field(patches[bone].method)) continue;
    const Rectangle& r = patches[bone].rectangle;
    for (int row = 1; row + 1 < r.height; ++row) {
      int* line = texel_triangles.data() + (r.y + row) * static_cast<std::size_t>(texture_width) + r.x;
      for (int j = 0; j < r.width; ++j) {
        if (line[j] != kNoTriangle) continue;
        ++counts[bone];
        for (int step = 1; step < r.width && line[j] == kNoTriangle; ++step) {
          line[j] = line[(j + step) % r.width];
          if (line[j] == kNoTriangle) line[j] = line[(j + r.width - step) % r.width];
        }
      }
    }
  }
  return counts;
}

TexelPoints allocate_points(ClContext& context, std::size_t size) {
  return {context.allocate<float>(size), context.allocate<float>(size), context.allocate<float>(size)};
}

template <class T>
void copy_plane(ClContext& context, const ClBuffer<T>& from, ClBuffer<T>& to) {
  context.queue().enqueueCopyBuffer(from.memory, to.memory, 0, 0, from.size * sizeof(T));
}

TexelPoints copy_points(ClContext& context, const TexelPoints& points) {
  TexelPoints copy = allocate_points(context, points.x.size);
  copy_plane(context, points.x, copy.x), copy_plane(context, points.y, copy.y), copy_plane(context, points.z, copy.z);
  return copy;
}

/// Rows 0 and height - 1: seams and poles.
void place_end_rows(ClContext& context, const TexelSources& sources, int texture_width, const Vec3& origin,
                    TexelPoints& points) {
  std::vector<int> texels;
  std::array<std::vector<float>, 3> values;
  for (std::size_t bone = 0; bone < sources.patches.size(); ++bone) {
    const Rectangle& r = sources.patches[bone].rectangle;
    for (const int end : {0, 1}) {
      const std::vector<Vec3>& end_points = sources.end_points[bone][end];
      const int row = r.y + (end == 0 ? 0 : r.height - 1);
      for (int j = 0; j < r.width; ++j) {
        texels.push_back(row * texture_width + r.x + j);
        const Vec3 p = (end_points.size() == 1 ? end_points[0] : end_points[j]) - origin;
        for (int i = 0; i < 3; ++i) values[i].push_back(static_cast<float>(p[i]));
      }
    }
  }
  context.launch({"encode.cl", "place_points"}, ClRange(texels.size()), static_cast<int>(texels.size()),
                 context.upload(texels), context.upload(values[0]), context.upload(values[1]),
                 context.upload(values[2]), points.x, points.y, points.z);
}

/// Per texel whether it lies in a VSM patch.
std::vector<int> vsm_texels(std::span<const Patch> patches, int texture_width, int texture_height) {
  std::vector<int> is_vsm(static_cast<std::size_t>(texture_width) * texture_height, 0);
  for (const Patch& patch : patches) {
    const Rectangle& r = patch.rectangle;
    for (int row = 0; row < r.height; ++row)
      std::fill_n(is_vsm.begin() + (r.y + row) * static_cast<std::size_t>(texture_width) + r.x, r.width,
                  static_cast<int>(!is_height_field(patch.method)));
  }
  return is_vsm;
}

SnapReport report_snap(int vertices, int edges, int put_back, const std::vector<int>& anchors) {
  SnapReport report;
  report.vertices = vertices;
  report.edges = edges;
  report.texels_put_back = put_back;
  // Signs, as 0 and -1.
  const Eigen::Map<const Eigen::ArrayXi> numbers(anchors.data(), static_cast<Eigen::Index>(anchors.size()));
  report.snapped_vertices = -(-numbers).shiftRight<31>().sum(),
  report.texels_on_edges = -numbers.shiftRight<31>().sum();
  // Without branches, which std::max is here: what holds a texel follows no pattern. The first flag is that of texels
  // on no edge.
  std::vector<char> has_texel(edges + 1, 0);
  for (const int anchor : anchors) has_texel[-anchor & (anchor >> 31)] = 1;
  report.snapped_edges = static_cast<int>(std::count(has_texel.begin() + 1, has_texel.end(), 1));
  return report;
}

}  // namespace

TexelResult read_texels(ClContext& context, const Skeleton& skeleton, const SeparationPlanes& separation,
                        const TexelSources& sources, int texture_width, int texture_height, const Vec3& origin,
                        const TexelOptions& options) {
  const int bones = static_cast<int>(sources.patches.size());
  TexelResult result;
  result.report.sampled_triangle_fractions.resize(bones, 0);
  result.report.missed_texels.resize(bones, 0);

  const FrameTables tables =
      frame_tables(skeleton, separation, {sources.patches.begin(), sources.patches.end()}, origin);
  const DeviceLayout layout = upload_layout(context, sources.patches, tables, texture_width, texture_height);
  const std::size_t texels = layout.size();
  const auto rows = context.upload(tables.rows);
  const auto columns = context.upload(tables.columns);
  std::size_t in_patches = 0;
  for (const Patch& patch : sources.patches)
    in_patches += static_cast<std::size_t>(patch.rectangle.width) * patch.rectangle.height;
  const bool has_gaps = in_patches < texels;
  const auto inner_rows =
      context.upload(lattice_rows({sources.patches.begin(), sources.patches.end()}, RowChoice::kInner));
  const int inner_row_count = static_cast<int>(inner_rows.size);
  TexelPoints points = allocate_points(context, texels);
  context.fill(points.x, 0.f), context.fill(points.y, 0.f), context.fill(points.z, 0.f);
  ReadingPositions positions = even_positions(context, layout);

  const DeviceMaps maps = upload_maps(context, sources.charts, sources.patches, origin);
  const bool is_snapped = sources.features.valid() && maps.triangle_count > 0,
             is_fitted = options.has_fit && maps.triangle_count > 0;
  auto covering = context.allocate<int>(texels);
  auto is_read = context.allocate<int>(std::max(1, maps.triangle_count));
  context.fill(is_read, 0);
  if (maps.triangle_count > 0) {
    context.fill(covering, kNoTriangle);
    // A CPU looks at each triangle once; a GPU needs more work-items for the rows of tall ones.
    const std::size_t shares = context.device().type == "cpu" ? 1 : 8;
    context.launch({"encode.cl", "cover_texels"}, ClRange(maps.triangle_count, shares), maps.triangle_count,
                   maps.corners, maps.turns, maps.poles, maps.triangle_patches, maps.u_high, maps.u_low, maps.v_high,
                   maps.v_low, layout.patches, maps.row_high, maps.row_low, texture_width, covering);
    std::vector<int> texel_triangles = context.download(covering);
    result.report.missed_texels = fill_uncovered(sources.patches, texture_width, texel_triangles);
    context.write(covering, texel_triangles);
    context.launch({"encode.cl", "read_surface"}, row_range(context, inner_rows.size), inner_row_count, texture_width,
                   maps.triangle_count, inner_rows, covering, maps.corners, maps.turns, maps.poles, maps.u_high,
                   maps.u_low, maps.v_high, maps.v_low, maps.x, maps.y, maps.z, layout.patches, maps.row_high,
                   maps.row_low, positions.home_x, positions.home_y, points.x, points.y, points.z, is_read);
  }

  // Rays.
  std::vector<float> distances;
  bool has_spd = false;
  for (int bone = 0; bone < bones; ++bone) {
    if (!is_height_field(sources.patches[bone].method)) continue;
    if (!has_spd) distances.assign(texels, -1);
    has_spd = true;
    const Rectangle& r = sources.patches[bone].rectangle;
    std::vector<float> filled;
    result.report.missed_texels[bone] = fill_missed(sources.spd_hits[bone], r, filled);
    for (int row = 0; row < r.height; ++row)
      std::copy_n(filled.begin() + static_cast<std::size_t>(row) * r.width, r.width,
                  distances.begin() + (r.y + row) * static_cast<std::size_t>(texture_width) + r.x);
    std::vector<int> seen = sources.spd_hits[bone].triangles;
    std::sort(seen.begin(), seen.end());
    seen.erase(std::unique(seen.begin(), seen.end()), seen.end());
    if (!seen.empty() && seen.front() < 0) seen.erase(seen.begin());
    result.report.sampled_triangle_fractions[bone] =
        static_cast<double>(seen.size()) / static_cast<double>(sources.charts[bone].triangles.size());
  }
  if (has_spd) {
    const auto device_distances = context.upload(distances);
    context.launch({"encode.cl", "place_spd_points"}, layout.range(), texture_width, texture_height,
                   layout.texel_patches, device_distances, layout.patches, rows, columns, points.x, points.y, points.z);
  }
  place_end_rows(context, sources, texture_width, origin, points);

  if (options.has_unfold && maps.triangle_count > 0) {
    const auto read_listed = [&](const ClBuffer<int>& listed, int count) {
      context.launch({"encode.cl", "read_listed"}, ClRange(count), count, texture_width, maps.triangle_count, listed,
                     layout.texel_patches, covering, maps.corners, maps.turns, maps.poles, maps.across, maps.u_high,
                     maps.u_low, maps.v_high, maps.v_low, maps.x, maps.y, maps.z, layout.patches, maps.row_high,
                     maps.row_low, positions.home_x, positions.home_y, points.x, points.y, points.z, is_read);
    };
    result.report.unfold =
        unfold_lattice(context, layout, sources.patches, maps, covering, read_listed, positions, points);
  }
  const TexelPoints even = points;
  const ClBuffer<int> even_covering = covering;
  const auto all_rows = context.upload(lattice_rows({sources.patches.begin(), sources.patches.end()}, RowChoice::kAll));
  const auto prefilter = [&](ClContext& on, const TexelPoints& from, const ClBuffer<int>& are_kept, int kept) {
    TexelPoints filtered = allocate_points(on, texels);
    on.launch({"encode.cl", "prefilter_positions"}, row_range(on, all_rows.size), static_cast<int>(all_rows.size),
              texture_width, kept, all_rows, layout.patches, are_kept, from.x, from.y, from.z, filtered.x, filtered.y,
              filtered.z);
    return filtered;
  };
  // The regular grid is measured beside the snapping, on a queue of its own.
  std::unique_ptr<ClContext> beside;
  std::future<std::unique_ptr<Guard>> measuring_even;
  if ((is_snapped || is_fitted) && sources.guard) {
    context.finish();
    beside = context.beside();
    measuring_even = std::async(context.can_run_beside() ? std::launch::async : std::launch::deferred, [&] {
      const TexelPoints filtered = options.has_prefilter ? prefilter(*beside, even, even_covering, kNoneIsKept) : even;
      return std::make_unique<Guard>(*beside, *sources.guard, layout, maps, even_covering, even, filtered);
    });
  }
  int put_back = 0, edges = 0;
  std::vector<int> vertex_points;
  if (is_snapped) {
    const DeviceSnapTables& features = sources.features.get();
    vertex_points = context.download(features.vertex_points), edges = static_cast<int>(features.edge_points.size);
    const SnappedPositions snapped = snap_positions(context, layout, features, positions);
    points = allocate_points(context, texels), covering = context.allocate<int>(texels);
    positions.x = context.allocate<float>(texels), positions.y = context.allocate<float>(texels),
    positions.anchors = context.allocate<int>(texels);
    if (has_gaps) context.fill(covering, kNoTriangle), context.fill(positions.anchors, 0);
    context.launch({"encode.cl", "read_snapped"}, row_range(context, all_rows.size), static_cast<int>(all_rows.size),
                   texture_width, maps.triangle_count, all_rows, even_covering, maps.corners, maps.turns, maps.poles,
                   maps.across, maps.u_high, maps.u_low, maps.v_high, maps.v_low, maps.x, maps.y, maps.z,
                   layout.patches, maps.row_high, maps.row_low, positions.home_x, positions.home_y, snapped.x,
                   snapped.y, snapped.anchors, snapped.parameters, features.vertex_points, features.edge_points, even.x,
                   even.y, even.z, positions.x, positions.y, positions.anchors, covering, points.x, points.y, points.z,
                   is_read);
  } else if (is_fitted) {
    copy_plane(context, positions.home_x, positions.x), copy_plane(context, positions.home_y, positions.y);
    points = copy_points(context, even);
  }
  if (is_fitted) result.report.fit = fit_points(context, layout, maps, covering, positions, points);
  // What is snapped or fitted is not filtered as well: with SPD patches beside it, only these are.
  const bool is_placed = is_snapped || is_fitted;
  if (options.has_prefilter && !is_placed) points = prefilter(context, points, positions.anchors, kNoneIsKept);
  if (options.has_prefilter && is_placed && has_spd)
    points =
        prefilter(context, points, context.upload(vsm_texels(sources.patches, texture_width, texture_height)), kIsKept);
  std::vector<int> anchors;
  if (measuring_even.valid()) {
    context.finish();
    const std::unique_ptr<Guard> even_guard = measuring_even.get();
    GuardReport guard = even_guard->put_back_faults(context, vertex_points, covering, positions, points);
    context.take_profile(*beside);
    result.report.turned_triangles = guard.turned_triangles,
    result.report.even_turned_triangles = guard.even_turned_triangles;
    (is_fitted ? result.report.fit->texels_put_back : put_back) += guard.texels_put_back;
    anchors = std::move(guard.anchors);
  }
  if (is_snapped && anchors.empty()) anchors = context.download(positions.anchors);
  TexelPoints stored = allocate_points(context, texels);  // along, around, out
  for (ClBuffer<float>* plane : {&stored.x, &stored.y, &stored.z})
    if (has_gaps) context.fill(*plane, 0.f);
  context.launch({"encode.cl", "encode_texels"}, row_range(context, all_rows.size), static_cast<int>(all_rows.size),
                 texture_width, all_rows, layout.patches, rows, columns, points.x, points.y, points.z, stored.x,
                 stored.y, stored.z);
  if (options.half_rule)
    result.report.rounding =
        round_to_half(context, *options.half_rule, {sources.patches.begin(), sources.patches.end()}, layout, rows,
                      columns, points, stored);
  if (is_snapped)
    result.report.snap =
        report_snap(static_cast<int>(vertex_points.size()), edges, put_back, anchors);  // beside the device's work
  auto [along, around, out, marks] = context.download(stored.x, stored.y, stored.z, is_read);
  for (int bone = 0; bone < bones; ++bone) {
    const int begin = maps.first_triangle[bone], end = maps.first_triangle[bone + 1];
    if (end > begin)
      result.report.sampled_triangle_fractions[bone] =
          static_cast<double>(std::count(marks.begin() + begin, marks.begin() + end, 1)) / (end - begin);
  }
  result.texture = {texture_width, texture_height, std::move(along), std::move(around), std::move(out)};
  return result;
}

}  // namespace skeletex
