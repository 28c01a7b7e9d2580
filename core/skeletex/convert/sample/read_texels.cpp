// SPDX-License-Identifier: MIT
#include "skeletex/convert/sample/read_texels.h"

#include <algorithm>

#include "skeletex/geometry/parallel.h"

namespace skeletex {
namespace {

constexpr int kNoTriangle = NO_TRIANGLE;
constexpr int kIsKept = 1, kNoneIsKept = 0;  // what keeps a texel from being filtered

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
  for (TexelIndex texel = r.width; texel < (r.height - 1) * r.width; ++texel)
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

/// Points, or texels, of 0.
DevicePlanes clear_planes(ClContext& context, std::size_t size) {
  DevicePlanes planes = allocate_planes(context, size);
  context.fill(planes.values, 0.f);
  return planes;
}

template <class T>
ClBuffer<T> copy_of(ClContext& context, const ClBuffer<T>& buffer) {
  ClBuffer<T> copy = context.allocate<T>(buffer.size);
  context.copy(buffer, copy);
  return copy;
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

/// \param offsets  planes, the first two
PlacedTexels download_texels(ClContext& context, const DevicePlanes& points, const ClBuffer<float>& offsets,
                             const ClBuffer<int>& anchors, const ClBuffer<int>& map_triangles) {
  const ClMapping<float> mapped = context.map(offsets);
  const float *const x = mapped.data(), *const y = x + points.count;
  return {download_planes(context, points), std::vector(x, y),
          std::vector(y, y + points.count), context.download(anchors),
          context.download(map_triangles),  points};
}

SnapReport report_snap(int vertices, int edges, int reverted, const std::vector<int>& anchors) {
  SnapReport report;
  report.vertices = vertices;
  report.edges = edges;
  report.reverted_texels = reverted;
  std::vector<char> has_texel(edges + 1, 0);  // per edge, from 1 on
  for (const int anchor : anchors) {
    report.snapped_vertices += anchor > 0;
    report.texels_on_edges += anchor < 0;
    if (anchor < 0) has_texel[-anchor] = 1;
  }
  report.snapped_edges = static_cast<int>(std::count(has_texel.begin(), has_texel.end(), 1));
  return report;
}

/// What all steps read: the layout and the maps on the device.
struct TexelStage {
  ClContext& context;
  const TexelSources& sources;
  DeviceLayout layout;
  ClBuffer<LatticeRow> mapped_rows, all_rows;  // inner rows of VSM patches; all
  DeviceMaps maps;

  std::vector<Patch> patches() const { return {sources.patches.begin(), sources.patches.end()}; }
  bool has_maps() const { return maps.sizes.triangle_count > 0; }
  MapParameters map_parameters(std::size_t count) const {
    return {maps.sizes, layout.width, static_cast<int>(layout.size()), static_cast<int>(count), 0, 0, 0};
  }
  TexelParameters texel_parameters(std::size_t count) const {
    return {layout.width, static_cast<int>(layout.size()), static_cast<int>(count), layout.tables.column_count, 0};
  }
};

/// Where texels read, and what they have read.
struct ReadTexels {
  DevicePlanes points;
  ReadingPositions positions;
  ClBuffer<int> map_triangles;  // per texel; kNoTriangle: none
};

TexelStage prepare_stage(ClContext& context, const Skeleton& skeleton, const SeparationPlanes& separation,
                         const TexelSources& sources, int width, int height, const Vec3& origin) {
  const std::vector<Patch> patches(sources.patches.begin(), sources.patches.end());
  std::vector<LatticeRow> mapped_rows = lattice_rows(patches, RowChoice::kInner);
  std::erase_if(mapped_rows, [&](const LatticeRow& row) { return is_height_field(patches[row[0]].method); });
  return {context,
          sources,
          upload_layout(context, patches, frame_tables(skeleton, separation, patches, origin), width, height),
          context.upload(mapped_rows),
          context.upload(lattice_rows(patches, RowChoice::kAll)),
          upload_maps(context, sources.charts, patches, origin)};
}

/// Rows 0 and height - 1: seams and poles.
void place_end_rows(const TexelStage& stage, const Vec3& origin, DevicePlanes& points) {
  std::vector<int> texels;
  std::array<std::vector<float>, 3> values;
  for (std::size_t bone = 0; bone < stage.sources.patches.size(); ++bone) {
    const Rectangle& r = stage.sources.patches[bone].rectangle;
    for (const int end : {0, 1}) {
      const std::vector<Vec3>& end_points = stage.sources.end_points[bone][end];
      const int row = r.y + (end == 0 ? 0 : r.height - 1);
      for (int j = 0; j < r.width; ++j) {
        texels.push_back(row * stage.layout.width + r.x + j);
        const Vec3 p = (end_points.size() == 1 ? end_points[0] : end_points[j]) - origin;
        for (int i = 0; i < 3; ++i) values[i].push_back(static_cast<float>(p[i]));
      }
    }
  }
  stage.context.launch({"encode.cl", "place_points"}, ClRange(texels.size()), stage.texel_parameters(texels.size()),
                       stage.context.upload(texels),
                       upload_planes(stage.context, values[0], values[1], values[2]).values, points.values);
}

/// Texels of VSM patches that nothing holds read where they are; the points of the others become 0.
void read_surface(const TexelStage& stage, const ClBuffer<float>& offsets, ReadTexels& texels) {
  stage.context.launch({"encode.cl", "read_surface"}, row_range(stage.context, stage.mapped_rows.size),
                       stage.map_parameters(stage.mapped_rows.size), stage.mapped_rows, stage.layout.tables.patches,
                       stage.maps.triangles, stage.maps.values, offsets, texels.positions.anchors, texels.map_triangles,
                       texels.points.values);
}

/// VSM patches at the places of their texels.
/// \param missed  out, per bone
ReadTexels read_regular_grid(const TexelStage& stage, std::vector<int>& missed) {
  ClContext& context = stage.context;
  const DeviceLayout& layout = stage.layout;
  const DeviceMaps& maps = stage.maps;
  ReadTexels texels{clear_planes(context, layout.size()), even_positions(context, layout),
                    context.allocate<int>(layout.size())};
  context.fill(texels.map_triangles, kNoTriangle);
  if (!stage.has_maps()) return texels;
  // A CPU looks at each triangle once; a GPU needs more work-items for the rows of tall ones.
  const std::size_t shares = context.device().type == "cpu" ? 1 : 8;
  context.launch({"encode.cl", "cover_texels"}, ClRange(maps.sizes.triangle_count, shares), stage.map_parameters(0),
                 maps.triangles, maps.values, layout.tables.patches, texels.map_triangles);
  std::vector<int> map_triangles = context.download(texels.map_triangles);
  missed = fill_uncovered(stage.sources.patches, layout.width, map_triangles);
  context.write(texels.map_triangles, map_triangles);
  read_surface(stage, texels.positions.home, texels);
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
void place_spd_patches(const TexelStage& stage, DevicePlanes& points, TexelReport& report) {
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
  stage.context.launch({"encode.cl", "place_spd_points"}, layout.range(), stage.texel_parameters(0),
                       layout.texel_patches, stage.context.upload(distances), layout.tables.patches, layout.tables.rows,
                       layout.tables.columns, points.values);
}

UnfoldReport unfold(const TexelStage& stage, ReadTexels& texels) {
  const auto read_listed = [&](const ClBuffer<int>& listed, int first, int count) {
    MapParameters parameters = stage.map_parameters(count);
    parameters.first = first;
    stage.context.launch({"encode.cl", "read_listed"}, ClRange(count), parameters, listed, stage.layout.tables.patches,
                         stage.maps.triangles, stage.maps.values, texels.positions.home, texels.map_triangles,
                         texels.points.values);
  };
  return unfold_lattice(stage.context, stage.layout, stage.sources.patches, stage.maps, texels.map_triangles,
                        read_listed, texels.positions, texels.points);
}

/// Texels of VSM patches where they snap to.
ReadTexels snap(const TexelStage& stage, const ReadTexels& regular) {
  ClContext& context = stage.context;
  const DeviceSnapTables& features = *stage.sources.features;
  ReadTexels texels{{copy_of(context, regular.points.values), regular.points.count},
                    snap_positions(context, stage.layout, features, regular.positions),
                    copy_of(context, regular.map_triangles)};
  read_surface(stage, texels.positions.offsets, texels);
  MapParameters parameters = stage.map_parameters(0);
  parameters.vertex_count = features.vertex_count;
  context.launch({"encode.cl", "place_anchored"}, ClRange(stage.layout.size()), parameters, texels.positions.anchors,
                 texels.positions.offsets, features.points, stage.maps.values, texels.points.values);
  return texels;
}

/// A copy of the regular grid, to be fitted.
ReadTexels copy_of(const TexelStage& stage, const ReadTexels& regular) {
  ReadTexels texels = regular;
  texels.points.values = copy_of(stage.context, regular.points.values);
  stage.context.copy(regular.positions.home, texels.positions.offsets);
  return texels;
}

DevicePlanes prefilter(const TexelStage& stage, const DevicePlanes& points, const ClBuffer<int>& are_kept, int kept) {
  DevicePlanes filtered = clear_planes(stage.context, stage.layout.size());
  TexelParameters parameters = stage.texel_parameters(stage.all_rows.size);
  parameters.kept = kept;
  stage.context.launch({"encode.cl", "prefilter_positions"}, row_range(stage.context, stage.all_rows.size), parameters,
                       stage.all_rows, stage.layout.tables.patches, are_kept, points.values, filtered.values);
  return filtered;
}

/// Texels revert to the regular grid, as it would be stored.
/// \return what holds them then
std::vector<int> revert(const TexelStage& stage, const TexelOptions& options, std::span<const int> vertex_points,
                        const ReadTexels& regular, ReadTexels& texels, TexelReport& report) {
  ClContext& context = stage.context;
  const DevicePlanes stored =
      options.has_prefilter ? prefilter(stage, regular.points, regular.map_triangles, kNoneIsKept) : regular.points;
  const PlacedTexels grid =
      download_texels(context, stored, texels.positions.home, texels.positions.anchors, regular.map_triangles);
  PlacedTexels placed =
      download_texels(context, texels.points, texels.positions.offsets, texels.positions.anchors, texels.map_triangles);
  report.revert = revert_faults(context, *stage.sources.revert, vertex_points, grid, placed);
  texels.points = placed.on_device;
  return std::move(placed.anchors);
}

/// Texels of VSM patches snapped or fitted, with what then reverts.
ReadTexels place_texels(const TexelStage& stage, const TexelOptions& options, const ReadTexels& regular,
                        TexelReport& report) {
  ClContext& context = stage.context;
  const TexelSources& sources = stage.sources;
  std::vector<int> vertex_points;
  if (sources.features) {
    vertex_points = context.download(sources.features->points);
    vertex_points.resize(sources.features->vertex_count);
  }
  ReadTexels texels = sources.features ? snap(stage, regular) : copy_of(stage, regular);
  if (options.fit_steps > 0)
    report.fit = fit_points(context, stage.layout, stage.maps, texels.map_triangles, texels.positions, texels.points,
                            options.fit_steps);
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
    report.snap =
        report_snap(sources.features->vertex_count, sources.features->edge_count, report.fit ? 0 : reverted, anchors);
  return texels;
}

/// Points in bone tangent space: along, around, out.
DevicePlanes encode_points(const TexelStage& stage, const DevicePlanes& points) {
  const DeviceTables& tables = stage.layout.tables;
  DevicePlanes stored = clear_planes(stage.context, stage.layout.size());
  stage.context.launch({"encode.cl", "encode_texels"}, row_range(stage.context, stage.all_rows.size),
                       stage.texel_parameters(stage.all_rows.size), stage.all_rows, tables.patches, tables.rows,
                       tables.columns, points.values, stored.values);
  return stored;
}

/// The share of each VSM chart's triangles that a texel reads, on the regular grid or where it is placed.
void report_read(const TexelStage& stage, const ReadTexels& regular, const ReadTexels& placed, TexelReport& report) {
  std::vector<char> is_read(stage.maps.sizes.triangle_count, 0);
  for (const ClBuffer<int>& triangles : {regular.map_triangles, placed.map_triangles})
    for (const TriangleIndex triangle : stage.context.download(triangles))
      if (triangle != kNoTriangle) is_read[triangle] = 1;
  for (std::size_t bone = 0; bone < stage.sources.patches.size(); ++bone) {
    const int begin = stage.maps.first_triangle[bone], end = stage.maps.first_triangle[bone + 1];
    if (end > begin)
      report.sampled_triangle_fractions[bone] =
          static_cast<double>(std::count(is_read.begin() + begin, is_read.begin() + end, 1)) / (end - begin);
  }
}

}  // namespace

TexelResult read_texels(ClContext& context, const Skeleton& skeleton, const SeparationPlanes& separation,
                        const TexelSources& sources, int texture_width, int texture_height, const Vec3& origin,
                        const TexelOptions& options) {
  TexelResult result{{texture_width, texture_height, {}, {}, {}}, {}};
  TexelReport& report = result.report;
  report.sampled_triangle_fractions.resize(sources.patches.size(), 0);
  report.missed_texels.resize(sources.patches.size(), 0);
  const TexelStage stage = prepare_stage(context, skeleton, separation, sources, texture_width, texture_height, origin);

  ReadTexels regular = read_regular_grid(stage, report.missed_texels);
  if (has_spd(sources.patches)) place_spd_patches(stage, regular.points, report);
  place_end_rows(stage, origin, regular.points);
  if (options.has_unfold && stage.has_maps()) report.unfold = unfold(stage, regular);
  ReadTexels placed = regular;
  if (stage.has_maps() && (sources.features || options.fit_steps > 0))
    placed = place_texels(stage, options, regular, report);
  else if (options.has_prefilter)
    placed.points = prefilter(stage, regular.points, regular.map_triangles, kNoneIsKept);
  DevicePlanes stored = encode_points(stage, placed.points);
  if (options.half_rule)
    report.rounding = round_to_half(context, *options.half_rule, stage.patches(), stage.layout, placed.points, stored);
  report_read(stage, regular, placed, report);
  download_texels(context, stored, result.texture);
  return result;
}

}  // namespace skeletex
