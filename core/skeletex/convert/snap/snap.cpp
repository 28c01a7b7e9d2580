// SPDX-License-Identifier: MIT
#include "skeletex/convert/snap/snap.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <bit>
#include <cmath>
#include <numeric>
#include <utility>

#include "skeletex/geometry/half_edge_table.h"
#include "skeletex/geometry/parallel.h"
#include "skeletex/math/portable.h"
#include "skeletex/model/error.h"

namespace skeletex {
namespace {

constexpr int kBinWidth = SNAP_BIN_WIDTH;
constexpr int kBinHeight =
    2;  // an edge is listed in fewer of them, and they list hardly more edges than bins of one row would

constexpr int kEdgeRounds = 2;         // what one round has moved lets texels through that the fold test had stopped
constexpr double kFlat = 1e-6;         // radians: what rounding may make of a flat edge
constexpr double kFullDihedral = 0.5;  // radians: edges this sharp attract texels fully
constexpr int kWideRounds = 2;         // of reservations with a work-item per vertex; hardly any are open after them

/// One work-item per vertex or edge, in groups of one size: PoCL compiles a kernel for every size that it meets.
ClRange over(int count) { return {{static_cast<std::size_t>(count), 1}, {64, 1}}; }

/// Angle between unit normals, precise for small ones too.
double angle_between(const Vec3& a, const Vec3& b) { return portable::atan2(a.cross(b).norm(), a.dot(b)); }

/// std::floor is a call.
int floor_of(double x) { return static_cast<int>(x) - (x < static_cast<int>(x)); }

/// \param vertices  out, without ranks
void add_features(const Chart& chart, double least_dihedral, std::vector<MapFeatures::Vertex>& vertices,
                  std::vector<MapFeatures::Edge>& edges) {
  const HalfEdgeTable& table = chart.half_edges;
  std::vector<Vec3> normals;
  normals.reserve(chart.triangles.size()), edges.reserve(3 * chart.triangles.size() / 2),
      vertices.reserve(chart.positions.size());
  for (const Triangle& t : chart.triangles)
    normals.push_back((chart.positions[t[1]] - chart.positions[t[0]])
                          .cross(chart.positions[t[2]] - chart.positions[t[0]])
                          .normalized());

  std::vector<double> strengths(chart.positions.size(), 0);
  for (int h = 0; h < static_cast<int>(table.twins.size()); ++h) {
    if (table.twins[h] < h) continue;  // boundaries, and the other half of an edge
    const int t = h / 3, c = h % 3, d = (c + 1) % 3;
    const int a = chart.triangles[t][c], b = chart.triangles[t][d];
    if (is_pole(chart.kinds[a]) || is_pole(chart.kinds[b])) continue;
    const double dihedral = angle_between(normals[t], normals[table.twins[h] / 3]);
    if (!(dihedral > kFlat)) continue;
    const double weight = dihedral * (chart.positions[b] - chart.positions[a]).norm();
    strengths[a] += weight;
    strengths[b] += weight;
    if (dihedral > least_dihedral) edges.push_back({{a, b}, {chart.turns[t][c], chart.turns[t][d]}, dihedral});
  }
  for (int i = 0; i < static_cast<int>(chart.positions.size()); ++i)
    if (chart.kinds[i] == ChartVertex::kInner && strengths[i] > 0) vertices.push_back({i, strengths[i]});
}

/// The order of things by the bins that they lie in, and there as they come: kernels come by texels in nearly that
/// order.
/// \param x, y  cells of the patch
template <class X, class Y>
std::vector<int> order_by_place(int count, const Rectangle& r, const X& x, const Y& y) {
  const int bins = (r.width + kBinWidth - 1) / kBinWidth;
  std::vector<int> places, next(static_cast<std::size_t>(r.height) * bins + 1, 0), order(count);
  places.reserve(count);
  for (int i = 0; i < count; ++i) {
    const int row = std::clamp(static_cast<int>(y(i)), 0, r.height - 1);
    places.push_back(row * bins + wrapped(floor_of(x(i)), r.width) / kBinWidth);
    ++next[places.back() + 1];
  }
  std::partial_sum(next.begin(), next.end(), next.begin());
  for (int i = 0; i < count; ++i) order[next[places[i]]++] = i;
  return order;
}

}  // namespace

std::vector<double> rows_of(const std::vector<double>& row_u, std::span<const double> u) {
  // From where to look for the first row above: no row before that is in as high a share of [0, 1].
  const int last = static_cast<int>(row_u.size()) - 1, shares = 2 * last;
  const auto share_of = [&](double x) { return std::clamp(static_cast<int>(x * shares), 0, shares - 1); };
  std::vector<int> firsts(shares);
  for (int share = 0, row = 1; share < shares; ++share) {
    while (row < last && share_of(row_u[row]) < share) ++row;
    firsts[share] = row;
  }
  std::vector<double> rows;
  rows.reserve(u.size());
  for (const double own : u) {
    int above = firsts[share_of(own)];
    while (above < last && row_u[above] <= own) ++above;
    const double low = row_u[above - 1], high = row_u[above];
    rows.push_back(above - 1 + (high > low ? (own - low) / (high - low) : 0));
  }
  return rows;
}

MapFeatures find_features(std::span<const Chart> charts, std::span<const Method> methods, double least_dihedral) {
  MapFeatures features;
  features.vertices.resize(charts.size()), features.edges.resize(charts.size());
  for (std::size_t bone = 0; bone < charts.size(); ++bone)
    if (!is_height_field(methods[bone]))
      add_features(charts[bone], least_dihedral, features.vertices[bone], features.edges[bone]);
  rank_vertices(features);
  return features;
}

void rank_vertices(MapFeatures& features) {
  struct Strength {
    double strength;
    std::size_t bone, number;
    auto operator<=>(const Strength&) const = default;
  };
  std::vector<Strength> strengths;
  for (std::size_t bone = 0; bone < features.vertices.size(); ++bone)
    for (std::size_t i = 0; i < features.vertices[bone].size(); ++i)
      strengths.push_back({features.vertices[bone][i].strength, bone, i});
  std::sort(strengths.begin(), strengths.end());
  for (std::size_t i = 0; i < strengths.size(); ++i)
    features.vertices[strengths[i].bone][strengths[i].number].rank = static_cast<int>(i) + 1;
}

SnapFeatures place_features(const MapFeatures& features, std::span<const Chart> charts,
                            std::span<const Patch> patches) {
  SnapFeatures placed;
  std::size_t vertex_count = 0, edge_count = 0;
  for (const auto& vertices : features.vertices) vertex_count += vertices.size();
  for (const auto& edges : features.edges) edge_count += edges.size();
  placed.vertices.reserve(vertex_count), placed.edges.reserve(edge_count);
  int first_point = 0;
  for (BoneIndex bone = 0; bone < static_cast<int>(charts.size()); ++bone) {
    if (is_height_field(patches[bone].method)) continue;
    const Chart& chart = charts[bone];
    const Rectangle& r = patches[bone].rectangle;
    const std::vector<double> rows = rows_of(patches[bone].row_u, chart.u);
    const std::span<const MapFeatures::Vertex> vertices = features.vertices[bone];
    for (const int i : order_by_place(
             static_cast<int>(vertices.size()), r, [&](int i) { return chart.v[vertices[i].vertex] * r.width; },
             [&](int i) { return rows[vertices[i].vertex]; })) {
      const int at = vertices[i].vertex;
      placed.vertices.push_back({bone, first_point + at, chart.v[at] * r.width, rows[at], vertices[i].rank});
    }
    const std::span<const MapFeatures::Edge> edges = features.edges[bone];
    const auto x_of = [&](int i, int end) { return (chart.v[edges[i].vertices[end]] + edges[i].turns[end]) * r.width; };
    for (const int i : order_by_place(
             static_cast<int>(edges.size()), r, [&](int i) { return std::min(x_of(i, 0), x_of(i, 1)); },
             [&](int i) { return std::min(rows[edges[i].vertices[0]], rows[edges[i].vertices[1]]); })) {
      const auto [a, b] = edges[i].vertices;
      placed.edges.push_back(
          {bone, {first_point + a, first_point + b}, {x_of(i, 0), x_of(i, 1)}, {rows[a], rows[b]}, edges[i].dihedral});
    }
    first_point += static_cast<int>(chart.positions.size());
  }
  return placed;
}

namespace {

/// All at their places.
ReadingPositions positions_of(ClContext& context, const DeviceLayout& layout, ClBuffer<float> home) {
  ReadingPositions positions{context.allocate<float>(3 * layout.size()), context.allocate<int>(layout.size()),
                             std::move(home)};
  context.fill(positions.offsets, 0.f), context.fill(positions.anchors, 0);
  return positions;
}

}  // namespace

ReadingPositions even_positions(ClContext& context, const DeviceLayout& layout) {
  auto home = context.allocate<float>(2 * layout.size());
  context.fill(home, 0.f);
  return positions_of(context, layout, home);
}

namespace {

constexpr int kMostTurns = 8;
constexpr double kReach =
    0.7 + 0.5;  // cells along each axis from a free texel's own place to an edge that it can go to
constexpr double kLeastClipped =
    3;  // columns that an edge has to span before it pays to look at each band's part alone

/// Bands of inner rows, and bins of each.
struct BinCounts {
  int bands, across;
};
BinCounts bins_of(const Rectangle& r) {
  return {(std::max(0, r.height - 2) + kBinHeight - 1) / kBinHeight, (r.width + kBinWidth - 1) / kBinWidth};
}
int band_of(int row) { return (row - 1) / kBinHeight; }

/// The even and odd inner rows of VSM patches with their first bins. Two rows apart texels do not look at each other.
/// \return how many bins there are
int list_rows(std::span<const Patch> patches, std::array<std::vector<LatticeRow>, 2>& rows) {
  int bins = 0;
  for (std::size_t bone = 0; bone < patches.size(); ++bone) {
    if (is_height_field(patches[bone].method)) continue;
    const Rectangle& r = patches[bone].rectangle;
    const BinCounts counts = bins_of(r);
    for (int row = 1; row < r.height - 1; ++row)
      rows[row % 2].push_back({static_cast<int>(bone), row, bins + band_of(row) * counts.across, 0});
    bins += counts.bands * counts.across;
  }
  return bins;
}

/// Calls act(bin, turn of v) for the bins of a patch whose texels an edge can reach, band by band; bins count from the
/// patch's first.
template <class Act>
void for_each_bin(const SnapFeatures::Edge& edge, int width, int height, const Act& act) {
  const int bins = (width + kBinWidth - 1) / kBinWidth;
  const auto for_columns = [&](int first_band, int last_band, double low_x, double high_x) {
    const int first = -floor_of(kReach - low_x), last = std::min(floor_of(high_x + kReach), first + width - 1);
    int turn = static_cast<int>(low_x) / width;
    while (first < turn * width) --turn;
    while (first >= (turn + 1) * width) ++turn;
    for (int begin = first - turn * width; turn * width <= last; ++turn, begin = 0) {
      if (turn < -kMostTurns || turn >= kMostTurns) continue;
      const int first_bin = begin / kBinWidth, last_bin = std::min(last - turn * width, width - 1) / kBinWidth;
      for (int band = first_band; band <= last_band; ++band)
        for (int bin = first_bin; bin <= last_bin; ++bin) act(band * bins + bin, turn);
    }
  };
  const auto [low_x, high_x] = std::minmax(edge.x[0], edge.x[1]);
  const auto [low_y, high_y] = std::minmax(edge.y[0], edge.y[1]);
  const int first_row = std::max(1, -floor_of(kReach - low_y)),
            last_row = std::min(height - 2, floor_of(high_y + kReach));
  if (last_row < first_row) return;
  const int first_band = band_of(first_row), last_band = band_of(last_row);
  if (high_x - low_x < kLeastClipped || high_y - low_y < kReach)
    return for_columns(first_band, last_band, low_x, high_x);
  // The part of the edge near each band.
  const double slope = (edge.x[1] - edge.x[0]) / (edge.y[1] - edge.y[0]);
  for (int band = first_band; band <= last_band; ++band) {
    const double low = kBinHeight * band + 1 - kReach, high = kBinHeight * (band + 1) + kReach;
    const double a = edge.x[0] + slope * (std::max(low, low_y) - edge.y[0]),
                 b = edge.x[0] + slope * (std::min(high, high_y) - edge.y[0]);
    for_columns(band, band, std::min(a, b), std::max(a, b));
  }
}

SnapEdge edge_record(const SnapFeatures::Edge& edge, int number, int turn, int width) {
  const auto x0 = static_cast<float>(edge.x[0] - turn * width), y0 = static_cast<float>(edge.y[0]);
  const auto ex = static_cast<float>(edge.x[1] - edge.x[0]), ey = static_cast<float>(edge.y[1] - edge.y[0]);
  const float length2 = ex * ex + ey * ey, inverse = length2 > 0 ? -1 / length2 : 0;
  return {
      x0,    y0, ex, ey, inverse * ex, inverse * ey, static_cast<float>(std::max(1.0, kFullDihedral / edge.dihedral)),
      number};
}

/// Lists the edges of each bin, patch after patch, once for each turn of v at which it lies next to texels.
void fill_bins(const std::vector<SnapFeatures::Edge>& edges, std::span<const Patch> patches, int bin_count,
               SnapTables& tables) {
  struct Entry {
    int bin, edge;
  };
  std::vector<Entry> entries;
  tables.bin_edges.reserve(8 * edges.size()), tables.edges.reserve(edges.size() + edges.size() / 8);
  std::vector<int>& begins = tables.bin_begins;
  begins.assign(bin_count + 1, 0);
  int first_bin = 0;
  auto edge = edges.begin();
  for (std::size_t bone = 0; bone < patches.size(); ++bone) {
    if (is_height_field(patches[bone].method)) continue;
    const Rectangle& r = patches[bone].rectangle;
    const int bins = bins_of(r).bands * bins_of(r).across;
    int* const counts = begins.data() + first_bin;
    entries.clear();
    for (; edge != edges.end() && edge->patch == static_cast<int>(bone); ++edge) {
      std::array<int, 2 * kMostTurns> records;
      records.fill(-1);
      for_each_bin(*edge, r.width, r.height, [&](int bin, int turn) {
        int& record = records[kMostTurns + turn];
        if (record < 0) {
          record = static_cast<int>(tables.edges.size());
          tables.edges.push_back(edge_record(*edge, static_cast<int>(edge - edges.begin()), turn, r.width));
        }
        entries.push_back({bin, record});
        ++counts[bin];
      });
    }
    int begin = static_cast<int>(tables.bin_edges.size());
    for (int bin = 0; bin < bins; ++bin) begin += std::exchange(counts[bin], begin);
    tables.bin_edges.resize(begin);
    for (const Entry& entry : entries) tables.bin_edges[counts[entry.bin]++] = entry.edge;
    // What was the begin of each bin has become its end.
    first_bin += bins;
  }
  std::copy_backward(begins.begin(), begins.end() - 1, begins.end());
  begins[0] = 0;
}

/// \param reservations  0
/// \param snapped       by colour
void snap_to_vertices(ClContext& context, const DeviceLayout& layout, const DeviceSnapTables& tables,
                      ClBuffer<int>& reservations, ReadingPositions& snapped) {
  const int count = tables.vertex_count;
  if (count == 0) return;
  auto states = context.allocate<int>(count), open = context.allocate<int>(2 * static_cast<std::size_t>(count));
  context.fill(states, 0);
  // A reservation is more than all of the rounds before, so these need not be taken off.
  SnapParameters parameters{layout.width, static_cast<int>(layout.size()), count, 0, 0, 0, 0};
  parameters.step = 1 << std::bit_width(static_cast<unsigned>(count));
  for (int round = 0; round < kWideRounds; ++round, parameters.least += parameters.step) {
    context.launch({"snap.cl", "reserve_texels"}, over(count), parameters, tables.vertices, layout.tables.patches,
                   snapped.anchors, states, reservations);
    context.launch({"snap.cl", "decide_reservations"}, over(count), parameters, tables.vertices, layout.tables.patches,
                   reservations, states, snapped.anchors, snapped.offsets);
  }
  // One work-group: on a CPU one work-item.
  context.launch({"snap.cl", "decide_the_rest"}, row_range(context, 1), parameters, tables.vertices,
                 layout.tables.patches, reservations, states, snapped.anchors, snapped.offsets, open);
}

}  // namespace

SnapTables tables_of(const SnapFeatures& features, std::span<const Patch> patches) {
  SnapTables tables;
  tables.edge_points.reserve(features.edges.size());
  for (const SnapFeatures::Vertex& vertex : features.vertices) {
    tables.vertices.push_back({static_cast<float>(vertex.x), static_cast<float>(vertex.y), vertex.patch, vertex.rank});
    tables.vertex_points.push_back(vertex.point);
  }
  for (const SnapFeatures::Edge& edge : features.edges) tables.edge_points.push_back(edge.points);
  const int bins = list_rows(patches, tables.rows);
  fill_bins(features.edges, patches, bins, tables);
  return tables;
}

DeviceSnapTables upload_tables(ClContext& context, const SnapTables& tables) {
  std::vector<int> points = tables.vertex_points, bins = tables.bin_begins;
  for (const auto& ends : tables.edge_points) points.insert(points.end(), ends.begin(), ends.end());
  bins.insert(bins.end(), tables.bin_edges.begin(), tables.bin_edges.end());
  return {static_cast<int>(tables.vertices.size()),
          static_cast<int>(tables.edge_points.size()),
          context.upload(tables.vertices),
          context.upload(points),
          context.upload(tables.edges),
          {context.upload(tables.rows[0]), context.upload(tables.rows[1])},
          context.upload(bins),
          static_cast<int>(tables.bin_begins.size()) - 1};
}

ReadingPositions snap_positions(ClContext& context, const DeviceLayout& layout, const DeviceSnapTables& tables,
                                const ReadingPositions& positions) {
  // Inner rows of VSM patches have their even columns first while texels snap.
  ReadingPositions by_colour = positions_of(context, layout, {}),
                   snapped = positions_of(context, layout, positions.home);
  const auto for_rows = [&](const char* kernel, int parity, bool is_again, const auto&... arguments) {
    const std::size_t count = tables.rows[parity].size;
    context.launch({"snap.cl", kernel}, row_range(context, count),
                   SnapParameters{layout.width, static_cast<int>(layout.size()), static_cast<int>(count), 0, 0,
                                  tables.bin_count, is_again},
                   tables.rows[parity], layout.tables.patches, arguments...);
  };
  for (const int parity : {0, 1}) for_rows("part_colours", parity, false, positions.home, by_colour.offsets);
  auto spare = context.allocate<int>(layout.size());
  context.fill(spare, 0);
  snap_to_vertices(context, layout, tables, spare, by_colour);
  const auto targets = context.allocate<float>(2 * layout.size());
  for (int round = 0; round < (tables.edge_count == 0 ? 0 : kEdgeRounds); ++round)
    for (const int parity : {0, 1})
      for_rows("place_on_edges", parity, round > 0, tables.bins, tables.edges, by_colour.anchors, by_colour.offsets,
               spare, targets);
  for (const int parity : {0, 1})
    for_rows("join_colours", parity, false, by_colour.offsets, by_colour.anchors, snapped.offsets, snapped.anchors);
  return snapped;
}

}  // namespace skeletex
