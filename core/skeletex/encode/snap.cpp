// SPDX-License-Identifier: MIT
#include "skeletex/encode/snap.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>

#include "skeletex/model/parallel.h"
#include "skeletex/model/half_edge_table.h"

namespace skeletex {
namespace {

constexpr int kFirstRelaxPasses = 3, kRelaxPasses = 1;
constexpr int kEdgeRounds = 2;          // what one round has moved lets texels through that the fold test had stopped
constexpr double kFlat = 1e-6;          // radians: what rounding may make of a flat edge
constexpr double kFullDihedral = 0.5;   // radians: edges this sharp attract texels fully
constexpr int kRoundsBetweenReads = 3;  // of claims, between two looks at how many wait
constexpr double kLargestOffer = 8;     // cells: what lies further is rounded down to it
constexpr int kNoOffer = std::numeric_limits<int>::max();  // as in snap.cl

/// One work-item per vertex or edge, in groups of one size: PoCL compiles a kernel for every size that it meets.
ClRange over(int count) { return {{static_cast<std::size_t>(count), 1}, {64, 1}}; }

bool is_pole(ChartVertex kind) { return kind == ChartVertex::kHeadPole || kind == ChartVertex::kTailPole; }

/// Angle between unit normals, precise for small ones too.
double angle_between(const Vec3& a, const Vec3& b) { return std::atan2(a.cross(b).norm(), a.dot(b)); }

void add_features(const Chart& chart, const Patch& patch, int bone, int first_point, double least_dihedral, SnapFeatures& features) {
  const HalfEdgeTable table = link_half_edges(chart.triangles, static_cast<int>(chart.positions.size()));
  std::vector<Vec3> normals;
  for (const Triangle& t : chart.triangles)
    normals.push_back((chart.positions[t[1]] - chart.positions[t[0]]).cross(chart.positions[t[2]] - chart.positions[t[0]]).normalized());
  std::vector<double> rows(chart.u.size());
  for (std::size_t i = 0; i < rows.size(); ++i) rows[i] = row_of(patch.row_u, chart.u[i]);

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
    if (dihedral <= least_dihedral) continue;
    const double width = patch.rectangle.width;
    features.edges.push_back({bone,
                              {first_point + a, first_point + b},
                              {(chart.v[a] + chart.turns[t][c]) * width, (chart.v[b] + chart.turns[t][d]) * width},
                              {rows[a], rows[b]},
                              dihedral});
  }
  for (int i = 0; i < static_cast<int>(chart.positions.size()); ++i)
    if (chart.kinds[i] == ChartVertex::kInner && strengths[i] > 0)
      features.vertices.push_back({bone, first_point + i, chart.v[i] * patch.rectangle.width, rows[i], strengths[i]});
}

/// Edges that are near each other in the texture one after the other: the kernels read less of it at a time.
void append_by_row(const std::vector<SnapFeatures::Edge>& edges, int height, std::vector<SnapFeatures::Edge>& sorted) {
  const auto row = [&](const SnapFeatures::Edge& edge) { return std::clamp(static_cast<int>(edge.y[0]), 0, height - 1); };
  std::vector<std::size_t> next(height + 1, 0);
  for (const SnapFeatures::Edge& edge : edges) ++next[row(edge) + 1];
  std::partial_sum(next.begin(), next.end(), next.begin());
  const std::size_t begin = sorted.size();
  sorted.resize(begin + edges.size());
  for (const SnapFeatures::Edge& edge : edges) sorted[begin + next[row(edge)]++] = edge;
}

}  // namespace

double row_of(const std::vector<double>& row_u, double u) {
  const auto above = std::upper_bound(row_u.begin() + 1, row_u.end() - 1, u);
  const double low = *(above - 1), high = *above;
  return static_cast<double>(above - 1 - row_u.begin()) + (high > low ? (u - low) / (high - low) : 0);
}

SnapFeatures find_features(std::span<const Chart> charts, std::span<const Patch> patches, double least_dihedral) {
  std::vector<SnapFeatures> parts(charts.size());
  std::vector<int> first_points(charts.size());
  for (std::size_t bone = 0, points = 0; bone < charts.size(); ++bone) {
    first_points[bone] = static_cast<int>(points);
    if (patches[bone].method == Method::kVsm) points += charts[bone].positions.size();
  }
  for_each_block(charts.size(), 1, [&](std::size_t bone, std::size_t, std::size_t) {
    if (patches[bone].method == Method::kVsm) add_features(charts[bone], patches[bone], static_cast<int>(bone), first_points[bone], least_dihedral, parts[bone]);
  });
  SnapFeatures features;
  for (std::size_t bone = 0; bone < charts.size(); ++bone) {
    features.vertices.insert(features.vertices.end(), parts[bone].vertices.begin(), parts[bone].vertices.end());
    append_by_row(parts[bone].edges, patches[bone].rectangle.height, features.edges);
  }
  return features;
}

ReadingPositions even_positions(ClContext& context, const DeviceLayout& layout) {
  ReadingPositions positions{context.allocate<float>(layout.size()), context.allocate<float>(layout.size()), context.allocate<int>(layout.size()),
                             context.allocate<float>(layout.size()), context.allocate<float>(layout.size()), context.allocate<float>(layout.size())};
  for (ClBuffer<float>* plane : {&positions.x, &positions.y, &positions.home_x, &positions.home_y}) context.fill(*plane, 0.f);
  context.fill(positions.anchors, 0), context.fill(positions.parameters, 0.f);
  return positions;
}

namespace {

void snap_to_vertices(ClContext& context, const DeviceLayout& layout, const std::vector<SnapFeatures::Vertex>& vertices, ReadingPositions& positions) {
  if (vertices.empty()) return;
  const int count = static_cast<int>(vertices.size());
  std::vector<std::pair<double, int>> by_strength(count);
  for (int i = 0; i < count; ++i) by_strength[i] = {vertices[i].strength, i};
  std::sort(by_strength.begin(), by_strength.end());
  std::vector<int> ranks(count), vertex_patches(count);
  std::vector<float> xs(count), ys(count);
  for (int i = 0; i < count; ++i) {
    ranks[by_strength[i].second] = i + 1;
    vertex_patches[i] = vertices[i].patch;
    xs[i] = static_cast<float>(vertices[i].x);
    ys[i] = static_cast<float>(vertices[i].y);
  }
  const auto patch = context.upload(vertex_patches), rank = context.upload(ranks);
  const auto x = context.upload(xs), y = context.upload(ys);
  auto states = context.allocate<int>(count), claims = context.allocate<int>(layout.size()), open = context.allocate<int>(1);
  context.fill(states, 0);
  // A claim is more than all of the rounds before, so these need not be taken off.
  const int bits = std::bit_width(static_cast<unsigned>(count)), rounds_at_once = 0x7fffffff >> bits;
  // Every round decides at least the strongest claim that is open, so this ends; it takes some ten rounds.
  for (int round = 0, waiting = count; waiting > 0; waiting = context.download(open)[0])
    for (int i = 0; i < kRoundsBetweenReads; ++i, ++round) {
      const int least = round % rounds_at_once << bits;
      if (least == 0) context.fill(claims, 0);
      context.fill(open, 0);
      context.launch({"snap.cl", "claim_texels"}, over(count), count, layout.width, least, patch, x, y, rank, layout.patches, positions.anchors, states,
                     claims);
      context.launch({"snap.cl", "decide_claims"}, over(count), count, layout.width, least, patch, x, y, rank, layout.patches, claims, states,
                     positions.anchors, positions.x, positions.y, open);
    }
}

/// The rows that texels move in, even and odd ones apart, as in LatticeRow. Two rows and two columns apart texels do not look at each
/// other: with those of odd widths' last columns on their own these are six colours (colour_of in patch_texels.h).
struct ColouredRows {
  std::array<ClBuffer<LatticeRow>, 2> rows;
  bool has_odd_width = false;
};
ColouredRows colour_rows(ClContext& context, const DeviceLayout& layout) {
  const std::vector<PatchRecord> patches = context.download(layout.patches);
  ColouredRows coloured;
  std::array<std::vector<LatticeRow>, 2> rows;
  for (int patch = 0; patch < static_cast<int>(patches.size()); ++patch) {
    coloured.has_odd_width |= patches[patch].width % 2 == 1;
    for (int row = 1; row < patches[patch].height - 1; ++row) rows[row % 2].push_back({patch, row, 0, 0});
  }
  for (const int parity : {0, 1}) coloured.rows[parity] = context.upload(rows[parity]);
  return coloured;
}

/// Calls launch(rows, first column) for every colour.
template <class Launch>
void for_each_colour(const ColouredRows& coloured, const Launch& launch) {
  for (const auto& rows : coloured.rows)
    for (int first_column = 0; first_column < (coloured.has_odd_width ? 3 : 2); ++first_column) launch(rows, first_column);
}

void relax(ClContext& context, const DeviceLayout& layout, const ColouredRows& coloured, int passes, ReadingPositions& positions) {
  for (int pass = 0; pass < passes; ++pass)
    for_each_colour(coloured, [&](const ClBuffer<LatticeRow>& rows, int first_column) {
      context.launch({"snap.cl", "relax_texels"}, row_range(context, rows.size), static_cast<int>(rows.size), layout.width, first_column, rows,
                     layout.patches, positions.anchors, positions.x, positions.y, positions.x, positions.y);
    });
}

struct DeviceEdges {
  int count = 0;
  ClBuffer<int> patches;
  ClBuffer<float> ends, weights;
};
DeviceEdges upload_edges(ClContext& context, const std::vector<SnapFeatures::Edge>& edges) {
  std::vector<int> patches(edges.size());
  std::vector<float> ends(4 * edges.size()), weights(edges.size());
  for (std::size_t i = 0; i < edges.size(); ++i) {
    const SnapFeatures::Edge& edge = edges[i];
    patches[i] = edge.patch;
    for (const int k : {0, 1}) ends[4 * i + 2 * k] = static_cast<float>(edge.x[k]), ends[4 * i + 2 * k + 1] = static_cast<float>(edge.y[k]);
    weights[i] = static_cast<float>(std::sqrt(std::min(1.0, edge.dihedral / kFullDihedral)));
  }
  return {static_cast<int>(edges.size()), context.upload(patches), context.upload(ends), context.upload(weights)};
}

void snap_to_edges(ClContext& context, const DeviceLayout& layout, const ColouredRows& coloured, const DeviceEdges& edges, ReadingPositions& positions) {
  if (edges.count == 0) return;
  const int bits = std::bit_width(static_cast<unsigned>(edges.count));
  const auto scale = static_cast<float>((0x7fffffff >> bits) / kLargestOffer);
  auto offers = context.allocate<int>(layout.size());
  context.fill(offers, kNoOffer);
  context.launch({"snap.cl", "offer_edges"}, over(edges.count), edges.count, layout.width, bits, scale, edges.patches, edges.ends, edges.weights,
                 layout.patches, positions.anchors, positions.x, positions.y, offers);
  for_each_colour(coloured, [&](const ClBuffer<LatticeRow>& rows, int first_column) {
    context.launch({"snap.cl", "place_on_edges"}, row_range(context, rows.size), static_cast<int>(rows.size), layout.width, first_column, bits, rows,
                   layout.patches, edges.ends, offers, positions.anchors, positions.parameters, positions.x, positions.y);
  });
}

}  // namespace

void snap_positions(ClContext& context, const DeviceLayout& layout, const SnapFeatures& features, ReadingPositions& positions) {
  snap_to_vertices(context, layout, features.vertices, positions);
  const ColouredRows coloured = colour_rows(context, layout);
  const DeviceEdges edges = upload_edges(context, features.edges);
  for (int round = 0; round < kEdgeRounds; ++round) {
    relax(context, layout, coloured, round == 0 ? kFirstRelaxPasses : kRelaxPasses, positions);
    snap_to_edges(context, layout, coloured, edges, positions);
  }
  relax(context, layout, coloured, kRelaxPasses, positions);
}

void place_snapped(ClContext& context, const DeviceLayout& layout, const DeviceMaps& maps, const SnapFeatures& features,
                   const ReadingPositions& positions, TexelPoints& points) {
  std::vector<int> vertex_points, edge_points;
  for (const SnapFeatures::Vertex& vertex : features.vertices) vertex_points.push_back(vertex.point);
  for (const SnapFeatures::Edge& edge : features.edges) edge_points.insert(edge_points.end(), edge.points.begin(), edge.points.end());
  context.launch({"snap.cl", "place_snapped"}, layout.range(), layout.width, layout.height, positions.anchors, positions.parameters,
                 context.upload(vertex_points), context.upload(edge_points), maps.x, maps.y, maps.z, points.x, points.y, points.z);
}

TexelReturns::TexelReturns(ClContext& context, const DeviceLayout& layout)
    : marks(context.allocate<int>(layout.size())),
      back(context.allocate<int>(layout.size())),
      bad(context.allocate<int>(layout.size())),
      counts(context.allocate<int>(2)) {
  context.fill(marks, 0);
}

std::vector<int> put_back_listed(ClContext& context, const DeviceLayout& layout, const TexelPoints& even, const TexelPoints& before,
                                 const std::vector<int>& texels, bool with_vertices, TexelReturns& returns, ReadingPositions& positions, TexelPoints& points) {
  if (texels.empty()) return {};
  context.fill(returns.counts, 0);
  // One work-group: on a CPU one work-item.
  context.launch({"snap.cl", "put_listed_back"}, row_range(context, 1), static_cast<int>(texels.size()), static_cast<int>(with_vertices),
                 1 << ++returns.calls, layout.width, context.upload(texels), layout.texel_patches, layout.patches, even.x, even.y, even.z, before.x, before.y,
                 before.z, positions.home_x, positions.home_y, returns.marks, positions.anchors, positions.x, positions.y, points.x, points.y, points.z,
                 returns.back, returns.bad, returns.counts);
  std::vector<int> back(context.download(returns.counts)[0]);
  if (!back.empty()) context.queue().enqueueReadBuffer(returns.back.memory, CL_TRUE, 0, back.size() * sizeof(int), back.data());
  return back;
}

}  // namespace skeletex
