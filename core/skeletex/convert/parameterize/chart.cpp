// SPDX-License-Identifier: MIT
#include "skeletex/convert/parameterize/chart.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <queue>

#include "skeletex/geometry/loop_turns.h"
#include "skeletex/model/error.h"

namespace skeletex {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
/// A pole's hit this close to a vertex or an edge (in barycentric units) is moved onto it: no needle triangles.
constexpr double kPoleSnap = 1e-3;

bool is_row(ChartVertex kind) { return kind == ChartVertex::kHeadRow || kind == ChartVertex::kTailRow; }

/// One boundary row: lifted angles, first as measured, then made strictly increasing.
struct Row {
  std::vector<int> vertices;
  std::vector<double> measured;  ///< lifted from the first vertex's angle on
  std::vector<double> lifted;    ///< the row's v before wrapping
};

Row make_row(const BoundaryLoop& loop, const Segment& segment, const Skeleton& skeleton,
             const SeparationPlanes& separation, BoneEnd end) {
  const Vec3& node = end_position(skeleton, segment.bone, end);
  const int count = static_cast<int>(loop.vertices.size());
  Row row;
  row.vertices = loop.vertices;
  std::vector<double> turns;
  std::vector<Vec3> points;
  for (const int v : loop.vertices) {
    points.push_back(segment.mesh.positions[v]);
    turns.push_back(separation.turn_of(segment.bone, points.back() - node));
  }
  double lift = turns.empty() ? 0 : turns[0];
  for (int i = 0; i < count; ++i) {
    row.measured.push_back(lift);
    lift += shortest_turn(turns[(i + 1) % count] - turns[i]);
  }
  std::optional<std::vector<double>> lifted = loop_turns(points, turns);
  if (!lifted)
    throw TopologyError(
        fmt::format("bone \"{}\": its segment's boundary at node \"{}\" winds {:.0f} times around the bone instead of "
                    "once; move the node "
                    "to the middle of the body",
                    skeleton.bones[segment.bone].name, skeleton.nodes[end_node(skeleton, segment.bone, end)].name,
                    count < 3 ? 0.0 : lift - turns[0]),
        segment.bone, end_node(skeleton, segment.bone, end));
  row.lifted = std::move(*lifted);
  return row;
}

int index_of(const Triangle& t, VertexIndex vertex) {
  return t[0] == vertex ? 0 : t[1] == vertex ? 1 : t[2] == vertex ? 2 : -1;
}

/// The corner of `t` from which the edge from -> to starts; -1 when it has none.
int corner_of_edge(const Triangle& t, int from, int to) {
  const int c = index_of(t, from);
  return c >= 0 && t[(c + 1) % 3] == to ? c : -1;
}

int add_vertex(Chart& chart, const Vec3& position, ChartVertex kind) {
  chart.positions.push_back(position);
  chart.kinds.push_back(kind);
  return static_cast<int>(chart.positions.size()) - 1;
}

/// Replaces triangle t by two, with `middle` on the edge that starts at its corner c.
void split_triangle(Chart& chart, int t, int c, int middle) {
  const Triangle old = chart.triangles[t];
  chart.triangles[t] = {old[c], middle, old[(c + 2) % 3]};
  chart.triangles.push_back({middle, old[(c + 1) % 3], old[(c + 2) % 3]});
}

/// Puts a pole where the ray from the free node along the bone, outwards, leaves the chart's surface last.
void insert_pole(Chart& chart, const Skeleton& skeleton, const SeparationPlanes& separation, BoneEnd end) {
  const bool is_tail = end == BoneEnd::kTail;
  const BoneBasis& basis = separation.bases()[chart.bone];
  const Vec3& node = end_position(skeleton, chart.bone, end);
  const Vec3 direction = is_tail ? basis.o : Vec3(-basis.o);
  const ChartVertex kind = is_tail ? ChartVertex::kTailPole : ChartVertex::kHeadPole;

  // Seen along the bone; a shared edge gets exactly opposite edge functions, so no ray slips between two triangles.
  std::vector<std::array<double, 3>> seen(chart.positions.size());
  for (std::size_t v = 0; v < seen.size(); ++v) {
    const Vec3 p = chart.positions[v] - node;
    seen[v] = {p.dot(basis.s), p.dot(basis.b), p.dot(direction)};
  }
  const auto edge = [&](int a, int b) { return seen[a][0] * seen[b][1] - seen[a][1] * seen[b][0]; };
  int hit = -1;
  double farthest = 0;
  std::array<double, 3> weights{};
  for (int t = 0; t < static_cast<int>(chart.triangles.size()); ++t) {
    const Triangle& tri = chart.triangles[t];
    std::array<double, 3> w{edge(tri[1], tri[2]), edge(tri[2], tri[0]), edge(tri[0], tri[1])};
    const double total = w[0] + w[1] + w[2];
    if (total == 0 || std::min({w[0] / total, w[1] / total, w[2] / total}) < 0) continue;
    double depth = 0;
    for (int c = 0; c < 3; ++c) depth += (w[c] /= total) * seen[tri[c]][2];
    if (depth > farthest) {
      farthest = depth;
      hit = t;
      weights = w;
    }
  }
  if (hit < 0)
    throw TopologyError(
        fmt::format("bone \"{}\": the ray from its free end \"{}\" along the bone misses the bone's own surface; turn "
                    "the bone or move "
                    "the node so that it points at the tip",
                    skeleton.bones[chart.bone].name, skeleton.nodes[end_node(skeleton, chart.bone, end)].name),
        chart.bone, end_node(skeleton, chart.bone, end));

  const Triangle tri = chart.triangles[hit];
  const int nearest = static_cast<int>(std::max_element(weights.begin(), weights.end()) - weights.begin());
  const auto is_fixed = [&](int c) { return chart.kinds[tri[c]] != ChartVertex::kInner; };
  if (weights[nearest] > 1 - 2 * kPoleSnap && !is_fixed(nearest)) {
    chart.kinds[tri[nearest]] = kind;
    return;
  }
  const int opposite = static_cast<int>(std::min_element(weights.begin(), weights.end()) - weights.begin());
  const int a = tri[(opposite + 1) % 3], b = tri[(opposite + 2) % 3];
  int other = -1;
  if (weights[opposite] < kPoleSnap)
    for (int t = 0; t < static_cast<int>(chart.triangles.size()) && other < 0; ++t)
      if (corner_of_edge(chart.triangles[t], b, a) >= 0) other = t;
  for (double& w : weights) w = std::max(w, kPoleSnap);  // off boundary vertices and edges
  if (other >= 0) weights[opposite] = 0;
  const double total = weights[0] + weights[1] + weights[2];
  Vec3 position = Vec3::Zero();
  for (int c = 0; c < 3; ++c) position += weights[c] / total * chart.positions[tri[c]];
  const int pole = add_vertex(chart, position, kind);
  if (other >= 0) {
    split_triangle(chart, hit, (opposite + 1) % 3, pole);
    split_triangle(chart, other, corner_of_edge(chart.triangles[other], b, a), pole);
  } else {
    chart.triangles[hit] = {tri[0], tri[1], pole};
    chart.triangles.push_back({tri[1], tri[2], pole});
    chart.triangles.push_back({tri[2], tri[0], pole});
  }
}

/// Splits every inner edge that joins two vertices of one row, or the two poles: between fixed vertices on one line it
/// would carry triangles of no area. Three vertices of one row always have such an edge between two of them.
void split_chords(Chart& chart) {
  const auto is_chord = [&](int a, int b) {
    const ChartVertex ka = chart.kinds[a], kb = chart.kinds[b];
    return (is_row(ka) && ka == kb) || (is_pole(ka) && is_pole(kb));
  };
  // Both triangles of a chord are among the few that have two such corners.
  std::map<std::array<int, 2>, int> owners;  // directed chord -> triangle
  const auto enter = [&](int t) {
    const Triangle& tri = chart.triangles[t];
    for (int c = 0; c < 3; ++c)
      if (is_chord(tri[c], tri[(c + 1) % 3])) owners[{tri[c], tri[(c + 1) % 3]}] = t;
  };
  for (int t = 0; t < static_cast<int>(chart.triangles.size()); ++t) enter(t);
  while (!owners.empty()) {
    const auto [edge, t] = *owners.begin();
    owners.erase(owners.begin());
    const auto twin = owners.find({edge[1], edge[0]});
    if (twin == owners.end()) continue;  // an edge of the loop itself
    const int u = twin->second;
    owners.erase(twin);
    const int middle =
        add_vertex(chart, 0.5 * (chart.positions[edge[0]] + chart.positions[edge[1]]), ChartVertex::kInner);
    for (const auto& [triangle, from, to] : {std::array{t, edge[0], edge[1]}, std::array{u, edge[1], edge[0]}}) {
      split_triangle(chart, triangle, corner_of_edge(chart.triangles[triangle], from, to), middle);
      enter(triangle);
      enter(static_cast<int>(chart.triangles.size()) - 1);
    }
  }
}

/// Distance of an edge from the bone's axis, seen along the axis.
double axis_distance(const std::array<double, 2>& a, const std::array<double, 2>& b) {
  const double dx = b[0] - a[0], dy = b[1] - a[1], squared = dx * dx + dy * dy;
  const double t = squared > 0 ? std::clamp(-(a[0] * dx + a[1] * dy) / squared, 0.0, 1.0) : 0.0;
  return std::hypot(a[0] + t * dx, a[1] + t * dy);
}

/// Everything about angles: the cut, the turns, and a first guess of the map.
class Unroller {
 public:
  Unroller(Chart& chart, const Skeleton& skeleton, const SeparationPlanes& separation)
      : chart_(chart),
        bone_name_(skeleton.bones[chart.bone].name),
        basis_(separation.bases()[chart.bone]),
        table_(chart.half_edges) {
    const Vec3& head = end_position(skeleton, chart.bone, BoneEnd::kHead);
    for (const Vec3& p : chart.positions) {
      seen_.push_back({(p - head).dot(basis_.s), (p - head).dot(basis_.b)});
      angles_.push_back(separation.turn_of(chart.bone, p - head));
    }
    chart.half_edges = link_half_edges(chart.triangles, static_cast<int>(chart.positions.size()));
    first_.assign(chart.positions.size(), -1);
    for (int h = static_cast<int>(table_.twins.size()) - 1; h >= 0; --h) first_[from(h)] = h;
    // A boundary vertex's fan begins at its boundary half-edge.
    for (int h = 0; h < static_cast<int>(table_.twins.size()); ++h)
      if (table_.twins[h] < 0) first_[from(h)] = h;
  }

  void run(const std::array<Row, 2>& rows) {
    const std::vector<int> path = find_cut();
    // Whole turns of the tail's row against the head's: what the measured angles say along the cut.
    int twist = 0;
    std::array<int, 2> cut_position{-1, -1};
    for (const int e : {0, 1}) {
      const auto& vertices = rows[e].vertices;
      const auto it = std::find(vertices.begin(), vertices.end(), e == 0 ? path.front() : path.back());
      if (it != vertices.end()) cut_position[e] = static_cast<int>(it - vertices.begin());
    }
    if (cut_position[0] >= 0 && cut_position[1] >= 0) {
      double turn = rows[0].measured[cut_position[0]] - rows[1].measured[cut_position[1]];
      for (std::size_t i = 0; i + 1 < path.size(); ++i) turn += shortest_turn(angles_[path[i + 1]] - angles_[path[i]]);
      twist = static_cast<int>(std::lround(turn));
    }
    std::vector<int> row_turns(chart_.positions.size(), 0);
    for (const int e : {0, 1})
      for (int i = 0; i < static_cast<int>(rows[e].vertices.size()); ++i) {
        double whole = std::floor(rows[e].lifted[i]);
        if (rows[e].lifted[i] - whole >= 1) ++whole;  // -1e-20 - (-1) rounds to 1
        const double v = std::max(0.0, rows[e].lifted[i] - whole);
        chart_.v[rows[e].vertices[i]] = v;
        row_turns[rows[e].vertices[i]] = static_cast<int>(whole) + (e == 1 ? twist : 0) + (i < cut_position[e] ? 1 : 0);
      }
    chart_.turns.resize(chart_.triangles.size());
    for (std::size_t t = 0; t < chart_.triangles.size(); ++t)
      for (int c = 0; c < 3; ++c) chart_.turns[t][c] = static_cast<std::int8_t>(row_turns[chart_.triangles[t][c]]);
    raise_left_side(path);
    guess();
  }

 private:
  int from(int h) const { return chart_.triangles[h / 3][h % 3]; }
  int to(int h) const { return chart_.triangles[h / 3][(h + 1) % 3]; }

  /// Calls `visit` with the half-edges out of a vertex, counter-clockwise; at a boundary from its first to its last.
  template <class Visit>
  void visit_fan(VertexIndex vertex, const Visit& visit) const {
    int h = first_[vertex];
    do {
      visit(h);
      h = table_.turn_left(h);
    } while (h >= 0 && h != first_[vertex]);
  }

  /// Length of an edge in the metric ds / r around the axis, r its distance from the axis; at a pole that of its other
  /// end.
  double length_around_axis(int v, int w) const {
    const bool has_pole = is_pole(chart_.kinds[v]) || is_pole(chart_.kinds[w]);
    const double length = (chart_.positions[w] - chart_.positions[v]).norm();
    const double r = has_pole ? std::max(std::hypot(seen_[v][0], seen_[v][1]), std::hypot(seen_[w][0], seen_[w][1]))
                              : axis_distance(seen_[v], seen_[w]);
    return length / std::max(r, 1e-6 * length);
  }

  /// A path from the head's row or pole to the tail's through inner vertices, the shortest in the metric ds / r around
  /// the axis: where the surface is pierced by the axis that metric is infinite, so the turns along the path mean
  /// something, and they do not depend on how vertices are numbered.
  std::vector<int> find_cut() const {
    const int count = static_cast<int>(chart_.positions.size());
    std::vector<double> distance(count, kInfinity);
    std::vector<int> parent(count, -1);
    using Entry = std::pair<double, int>;
    std::priority_queue<Entry, std::vector<Entry>, std::greater<>> queue;
    for (int v = 0; v < count; ++v)
      if (chart_.kinds[v] == ChartVertex::kHeadRow || chart_.kinds[v] == ChartVertex::kHeadPole)
        queue.push({distance[v] = 0, v});
    const auto relax = [&](int v, int w) {
      if (chart_.kinds[w] == ChartVertex::kHeadRow || chart_.kinds[w] == ChartVertex::kHeadPole) return;
      const double candidate = distance[v] + length_around_axis(v, w);
      if (candidate >= distance[w]) return;
      distance[w] = candidate;
      parent[w] = v;
      queue.push({candidate, w});
    };
    while (!queue.empty()) {
      const auto [d, v] = queue.top();
      queue.pop();
      if (d > distance[v]) continue;
      if (chart_.kinds[v] == ChartVertex::kTailRow || chart_.kinds[v] == ChartVertex::kTailPole) {
        std::vector<int> path;
        for (int p = v; p >= 0; p = parent[p]) path.push_back(p);
        std::reverse(path.begin(), path.end());
        return path;
      }
      visit_fan(v, [&, from_vertex = v](int h) {
        relax(from_vertex, to(h));
        if (table_.twins[HalfEdgeTable::previous(h)] < 0) relax(from_vertex, from(HalfEdgeTable::previous(h)));
      });
    }
    throw TopologyError(
        fmt::format("bone \"{}\": the two ends of its segment are not connected by its surface; move its nodes apart "
                    "or into the body",
                    bone_name_));
  }

  /// One more turn for the corners on the left of the cut, where v has come once around.
  void raise_left_side(const std::vector<int>& path) {
    const int count = static_cast<int>(path.size());
    for (int k = 0; k < count; ++k) {
      const VertexIndex vertex = path[k];
      if (is_pole(chart_.kinds[vertex])) continue;
      const int before = k > 0 ? path[k - 1] : -1, after = k + 1 < count ? path[k + 1] : -1;
      visit_fan(vertex, [&](int h) { ++chart_.turns[h / 3][h % 3]; });
      // ... but not for those on the right: from `before` (or the row) counter-clockwise to `after` (or the row).
      int h = -1;
      visit_fan(vertex, [&](int out) {
        if (before >= 0 && to(out) == before) h = out;
        if (before < 0 && h < 0) h = out;
      });
      for (const int start = h; h >= 0 && to(h) != after;) {
        --chart_.turns[h / 3][h % 3];
        h = table_.turn_left(h);
        if (h == start) break;
      }
    }
  }

  /// Per vertex the number of edges to a row or pole; -1 where there is no way.
  std::vector<int> count_edges_from(ChartVertex row, ChartVertex pole) const {
    std::vector<int> counts(chart_.positions.size(), -1), queue;
    for (int v = 0; v < static_cast<int>(counts.size()); ++v)
      if (chart_.kinds[v] == row || chart_.kinds[v] == pole) {
        counts[v] = 0;
        queue.push_back(v);
      }
    for (std::size_t i = 0; i < queue.size(); ++i)
      visit_fan(queue[i], [&](int h) {
        for (const int w : {to(h), from(HalfEdgeTable::previous(h))})
          if (counts[w] < 0) {
            counts[w] = counts[queue[i]] + 1;
            queue.push_back(w);
          }
      });
    return counts;
  }

  /// u by the number of edges to both ends, v by the measured angle.
  void guess() {
    const std::vector<int> from_head = count_edges_from(ChartVertex::kHeadRow, ChartVertex::kHeadPole),
                           from_tail = count_edges_from(ChartVertex::kTailRow, ChartVertex::kTailPole);
    for (std::size_t v = 0; v < chart_.u.size(); ++v)
      chart_.u[v] = static_cast<double>(from_head[v]) / std::max(1, from_head[v] + from_tail[v]);
    carry_angles();
  }

  /// v by the measured angle, carried from vertex to vertex: from the rows on, or from one vertex of a lone bone.
  void carry_angles() {
    std::vector<int> queue;
    std::vector<bool> is_known(chart_.positions.size(), false);
    const auto add = [&](int v) {
      is_known[v] = true;
      queue.push_back(v);
    };
    for (int v = 0; v < static_cast<int>(is_known.size()); ++v) {
      if (is_row(chart_.kinds[v])) add(v);
      if (is_pole(chart_.kinds[v])) is_known[v] = true;
    }
    if (queue.empty()) {
      const auto first = std::find(is_known.begin(), is_known.end(), false) - is_known.begin();
      chart_.v[first] = angles_[first];
      add(static_cast<int>(first));
    }
    for (std::size_t i = 0; i < queue.size(); ++i) {
      const int v = queue[i];
      visit_fan(v, [&](int h) {
        const auto& turns = chart_.turns[h / 3];
        for (const int c : {HalfEdgeTable::next(h) % 3, HalfEdgeTable::previous(h) % 3}) {
          const int w = chart_.triangles[h / 3][c];
          if (is_known[w]) continue;
          chart_.v[w] = chart_.v[v] + turns[h % 3] - turns[c] + shortest_turn(angles_[w] - angles_[v]);
          add(w);
        }
      });
    }
  }

  Chart& chart_;
  const std::string& bone_name_;
  const BoneBasis& basis_;
  std::vector<std::array<double, 2>> seen_;  ///< positions seen along the axis
  std::vector<double> angles_;
  const HalfEdgeTable& table_;
  std::vector<int> first_;
};

}  // namespace

Chart make_chart(const Segment& segment, const Skeleton& skeleton, const SeparationPlanes& separation) {
  Chart chart;
  chart.bone = segment.bone;
  chart.topology = segment.topology;
  chart.positions = segment.mesh.positions;
  chart.triangles = segment.mesh.triangles;
  chart.kinds.assign(chart.positions.size(), ChartVertex::kInner);
  std::array<Row, 2> rows;
  for (const BoneEnd end : {BoneEnd::kHead, BoneEnd::kTail}) {
    const int e = static_cast<int>(end);
    const BoundaryLoop& loop = segment.loops[e];
    if (loop.vertices.empty()) continue;
    rows[e] = make_row(loop, segment, skeleton, separation, end);
    for (const int v : loop.vertices)
      chart.kinds[v] = end == BoneEnd::kHead ? ChartVertex::kHeadRow : ChartVertex::kTailRow;
  }
  for (const BoneEnd end : {BoneEnd::kHead, BoneEnd::kTail})
    if (segment.loops[static_cast<int>(end)].vertices.empty()) insert_pole(chart, skeleton, separation, end);
  split_chords(chart);
  chart.u.assign(chart.positions.size(), 0);
  chart.v.assign(chart.positions.size(), 0);
  Unroller(chart, skeleton, separation).run(rows);
  return chart;
}

std::vector<double> texture_areas(const Chart& chart) {
  std::vector<double> areas(chart.triangles.size());
  for (std::size_t t = 0; t < areas.size(); ++t) {
    const Triangle& tri = chart.triangles[t];
    const auto v = [&](int c) { return chart.v[tri[c % 3]] + chart.turns[t][c % 3]; };
    const auto u = [&](int c) { return chart.u[tri[c % 3]]; };
    int pole = -1;
    for (int c = 0; c < 3; ++c)
      if (is_pole(chart.kinds[tri[c]])) pole = c;
    if (pole < 0) {
      areas[t] = 0.5 * ((v(1) - v(0)) * (u(2) - u(0)) - (v(2) - v(0)) * (u(1) - u(0)));
    } else {
      // The trapezoid between the opposite edge and the pole's line u = 0 or 1.
      areas[t] = (v(pole + 2) - v(pole + 1)) * (u(pole) - 0.5 * (u(pole + 1) + u(pole + 2)));
    }
  }
  return areas;
}

int count_flipped(const Chart& chart) {
  const std::vector<double> areas = texture_areas(chart);
  return static_cast<int>(std::count_if(areas.begin(), areas.end(), [](double a) { return !(a > 0); }));
}

}  // namespace skeletex
