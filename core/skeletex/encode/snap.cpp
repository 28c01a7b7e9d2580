// SPDX-License-Identifier: MIT
#include "skeletex/encode/snap.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <numeric>

#include "skeletex/parameterize/half_edge_table.h"

namespace skeletex {
namespace {

constexpr int kColours = 6;
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

/// The row, with fractions, that reads at u.
double row_of(const std::vector<double>& row_u, double u) {
  const auto above = std::upper_bound(row_u.begin() + 1, row_u.end() - 1, u);
  const double low = *(above - 1), high = *above;
  return static_cast<double>(above - 1 - row_u.begin()) + (high > low ? (u - low) / (high - low) : 0);
}

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

}  // namespace

SnapFeatures find_features(std::span<const Chart> charts, std::span<const Patch> patches, double least_dihedral) {
  SnapFeatures features;
  int first_point = 0;
  for (std::size_t bone = 0; bone < charts.size(); ++bone) {
    if (patches[bone].method != Method::kVsm) continue;
    add_features(charts[bone], patches[bone], static_cast<int>(bone), first_point, least_dihedral, features);
    first_point += static_cast<int>(charts[bone].positions.size());
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
  std::vector<int> order(count), ranks(count), vertex_patches(count);
  std::vector<float> xs(count), ys(count);
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(), [&](int a, int b) { return vertices[a].strength < vertices[b].strength; });
  for (int i = 0; i < count; ++i) {
    ranks[order[i]] = i + 1;
    vertex_patches[i] = vertices[i].patch;
    xs[i] = static_cast<float>(vertices[i].x);
    ys[i] = static_cast<float>(vertices[i].y);
  }
  const auto patch = context.upload(vertex_patches), strength = context.upload(ranks);
  const auto x = context.upload(xs), y = context.upload(ys);
  auto states = context.allocate<int>(count), claims = context.allocate<int>(layout.size()), open = context.allocate<int>(1);
  context.fill(states, 0);
  // Every round decides at least the strongest claim that is open, so this ends; it takes some ten rounds.
  for (int waiting = count; waiting > 0; waiting = context.download(open)[0])
    for (int round = 0; round < kRoundsBetweenReads; ++round) {
      context.fill(open, 0);
      context.fill(claims, 0);
      context.launch({"snap.cl", "claim_texels"}, over(count), count, layout.width, patch, x, y, strength, layout.patches, positions.anchors, states, claims);
      context.launch({"snap.cl", "decide_claims"}, over(count), count, layout.width, patch, x, y, strength, layout.patches, claims, states,
                     positions.anchors, positions.x, positions.y, open);
    }
}

void relax(ClContext& context, const DeviceLayout& layout, int passes, ReadingPositions& positions) {
  for (int pass = 0; pass < passes; ++pass)
    for (int colour = 0; colour < kColours; ++colour)
      context.launch({"snap.cl", "relax_texels"}, layout.range(), layout.width, layout.height, colour, layout.texel_patches, layout.patches,
                     positions.anchors, positions.x, positions.y);
}

void snap_to_edges(ClContext& context, const DeviceLayout& layout, const std::vector<SnapFeatures::Edge>& edges, ReadingPositions& positions) {
  if (edges.empty()) return;
  std::vector<int> edge_patches;
  std::vector<float> ends, weights;
  for (const SnapFeatures::Edge& edge : edges) {
    edge_patches.push_back(edge.patch);
    for (const int i : {0, 1}) ends.push_back(static_cast<float>(edge.x[i])), ends.push_back(static_cast<float>(edge.y[i]));
    weights.push_back(static_cast<float>(std::sqrt(std::min(1.0, edge.dihedral / kFullDihedral))));
  }
  const int count = static_cast<int>(edges.size());
  const auto patch = context.upload(edge_patches);
  const auto device_ends = context.upload(ends), weight = context.upload(weights);
  const int bits = std::bit_width(static_cast<unsigned>(count));
  const auto scale = static_cast<float>((0x7fffffff >> bits) / kLargestOffer);
  auto offers = context.allocate<int>(layout.size());
  context.fill(offers, kNoOffer);
  context.launch({"snap.cl", "offer_edges"}, over(count), count, layout.width, bits, scale, patch, device_ends, weight, layout.patches, positions.anchors,
                 positions.x, positions.y, offers);
  for (int colour = 0; colour < kColours; ++colour)
    context.launch({"snap.cl", "place_on_edges"}, layout.range(), layout.width, layout.height, colour, bits, layout.texel_patches, layout.patches, device_ends,
                   offers, positions.anchors, positions.parameters, positions.x, positions.y);
}

}  // namespace

void snap_positions(ClContext& context, const DeviceLayout& layout, const SnapFeatures& features, ReadingPositions& positions) {
  snap_to_vertices(context, layout, features.vertices, positions);
  for (int round = 0; round < kEdgeRounds; ++round) {
    relax(context, layout, round == 0 ? kFirstRelaxPasses : kRelaxPasses, positions);
    snap_to_edges(context, layout, features.edges, positions);
  }
  relax(context, layout, kRelaxPasses, positions);
}

void place_snapped(ClContext& context, const DeviceLayout& layout, const DeviceMaps& maps, const SnapFeatures& features,
                   const ReadingPositions& positions, TexelPoints& points) {
  std::vector<int> vertex_points, edge_points;
  for (const SnapFeatures::Vertex& vertex : features.vertices) vertex_points.push_back(vertex.point);
  for (const SnapFeatures::Edge& edge : features.edges) edge_points.insert(edge_points.end(), edge.points.begin(), edge.points.end());
  context.launch({"snap.cl", "place_snapped"}, layout.range(), layout.width, layout.height, positions.anchors, positions.parameters,
                 context.upload(vertex_points), context.upload(edge_points), maps.x, maps.y, maps.z, points.x, points.y, points.z);
}

int put_back_marked(ClContext& context, const DeviceLayout& layout, const TexelPoints& even, const TexelPoints& before, const ClBuffer<int>& marks,
                    bool with_vertices, ReadingPositions& positions, TexelPoints& points) {
  auto is_bad = context.allocate<int>(layout.size()), is_back = context.allocate<int>(layout.size());
  auto bad = context.allocate<int>(layout.size()), changed = context.allocate<int>(layout.size());
  auto counts = context.allocate<int>(2);  // of the lists of bad quads and of changed texels
  context.fill(is_bad, 0), context.fill(is_back, 0), context.fill(counts, 0);
  context.launch({"snap.cl", "put_marked_back"}, layout.range(), layout.width, layout.height, static_cast<int>(with_vertices), marks, layout.texel_patches,
                 layout.patches, before.x, before.y, before.z, positions.home_x, positions.home_y, is_back, positions.anchors, positions.x, positions.y,
                 points.x, points.y, points.z, changed, counts);
  int total = 0;
  // Texels only ever go back, so this ends.
  for (int waiting = context.download(counts)[1]; waiting > 0; waiting = context.download(counts)[1]) {
    total += waiting;
    context.fill(counts, 0);
    context.launch({"snap.cl", "find_bad_around"}, over(4 * waiting), waiting, layout.width, changed, layout.texel_patches, layout.patches, positions.x,
                   positions.y, even.x, even.y, even.z, points.x, points.y, points.z, is_bad, bad, counts);
    const int quads = context.download(counts)[0];
    if (quads == 0) break;
    context.launch({"snap.cl", "put_back"}, over(4 * quads), quads, layout.width, bad, layout.texel_patches, layout.patches, before.x, before.y, before.z,
                   positions.home_x, positions.home_y, is_bad, is_back, positions.anchors, positions.x, positions.y, points.x, points.y, points.z, changed,
                   counts);
  }
  return total;
}

}  // namespace skeletex
