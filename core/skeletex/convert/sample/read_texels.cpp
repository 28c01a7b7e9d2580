// SPDX-License-Identifier: MIT
#include "skeletex/convert/sample/read_texels.h"

#include <Eigen/Core>
#include <algorithm>
#include <limits>

#include "skeletex/geometry/parallel.h"

namespace skeletex {
namespace {

constexpr int kNoTriangle = std::numeric_limits<int>::max();  // as in encode.cl
constexpr int kIsKept = 1, kNoneIsKept = 0;                   // what keeps a texel from being filtered

/// Fills what is below 0 of a line of values: by the mean of the nearest known ones, weighted by nearness.
/// \param known  places of the known ones, in order
void fill_line(const std::vector<int>& known, int line_begin, int stride, int count, std::vector<float>& values) {
  if (known.empty()) return;
  const auto at = [&](int i) -> float& { return values[line_begin + i * stride]; };
  for (int i = 0; i < count; ++i) {
    if (at(i) >= 0) continue;
    const auto after = std::lower_bound(known.begin(), known.end(), i);
    if (after == known.begin()) {
      at(i) = at(*after);
    } else if (after == known.end()) {
      at(i) = at(known.back());
    } else {
      const int a = *(after - 1), b = *after;
      const float t = static_cast<float>(i - a) / static_cast<float>(b - a);
      at(i) = (1 - t) * at(a) + t * at(b);
    }
  }
}

/// The places of a line whose values are at least 0.
std::vector<int> known_places(const std::vector<float>& values, int line_begin, int stride, int count) {
  std::vector<int> known;
  for (int i = 0; i < count; ++i)
    if (values[line_begin + i * stride] >= 0) known.push_back(i);
  return known;
}

/// Distances along the rays of one SPD patch; a missed texel takes the mean of the nearest hits of its column, weighted
/// by nearness, or of its row where the whole column missed.
/// \return texels filled
int fill_missed(const SpdHits& hits, const Rectangle& r, std::vector<float>& distances) {
  distances = hits.distances;
  int missed = 0;
  for (int texel = r.width; texel < (r.height - 1) * r.width; ++texel)
    if (hits.triangles[texel] < 0) {
      distances[texel] = -1;
      ++missed;
    }
  if (missed == 0) return 0;
  for (int j = 0; j < r.width; ++j)
    fill_line(known_places(distances, r.width + j, r.width, r.height - 2), r.width + j, r.width, r.height - 2,
              distances);
  for (int row = 1; row + 1 < r.height; ++row)
    fill_line(known_places(distances, row * r.width, 1, r.width), row * r.width, 1, r.width, distances);
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
  context.copy(from, to);
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

bool has_spd(std::span<const Patch> patches) {
  return std::any_of(patches.begin(), patches.end(), [](const Patch& patch) { return is_height_field(patch.method); });
}

PlacedTexels download_texels(ClContext& context, const TexelPoints& points, const ClBuffer<float>& offset_x,
                             const ClBuffer<float>& offset_y, const ClBuffer<int>& anchors,
                             const ClBuffer<int>& map_triangles) {
  auto [x, y, z, own_x, own_y, own_anchors, triangles] =
      context.download(points.x, points.y, points.z, offset_x, offset_y, anchors, map_triangles);
  return {{std::move(x), std::move(y), std::move(z)},
          std::move(own_x),
          std::move(own_y),
          std::move(own_anchors),
          std::move(triangles)};
}

SnapReport report_snap(int vertices, int edges, int reverted, const std::vector<int>& anchors) {
  SnapReport report;
  report.vertices = vertices;
  report.edges = edges;
  report.reverted_texels = reverted;
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

/// What all steps read: the layout and the maps on the device.
struct TexelStage {
  ClContext& context;
  const TexelSources& sources;
  FrameTables tables;
  DeviceLayout layout;
  ClBuffer<RowRecord> rows;
  ClBuffer<ColumnRecord> columns;
  ClBuffer<LatticeRow> inner_rows, all_rows;
  DeviceMaps maps;
  bool has_gaps = false;  // between rectangles

  std::vector<Patch> patches() const { return {sources.patches.begin(), sources.patches.end()}; }
  bool has_maps() const { return maps.triangle_count > 0; }
};

/// Where texels read, and what they have read.
struct ReadTexels {
  TexelPoints points;
  ReadingPositions positions;
  ClBuffer<int> map_triangles;  // per texel; kNoTriangle: none
};

TexelStage prepare_stage(ClContext& context, const Skeleton& skeleton, const SeparationPlanes& separation,
                         const TexelSources& sources, int width, int height, const Vec3& origin) {
  const std::vector<Patch> patches(sources.patches.begin(), sources.patches.end());
  const FrameTables tables = frame_tables(skeleton, separation, patches, origin);
  std::size_t in_patches = 0;
  for (const Patch& patch : patches)
    in_patches += static_cast<std::size_t>(patch.rectangle.width) * patch.rectangle.height;
  TexelStage stage{context,
                   sources,
                   tables,
                   upload_layout(context, patches, tables, width, height),
                   context.upload(tables.rows),
                   context.upload(tables.columns),
                   context.upload(lattice_rows(patches, RowChoice::kInner)),
                   context.upload(lattice_rows(patches, RowChoice::kAll)),
                   upload_maps(context, sources.charts, patches, origin)};
  stage.has_gaps = in_patches < stage.layout.size();
  return stage;
}

/// VSM patches at the places of their texels.
/// \param missed  out, per bone
ReadTexels read_regular_grid(const TexelStage& stage, ClBuffer<int>& is_read, std::vector<int>& missed) {
  ClContext& context = stage.context;
  const DeviceLayout& layout = stage.layout;
  const DeviceMaps& maps = stage.maps;
  ReadTexels texels{allocate_points(context, layout.size()), even_positions(context, layout),
                    context.allocate<int>(layout.size())};
  for (ClBuffer<float>* plane : {&texels.points.x, &texels.points.y, &texels.points.z}) context.fill(*plane, 0.f);
  context.fill(texels.map_triangles, kNoTriangle);
  if (!stage.has_maps()) return texels;
  // A CPU looks at each triangle once; a GPU needs more work-items for the rows of tall ones.
  const std::size_t shares = context.device().type == "cpu" ? 1 : 8;
  context.launch({"encode.cl", "cover_texels"}, ClRange(maps.triangle_count, shares), maps.triangle_count, maps.corners,
                 maps.turns, maps.poles, maps.triangle_patches, maps.u_high, maps.u_low, maps.v_high, maps.v_low,
                 layout.patches, maps.row_high, maps.row_low, layout.width, texels.map_triangles);
  std::vector<int> map_triangles = context.download(texels.map_triangles);
  missed = fill_uncovered(stage.sources.patches, layout.width, map_triangles);
  context.write(texels.map_triangles, map_triangles);
  context.launch({"encode.cl", "read_surface"}, row_range(context, stage.inner_rows.size),
                 static_cast<int>(stage.inner_rows.size), layout.width, maps.triangle_count, stage.inner_rows,
                 texels.map_triangles, maps.corners, maps.turns, maps.poles, maps.u_high, maps.u_low, maps.v_high,
                 maps.v_low, maps.x, maps.y, maps.z, layout.patches, maps.row_high, maps.row_low,
                 texels.positions.home_x, texels.positions.home_y, texels.points.x, texels.points.y, texels.points.z,
                 is_read);
  return texels;
}

/// The share of a chart's triangles that its rays hit.
double hit_fraction(const SpdHits& hits, const Chart& chart) {
  std::vector<int> seen = hits.triangles;
  std::sort(seen.begin(), seen.end());
  seen.erase(std::unique(seen.begin(), seen.end()), seen.end());
  if (!seen.empty() && seen.front() < 0) seen.erase(seen.begin());
  return static_cast<double>(seen.size()) / static_cast<double>(chart.triangles.size());
}

/// SPD patches, by their rays.
void place_spd_patches(const TexelStage& stage, TexelPoints& points, TexelReport& report) {
  const DeviceLayout& layout = stage.layout;
  std::vector<float> distances(layout.size(), -1);
  for (std::size_t bone = 0; bone < stage.sources.patches.size(); ++bone) {
    if (!is_height_field(stage.sources.patches[bone].method)) continue;
    const Rectangle& r = stage.sources.patches[bone].rectangle;
    const SpdHits& hits = stage.sources.spd_hits[bone];
    std::vector<float> filled;
    report.missed_texels[bone] = fill_missed(hits, r, filled);
    for (int row = 0; row < r.height; ++row)
      std::copy_n(filled.begin() + static_cast<std::size_t>(row) * r.width, r.width,
                  distances.begin() + (r.y + row) * static_cast<std::size_t>(layout.width) + r.x);
    report.sampled_triangle_fractions[bone] = hit_fraction(hits, stage.sources.charts[bone]);
  }
  stage.context.launch({"encode.cl", "place_spd_points"}, layout.range(), layout.width, layout.height,
                       layout.texel_patches, stage.context.upload(distances), layout.patches, stage.rows, stage.columns,
                       points.x, points.y, points.z);
}

UnfoldReport unfold(const TexelStage& stage, ClBuffer<int>& is_read, ReadTexels& texels) {
  const DeviceLayout& layout = stage.layout;
  const DeviceMaps& maps = stage.maps;
  const auto read_listed = [&](const ClBuffer<int>& listed, int count) {
    stage.context.launch({"encode.cl", "read_listed"}, ClRange(count), count, layout.width, maps.triangle_count, listed,
                         layout.texel_patches, texels.map_triangles, maps.corners, maps.turns, maps.poles, maps.across,
                         maps.u_high, maps.u_low, maps.v_high, maps.v_low, maps.x, maps.y, maps.z, layout.patches,
                         maps.row_high, maps.row_low, texels.positions.home_x, texels.positions.home_y, texels.points.x,
                         texels.points.y, texels.points.z, is_read);
  };
  return unfold_lattice(stage.context, layout, stage.sources.patches, maps, texels.map_triangles, read_listed,
                        texels.positions, texels.points);
}

/// Texels of VSM patches where they snap to.
/// \param regular  its positions are taken over
ReadTexels snap(const TexelStage& stage, ClBuffer<int>& is_read, ReadTexels& regular) {
  ClContext& context = stage.context;
  const DeviceLayout& layout = stage.layout;
  const DeviceMaps& maps = stage.maps;
  const DeviceSnapTables& features = *stage.sources.features;
  const SnappedPositions snapped = snap_positions(context, layout, features, regular.positions);
  const std::size_t size = layout.size();
  ReadTexels texels{allocate_points(context, size),
                    {context.allocate<float>(size), context.allocate<float>(size), context.allocate<int>(size),
                     regular.positions.home_x, regular.positions.home_y},
                    context.allocate<int>(size)};
  if (stage.has_gaps) {
    context.fill(texels.map_triangles, kNoTriangle), context.fill(texels.positions.anchors, 0);
    for (ClBuffer<float>* plane : {&texels.points.x, &texels.points.y, &texels.points.z}) context.fill(*plane, 0.f);
    context.fill(texels.positions.x, 0.f), context.fill(texels.positions.y, 0.f);
  }
  context.launch({"encode.cl", "read_snapped"}, row_range(context, stage.all_rows.size),
                 static_cast<int>(stage.all_rows.size), layout.width, maps.triangle_count, stage.all_rows,
                 regular.map_triangles, maps.corners, maps.turns, maps.poles, maps.across, maps.u_high, maps.u_low,
                 maps.v_high, maps.v_low, maps.x, maps.y, maps.z, layout.patches, maps.row_high, maps.row_low,
                 regular.positions.home_x, regular.positions.home_y, snapped.x, snapped.y, snapped.anchors,
                 snapped.parameters, features.vertex_points, features.edge_points, regular.points.x, regular.points.y,
                 regular.points.z, texels.positions.x, texels.positions.y, texels.positions.anchors,
                 texels.map_triangles, texels.points.x, texels.points.y, texels.points.z, is_read);
  return texels;
}

/// A copy of the regular grid, to be fitted.
ReadTexels copy_of(const TexelStage& stage, const ReadTexels& regular) {
  ReadTexels texels = regular;
  texels.points = copy_points(stage.context, regular.points);
  copy_plane(stage.context, regular.positions.home_x, texels.positions.x);
  copy_plane(stage.context, regular.positions.home_y, texels.positions.y);
  return texels;
}

TexelPoints prefilter(const TexelStage& stage, const TexelPoints& points, const ClBuffer<int>& are_kept, int kept) {
  TexelPoints filtered = allocate_points(stage.context, stage.layout.size());
  if (stage.has_gaps)
    for (ClBuffer<float>* plane : {&filtered.x, &filtered.y, &filtered.z}) stage.context.fill(*plane, 0.f);
  stage.context.launch({"encode.cl", "prefilter_positions"}, row_range(stage.context, stage.all_rows.size),
                       static_cast<int>(stage.all_rows.size), stage.layout.width, kept, stage.all_rows,
                       stage.layout.patches, are_kept, points.x, points.y, points.z, filtered.x, filtered.y,
                       filtered.z);
  return filtered;
}

/// Texels revert to the regular grid, as it would be stored.
/// \return what holds them then
std::vector<int> revert(const TexelStage& stage, const TexelOptions& options, std::span<const int> vertex_points,
                        const ReadTexels& regular, ReadTexels& texels, TexelReport& report) {
  ClContext& context = stage.context;
  const TexelPoints stored =
      options.has_prefilter ? prefilter(stage, regular.points, regular.map_triangles, kNoneIsKept) : regular.points;
  const PlacedTexels grid = download_texels(context, stored, texels.positions.home_x, texels.positions.home_y,
                                            texels.positions.anchors, regular.map_triangles);
  PlacedTexels placed = download_texels(context, texels.points, texels.positions.x, texels.positions.y,
                                        texels.positions.anchors, texels.map_triangles);
  report.revert = revert_faults(context, *stage.sources.revert, vertex_points, grid, placed);
  texels.points = {context.upload(placed.points[0]), context.upload(placed.points[1]),
                   context.upload(placed.points[2])};
  return std::move(placed.anchors);
}

/// Points of VSM patches snapped or fitted, with what then reverts.
TexelPoints place_points(const TexelStage& stage, const TexelOptions& options, ClBuffer<int>& is_read,
                         ReadTexels& regular, TexelReport& report) {
  ClContext& context = stage.context;
  const TexelSources& sources = stage.sources;
  std::vector<int> vertex_points;
  if (sources.features) vertex_points = context.download(sources.features->vertex_points);
  ReadTexels texels = sources.features ? snap(stage, is_read, regular) : copy_of(stage, regular);
  if (options.fit_steps > 0)
    report.fit = fit_points(context, stage.layout, stage.maps, texels.map_triangles, texels.positions, texels.points,
                            {.steps = options.fit_steps});
  // What is snapped or fitted is not filtered as well: only SPD patches are.
  if (options.has_prefilter && has_spd(sources.patches))
    texels.points =
        prefilter(stage, texels.points,
                  context.upload(vsm_texels(sources.patches, stage.layout.width, stage.layout.height)), kIsKept);
  const std::vector<int> anchors = sources.revert ? revert(stage, options, vertex_points, regular, texels, report)
                                                  : context.download(texels.positions.anchors);
  const int reverted = report.revert ? report.revert->reverted_texels : 0;
  if (report.fit) report.fit->reverted_texels = reverted;
  if (sources.features)
    report.snap = report_snap(static_cast<int>(vertex_points.size()),
                              static_cast<int>(sources.features->edge_points.size), report.fit ? 0 : reverted, anchors);
  return texels.points;
}

/// Points in bone tangent space: along, around, out.
TexelPoints encode_points(const TexelStage& stage, const TexelPoints& points) {
  ClContext& context = stage.context;
  TexelPoints stored = allocate_points(context, stage.layout.size());
  for (ClBuffer<float>* plane : {&stored.x, &stored.y, &stored.z})
    if (stage.has_gaps) context.fill(*plane, 0.f);
  context.launch({"encode.cl", "encode_texels"}, row_range(context, stage.all_rows.size),
                 static_cast<int>(stage.all_rows.size), stage.layout.width, stage.all_rows, stage.layout.patches,
                 stage.rows, stage.columns, points.x, points.y, points.z, stored.x, stored.y, stored.z);
  return stored;
}

/// The share of each VSM chart's triangles that a texel has read.
void report_read(const TexelStage& stage, const ClBuffer<int>& is_read, TexelReport& report) {
  const std::vector<int> marks = stage.context.download(is_read);
  for (std::size_t bone = 0; bone < stage.sources.patches.size(); ++bone) {
    const int begin = stage.maps.first_triangle[bone], end = stage.maps.first_triangle[bone + 1];
    if (end > begin)
      report.sampled_triangle_fractions[bone] =
          static_cast<double>(std::count(marks.begin() + begin, marks.begin() + end, 1)) / (end - begin);
  }
}

}  // namespace

TexelResult read_texels(ClContext& context, const Skeleton& skeleton, const SeparationPlanes& separation,
                        const TexelSources& sources, int texture_width, int texture_height, const Vec3& origin,
                        const TexelOptions& options) {
  TexelResult result;
  TexelReport& report = result.report;
  report.sampled_triangle_fractions.resize(sources.patches.size(), 0);
  report.missed_texels.resize(sources.patches.size(), 0);
  const TexelStage stage = prepare_stage(context, skeleton, separation, sources, texture_width, texture_height, origin);
  auto is_read = context.allocate<int>(std::max(1, stage.maps.triangle_count));
  context.fill(is_read, 0);

  ReadTexels regular = read_regular_grid(stage, is_read, report.missed_texels);
  if (has_spd(sources.patches)) place_spd_patches(stage, regular.points, report);
  place_end_rows(context, sources, texture_width, origin, regular.points);
  if (options.has_unfold && stage.has_maps()) report.unfold = unfold(stage, is_read, regular);
  TexelPoints points;
  if (stage.has_maps() && (sources.features || options.fit_steps > 0))
    points = place_points(stage, options, is_read, regular, report);
  else
    points =
        options.has_prefilter ? prefilter(stage, regular.points, regular.map_triangles, kNoneIsKept) : regular.points;
  TexelPoints stored = encode_points(stage, points);
  if (options.half_rule)
    report.rounding = round_to_half(context, *options.half_rule, stage.patches(), stage.layout, stage.rows,
                                    stage.columns, points, stored);
  report_read(stage, is_read, report);
  auto [along, around, out] = context.download(stored.x, stored.y, stored.z);
  result.texture = {texture_width, texture_height, std::move(along), std::move(around), std::move(out)};
  return result;
}

}  // namespace skeletex
