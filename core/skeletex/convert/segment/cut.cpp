// SPDX-License-Identifier: MIT
#include "skeletex/convert/segment/cut.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <limits>
#include <map>
#include <numbers>
#include <numeric>

#include "skeletex/geometry/half_edge.h"
#include "skeletex/geometry/half_edge_table.h"
#include "skeletex/geometry/parallel.h"
#include "skeletex/model/error.h"

namespace skeletex {

namespace {

/// Every directed edge once and its opposite as well, and one fan of triangles around each vertex.
bool is_closed_surface(const HalfEdgeTable& table, int vertex_count) {
  for (int h = 0; h < static_cast<int>(table.twins.size()); ++h)
    if (table.twins[h] < 0 || table.twins[table.twins[h]] != h) return false;
  std::atomic<bool> is_closed = true;
  for_each_block(vertex_count, 4096, [&](std::size_t, std::size_t begin, std::size_t end) {
    for (std::size_t v = begin; v < end; ++v) {
      const int valence = table.begin[v + 1] - table.begin[v];
      if (valence == 0) continue;
      const int first = table.outgoing[table.begin[v]];
      int count = 0, h = first;
      do h = table.turn_left(h), ++count;
      while (h != first && count <= valence);
      if (count != valence) is_closed = false;
    }
  });
  return is_closed;
}

bool has_good_triangles(const TriangleMesh& mesh) {
  const int count = static_cast<int>(mesh.positions.size());
  return std::all_of(mesh.triangles.begin(), mesh.triangles.end(), [&](const Triangle& t) {
    return t[0] != t[1] && t[1] != t[2] && t[2] != t[0] &&
           std::all_of(t.begin(), t.end(), [&](int v) { return v >= 0 && v < count; });
  });
}

/// OpenMesh says where.
[[noreturn]] void throw_not_closed(const TriangleMesh& mesh) {
  const HalfEdgeMesh half_edges = build_half_edges(mesh);
  for (const auto h : half_edges.halfedges())
    if (half_edges.is_boundary(h)) {
      const auto& p = half_edges.point(half_edges.from_vertex_handle(h));
      throw InputError(fmt::format("the mesh is not closed: there is a hole at ({:.6g}, {:.6g}, {:.6g}); close it",
                                   p[0], p[1], p[2]));
    }
  throw InputError("the mesh is no closed surface; make it 2-manifold and consistently oriented");
}

}  // namespace

CutMesh cut_mesh_of(const TriangleMesh& mesh) {
  if (!has_good_triangles(mesh)) throw_not_closed(mesh);
  const int count = static_cast<int>(mesh.positions.size());
  const HalfEdgeTable table = link_half_edges(mesh.triangles, count);
  if (!is_closed_surface(table, count)) throw_not_closed(mesh);
  CutMesh cut;
  cut.positions = mesh.positions;
  // A triangle's last corner comes first, as in OpenMesh: results and messages stay those of earlier versions to the
  // last digit.
  cut.origins.resize(table.twins.size()), cut.opposites.resize(table.twins.size());
  for (int h = 0; h < static_cast<int>(table.twins.size()); ++h) {
    const int at = CutMesh::next(h);
    cut.origins[at] = mesh.triangles[h / 3][h % 3];
    cut.opposites[at] = CutMesh::next(table.twins[h]);
  }
  cut.seams.assign(cut.origins.size(), -1);
  return cut;
}

namespace {

using Weights = std::array<double, 3>;

/// Where separation planes meet an edge (two cells) or each other inside a triangle (three cells).
struct SeparationPlanePoint {
  Vec3 position;
  std::array<int, 3> cells{-1, -1, -1};
  Weights weights{};  ///< of a point inside a triangle: barycentric; on an edge: weights[0] is the parameter along it
  int triangle = -1;  ///< of a point inside
  int vertex = -1;    ///< once it is kept
};

/// A piece of separation plane inside a triangle, from point to point, with the regions of the triangle on its two
/// sides.
struct SeparationPlanePiece {
  std::array<int, 2> points;
  std::array<int, 2> regions;  ///< on the left, on the right
  std::array<int, 2> cells;
};

/// The separation plane points of an edge, in the direction of `half_edge`, and later the half-edges of its parts on
/// both sides.
struct EdgeRecord {
  int half_edge = -1, opposite = -1;
  int first_point = 0, point_count = 0;
  std::array<int, 2> parts{-1, -1};  ///< first entry in the list of parts: of half_edge, of its opposite
};

/// A triangle whose corners lie in different cells.
struct MixedTriangle {
  int triangle;
  int first_piece = 0, piece_count = 0;
  int region_count = 0;
  int first_merge = 0, merge_count = 0;  ///< pairs of regions that are one
};

struct UnionFind {
  std::vector<int> parent;
  int add() {
    parent.push_back(static_cast<int>(parent.size()));
    return parent.back();
  }
  int find(int x) {
    while (parent[x] != x) x = parent[x] = parent[parent[x]];
    return x;
  }
  void unite(int a, int b) {
    a = find(a);
    b = find(b);
    parent[std::max(a, b)] = std::min(a, b);
  }
};

/// One run of cut_along_walls.
class SeparationPlaneCutter {
 public:
  SeparationPlaneCutter(CutMesh& mesh, const NodeCells& node, const std::vector<std::uint8_t>& labels)
      : mesh_(mesh), node_(node), labels_(labels) {}

  void find_network();
  /// \return false when no separation plane meets the surface
  bool select_components();
  int first_crossing(Vec3& point) const;
  void cut(int first_seam);

 private:
  int edge_record(int half_edge);
  void find_edge_points(EdgeRecord& record);
  void divide(MixedTriangle& mixed);
  void subdivide(const MixedTriangle& mixed, int first_seam);
  bool is_kept(int point) { return is_component_kept_[components_.find(point)] != 0; }
  double value(int cell, int vertex) const { return node_.value(cell, mesh_.positions[vertex]); }
  Weights weights_in(int point, int triangle) const;

  /// The boundary of a part of a triangle, counter-clockwise: regions and the separation plane point after each.
  struct Ring {
    std::vector<int> cells, regions, points;
  };
  void resolve(Ring ring, MixedTriangle& mixed);
  void emit(int from, int to, int left_region, int right_region, int left_cell, int right_cell, MixedTriangle& mixed);

  CutMesh& mesh_;
  const NodeCells& node_;
  const std::vector<std::uint8_t>& labels_;
  std::vector<int> record_of_;  // half-edge -> record, -1
  std::vector<EdgeRecord> records_;
  std::vector<SeparationPlanePoint> points_;
  std::vector<SeparationPlanePiece> pieces_;
  std::vector<std::array<int, 2>> merges_;
  std::vector<MixedTriangle> mixed_;
  UnionFind components_;
  std::vector<char> is_component_kept_;
  std::vector<int> parts_;
  std::array<std::vector<double>, 3> corner_values_;  // of the triangle under division: per corner, per cell
};

int SeparationPlaneCutter::edge_record(int half_edge) {
  const int canonical = std::min(half_edge, mesh_.opposites[half_edge]);
  int& slot = record_of_[canonical];
  if (slot < 0) {
    slot = static_cast<int>(records_.size());
    records_.push_back({canonical, mesh_.opposites[canonical], static_cast<int>(points_.size()), 0, {-1, -1}});
  }
  return slot;
}

/// Upper envelope of the cells' values along an edge, from one end's cell to the other's. Each step goes to a cell that
/// is larger at the far end, so that it ends there whatever rounding does.
void SeparationPlaneCutter::find_edge_points(EdgeRecord& record) {
  const int a = mesh_.origins[record.half_edge], b = mesh_.target(record.half_edge);
  const int last = labels_[b];
  const int count = static_cast<int>(node_.cells.size());
  record.first_point = static_cast<int>(points_.size());
  double t = 0;
  for (int cell = labels_[a]; cell != last;) {
    const double from_a = value(cell, a), from_b = value(cell, b);
    int next = last;
    double next_t = 2, next_b = -std::numeric_limits<double>::infinity();
    for (int c = 0; c < count; ++c) {
      const double to_b = value(c, b);
      if (c == cell || (c != last && !(to_b > from_b))) continue;
      const double lead_a = from_a - value(c, a), lead_b = to_b - from_b;
      const double crossing = lead_a > 0 && lead_a + lead_b > 0 ? std::clamp(lead_a / (lead_a + lead_b), t, 1.0) : t;
      if (crossing < next_t || (crossing == next_t && to_b > next_b)) {
        next = c;
        next_t = crossing;
        next_b = to_b;
      }
    }
    t = next_t;
    SeparationPlanePoint point;
    point.position = mesh_.positions[a] + t * (mesh_.positions[b] - mesh_.positions[a]);
    point.cells = {cell, next, -1};
    point.weights[0] = t;
    points_.push_back(point);
    components_.add();
    ++record.point_count;
    cell = next;
  }
}

void SeparationPlaneCutter::emit(int from, int to, int left_region, int right_region, int left_cell, int right_cell,
                                 MixedTriangle& mixed) {
  pieces_.push_back({{from, to}, {left_region, right_region}, {left_cell, right_cell}});
  ++mixed.piece_count;
  components_.unite(from, to);
}

/// Barycentric weights of a separation plane point in one of the triangles that it lies in.
Weights SeparationPlaneCutter::weights_in(int point, int triangle) const {
  const SeparationPlanePoint& p = points_[point];
  if (p.triangle >= 0) return p.weights;
  for (int c = 0; c < 3; ++c) {
    const int h = 3 * triangle + c;
    const int slot = record_of_[std::min(h, mesh_.opposites[h])];
    if (slot < 0) continue;
    const EdgeRecord& record = records_[slot];
    if (point < record.first_point || point >= record.first_point + record.point_count) continue;
    const double t = h == record.half_edge ? p.weights[0] : 1 - p.weights[0];
    Weights w{};
    w[c] = 1 - t;
    w[(c + 1) % 3] = t;
    return w;
  }
  return {};
}

/// Finds the separation planes inside a part of a triangle from the cells around it, combinatorially sound whatever
/// rounding does: the separation plane from one point of the ring ends where a third cell takes over first, which
/// divides the ring in two.
void SeparationPlaneCutter::resolve(Ring ring, MixedTriangle& mixed) {
  while (true) {
    const int size = static_cast<int>(ring.cells.size());
    if (size < 2) return;
    if (size == 2) {
      emit(ring.points[0], ring.points[1], ring.regions[0], ring.regions[1], ring.cells[0], ring.cells[1], mixed);
      return;
    }
    const auto part = [&](int begin, int end, int closing_point) {  // regions begin..end (cyclic), closed by a point
      Ring result;
      for (int s = begin;; s = (s + 1) % size) {
        result.cells.push_back(ring.cells[s]);
        result.regions.push_back(ring.regions[s]);
        result.points.push_back(s == end ? closing_point : ring.points[s]);
        if (s == end) return result;
      }
    };
    // A cell is convex: where it comes twice it is one region.
    for (int p = 0; p < size; ++p)
      for (int q = p + 1; q < size; ++q)
        if (ring.cells[p] == ring.cells[q]) {
          if (ring.regions[p] != ring.regions[q]) {
            merges_.push_back({ring.regions[p], ring.regions[q]});
            ++mixed.merge_count;
          }
          resolve(part(p, q - 1, ring.points[q - 1]), mixed);
          resolve(part(q, (p + size - 1) % size, ring.points[(p + size - 1) % size]), mixed);
          return;
        }
    const int i = ring.cells[0], j = ring.cells[1];
    const Weights start = weights_in(ring.points[0], mixed.triangle);
    Weights slope_ij;
    for (int c = 0; c < 3; ++c) slope_ij[c] = corner_values_[c][i] - corner_values_[c][j];
    // Along g_i = g_j, with i on the left.
    const Weights along{slope_ij[1] - slope_ij[2], slope_ij[2] - slope_ij[0], slope_ij[0] - slope_ij[1]};
    int third = -1;
    double nearest = std::numeric_limits<double>::infinity();
    for (int l = 0; l < static_cast<int>(node_.cells.size()); ++l) {
      if (l == i || l == j) continue;
      double lag = 0, slope = 0;
      for (int c = 0; c < 3; ++c) {
        const double gain = corner_values_[c][l] - corner_values_[c][i];
        lag -= start[c] * gain;
        slope += along[c] * gain;
      }
      if (!(slope > 0)) continue;
      const double distance = std::max(lag, 0.0) / slope;
      if (distance < nearest) {
        nearest = distance;
        third = l;
      }
    }
    if (third < 0) {
      third = ring.cells[2];
      nearest = 0;
    }
    SeparationPlanePoint corner;
    corner.triangle = mixed.triangle;
    corner.cells = {i, j, third};
    double sum = 0;
    for (int c = 0; c < 3; ++c) sum += corner.weights[c] = std::clamp(start[c] + nearest * along[c], 0.0, 1.0);
    corner.position = Vec3::Zero();
    for (int c = 0; c < 3; ++c) {
      corner.weights[c] /= sum;
      corner.position += corner.weights[c] * mesh_.positions[mesh_.origins[3 * mixed.triangle + c]];
    }
    const int point = components_.add();
    points_.push_back(corner);
    emit(ring.points[0], point, ring.regions[0], ring.regions[1], i, j, mixed);
    const auto place = std::find(ring.cells.begin() + 2, ring.cells.end(), third);
    if (place != ring.cells.end()) {
      const int p = static_cast<int>(place - ring.cells.begin());
      resolve(part(1, p, point), mixed);
      ring = part(p, 0, point);
    } else {  // a cell that lies inside the triangle altogether
      ring.points[0] = point;
      ring.cells.insert(ring.cells.begin() + 1, third);
      ring.regions.insert(ring.regions.begin() + 1, mixed.region_count++);
      ring.points.insert(ring.points.begin() + 1, point);
    }
  }
}

void SeparationPlaneCutter::divide(MixedTriangle& mixed) {
  mixed.first_piece = static_cast<int>(pieces_.size());
  mixed.first_merge = static_cast<int>(merges_.size());
  Ring ring;
  int cell = labels_[mesh_.origins[3 * mixed.triangle]];
  for (int c = 0; c < 3; ++c) {
    const int h = 3 * mixed.triangle + c;
    if (labels_[mesh_.origins[h]] == labels_[mesh_.target(h)]) continue;
    const int slot = edge_record(h);
    if (records_[slot].point_count == 0) find_edge_points(records_[slot]);
    const EdgeRecord& record = records_[slot];
    const bool is_forward = record.half_edge == h;
    for (int k = 0; k < record.point_count; ++k) {
      const int point = record.first_point + (is_forward ? k : record.point_count - 1 - k);
      ring.cells.push_back(cell);
      ring.points.push_back(point);
      cell = points_[point].cells[is_forward ? 1 : 0];
    }
  }
  mixed.region_count = static_cast<int>(ring.cells.size());
  ring.regions.resize(ring.cells.size());
  std::iota(ring.regions.begin(), ring.regions.end(), 0);
  if (ring.cells.size() > 2)
    for (int c = 0; c < 3; ++c)
      for (std::size_t l = 0; l < node_.cells.size(); ++l)
        corner_values_[c][l] = value(static_cast<int>(l), mesh_.origins[3 * mixed.triangle + c]);
  resolve(std::move(ring), mixed);
}

void SeparationPlaneCutter::find_network() {
  record_of_.assign(mesh_.origins.size(), -1);
  for (auto& values : corner_values_) values.resize(node_.cells.size());
  const int count = mesh_.triangle_count();
  for (int t = 0; t < count; ++t) {
    const std::uint8_t a = labels_[mesh_.origins[3 * t]];
    if (a == labels_[mesh_.origins[3 * t + 1]] && a == labels_[mesh_.origins[3 * t + 2]]) continue;
    MixedTriangle mixed;
    mixed.triangle = t;
    divide(mixed);
    mixed_.push_back(mixed);
  }
}

bool SeparationPlaneCutter::select_components() {
  is_component_kept_.assign(points_.size(), 0);
  if (node_.cells.size() > 2) {
    // First exit of each ray. A ray is known by its three cells and by which of the two opposite ones it is.
    std::map<std::array<int, 4>, std::pair<double, int>> first;
    for (std::size_t p = 0; p < points_.size(); ++p) {
      if (points_[p].triangle < 0) continue;
      std::array<int, 3> cells = points_[p].cells;
      std::sort(cells.begin(), cells.end());
      const Vec3 &i = node_.cells[cells[0]].direction, &j = node_.cells[cells[1]].direction,
                 &l = node_.cells[cells[2]].direction;
      const Vec3 offset = points_[p].position - node_.position;
      const int side = offset.dot((i - j).cross(i - l)) > 0 ? 1 : 0;
      const double distance = offset.norm();
      const auto [it, is_new] = first.try_emplace({cells[0], cells[1], cells[2], side}, distance, static_cast<int>(p));
      if (!is_new && distance < it->second.first) it->second = {distance, static_cast<int>(p)};
    }
    for (const auto& [ray, hit] : first) is_component_kept_[components_.find(hit.second)] = 1;
    return !first.empty();
  }
  // Rays in the one separation plane, evenly turned; those through its loops' pieces.
  constexpr int kRays = 256;
  const Vec3 normal = (node_.cells[0].direction - node_.cells[1].direction).normalized();
  Vec3::Index axis;
  normal.cwiseAbs().minCoeff(&axis);
  const Vec3 e = (Vec3::Unit(axis) - normal[axis] * normal).normalized(), f = normal.cross(e);
  std::vector<std::pair<double, int>> first(kRays, {std::numeric_limits<double>::infinity(), -1});
  for (const SeparationPlanePiece& piece : pieces_) {
    double x[2], y[2];
    for (int k = 0; k < 2; ++k) {
      const Vec3 offset = points_[piece.points[k]].position - node_.position;
      x[k] = offset.dot(e);
      y[k] = offset.dot(f);
    }
    const double area = x[0] * y[1] - x[1] * y[0];
    if (area == 0) continue;
    const int from = area > 0 ? 0 : 1;
    constexpr double kStep = 2 * std::numbers::pi / kRays;
    const double begin = std::atan2(y[from], x[from]) / kStep;
    double end = std::atan2(y[1 - from], x[1 - from]) / kStep;
    if (end < begin) end += kRays;
    for (int r = static_cast<int>(std::ceil(begin)); r <= end; ++r) {
      const double dx = std::cos(r * kStep), dy = std::sin(r * kStep);
      const double across = dx * (y[1] - y[0]) - dy * (x[1] - x[0]);
      if (across == 0) continue;
      const double distance = std::abs(area / across);
      auto& hit = first[(r % kRays + kRays) % kRays];
      const int component = components_.find(piece.points[0]);
      if (distance < hit.first) hit = {distance, component};
    }
  }
  std::map<int, std::pair<int, double>> votes;  // component -> hits, minus the nearest
  for (const auto& [distance, component] : first) {
    if (component < 0) continue;
    auto& vote = votes.try_emplace(component, 0, -distance).first->second;
    ++vote.first;
    vote.second = std::max(vote.second, -distance);
  }
  if (votes.empty()) return false;
  const auto best =
      std::max_element(votes.begin(), votes.end(), [](const auto& a, const auto& b) { return a.second < b.second; });
  is_component_kept_[best->first] = 1;
  return true;
}

int SeparationPlaneCutter::first_crossing(Vec3& point) const {
  auto components = components_;
  for (const EdgeRecord& record : records_)
    for (int k = 0; k < record.point_count; ++k)
      if (mesh_.seams[record.half_edge] >= 0 && is_component_kept_[components.find(record.first_point + k)]) {
        point = points_[record.first_point + k].position;
        return record.half_edge;
      }
  return -1;
}

/// A corner of a convex piece of a triangle.
struct PieceCorner {
  int vertex;
  Weights weights;
};

/// Divides a convex polygon, some of whose corners may be collinear, into triangles with positive area, the worst of
/// them as good as can be. Returns triples of corners.
std::vector<std::array<int, 3>> triangulate(const std::vector<PieceCorner>& corners,
                                            const std::vector<Vec3>& positions) {
  const int n = static_cast<int>(corners.size());
  if (n == 3) return {{0, 1, 2}};
  const auto quality = [&](int a, int b, int c) {
    const Weights &p = corners[a].weights, &q = corners[b].weights, &r = corners[c].weights;
    const double area =
        p[0] * (q[1] * r[2] - q[2] * r[1]) + p[1] * (q[2] * r[0] - q[0] * r[2]) + p[2] * (q[0] * r[1] - q[1] * r[0]);
    const Vec3 &x = positions[corners[a].vertex], &y = positions[corners[b].vertex], &z = positions[corners[c].vertex];
    const double longest = std::max({(x - y).squaredNorm(), (y - z).squaredNorm(), (z - x).squaredNorm()});
    return longest > 0 ? area / longest : 0.0;
  };
  // best[i][j]: the worst triangle's quality of the polygon i..j, at its best; via[i][j]: the apex over the edge i j.
  std::vector<double> best(n * n, std::numeric_limits<double>::infinity());
  std::vector<int> via(n * n, -1);
  for (int span = 2; span < n; ++span)
    for (int i = 0; i + span < n; ++i) {
      const int j = i + span;
      best[i * n + j] = -std::numeric_limits<double>::infinity();
      for (int m = i + 1; m < j; ++m) {
        const double worst = std::min({best[i * n + m], best[m * n + j], quality(i, m, j)});
        if (via[i * n + j] < 0 || worst > best[i * n + j]) {
          best[i * n + j] = worst;
          via[i * n + j] = m;
        }
      }
    }
  std::vector<std::array<int, 3>> triangles;
  std::vector<std::array<int, 2>> open{{0, n - 1}};
  while (!open.empty()) {
    const auto [i, j] = open.back();
    open.pop_back();
    if (j - i < 2) continue;
    const int m = via[i * n + j];
    triangles.push_back({i, m, j});
    open.push_back({i, m});
    open.push_back({m, j});
  }
  return triangles;
}

void SeparationPlaneCutter::subdivide(const MixedTriangle& mixed, int first_seam) {
  const int t = mixed.triangle;
  // A directed side of a region: part of the triangle's own side, or a piece of separation plane seen from its left or
  // right.
  struct Side {
    int from, to, region;
    int seam;
    int part = -1;  ///< entry in parts_
    int twin = -1;  ///< piece and side: 2 piece + side
  };
  std::vector<Side> sides;
  std::vector<PieceCorner> corners;
  const auto add_corner = [&](int vertex, const Weights& w) {
    for (const PieceCorner& corner : corners)
      if (corner.vertex == vertex) return;
    corners.push_back({vertex, w});
  };
  UnionFind regions;
  for (int r = 0; r < mixed.region_count; ++r) regions.add();
  for (int m = mixed.first_merge; m < mixed.first_merge + mixed.merge_count; ++m)
    regions.unite(merges_[m][0], merges_[m][1]);
  for (int p = mixed.first_piece; p < mixed.first_piece + mixed.piece_count; ++p) {
    const SeparationPlanePiece& piece = pieces_[p];
    if (!is_kept(piece.points[0])) {
      regions.unite(piece.regions[0], piece.regions[1]);
      continue;
    }
    const int a = points_[piece.points[0]].vertex, b = points_[piece.points[1]].vertex;
    sides.push_back({a, b, piece.regions[0], first_seam + piece.cells[0], -1, 2 * p});
    sides.push_back({b, a, piece.regions[1], first_seam + piece.cells[1], -1, 2 * p + 1});
    for (const int point : piece.points) add_corner(points_[point].vertex, weights_in(point, t));
  }
  int region = 0;
  const int ring_size = [&] {
    int count = 0;
    for (int c = 0; c < 3; ++c)
      if (const int slot = record_of_[std::min(3 * t + c, mesh_.opposites[3 * t + c])]; slot >= 0)
        count += records_[slot].point_count;
    return count;
  }();
  for (int c = 0; c < 3; ++c) {
    const int h = 3 * t + c;
    EdgeRecord& record = records_[edge_record(h)];
    const bool is_forward = record.half_edge == h;
    Weights w{};
    w[c] = 1;
    add_corner(mesh_.origins[h], w);
    int kept_count = 0;
    for (int k = 0; k < record.point_count; ++k) kept_count += is_kept(record.first_point + k);
    int& first_part = record.parts[is_forward ? 0 : 1];
    first_part = static_cast<int>(parts_.size());
    parts_.resize(parts_.size() + static_cast<std::size_t>(kept_count) + 1, -1);
    int from = mesh_.origins[h], part = 0;
    const auto add_part = [&](int to) {
      sides.push_back({from, to, region, mesh_.seams[h], first_part + (is_forward ? part : kept_count - part), -1});
      from = to;
      ++part;
    };
    for (int k = 0; k < record.point_count; ++k) {
      const int point = record.first_point + (is_forward ? k : record.point_count - 1 - k);
      if (is_kept(point)) add_part(points_[point].vertex);
      region = (region + 1) % ring_size;
    }
    add_part(mesh_.target(h));
  }

  std::vector<std::array<int, 2>> diagonals;  // half-edges that wait for their opposite
  std::vector<int> plane_half_edges(2 * mixed.piece_count, -1);
  std::vector<char> is_used(sides.size(), 0);
  bool is_first = true;
  for (std::size_t seed = 0; seed < sides.size(); ++seed) {
    if (is_used[seed]) continue;
    const int root = regions.find(sides[seed].region);
    std::vector<int> polygon;
    for (int s = static_cast<int>(seed); s >= 0 && !is_used[s];) {
      is_used[s] = 1;
      polygon.push_back(s);
      int following = -1;
      for (std::size_t q = 0; q < sides.size(); ++q)
        if (!is_used[q] && sides[q].from == sides[s].to && regions.find(sides[q].region) == root)
          following = static_cast<int>(q);
      s = following;
    }
    std::vector<PieceCorner> outline;
    for (const int s : polygon)
      outline.push_back(*std::find_if(corners.begin(), corners.end(),
                                      [&](const PieceCorner& c) { return c.vertex == sides[s].from; }));
    for (const auto& triple : triangulate(outline, mesh_.positions)) {
      int base = 3 * t;
      if (!is_first) {
        base = static_cast<int>(mesh_.origins.size());
        mesh_.origins.resize(base + 3);
        mesh_.opposites.resize(base + 3);
        mesh_.seams.resize(base + 3);
      }
      is_first = false;
      for (int c = 0; c < 3; ++c) {
        const int h = base + c, a = triple[c], b = triple[(c + 1) % 3];
        mesh_.origins[h] = outline[a].vertex;
        mesh_.seams[h] = -1;
        if (b == (a + 1) % static_cast<int>(outline.size())) {
          const Side& side = sides[polygon[a]];
          mesh_.seams[h] = side.seam;
          if (side.part >= 0) {
            parts_[side.part] = h;
          } else {
            const int local = side.twin - 2 * mixed.first_piece;
            plane_half_edges[local] = h;
            if (const int other = plane_half_edges[local ^ 1]; other >= 0) {
              mesh_.opposites[h] = other;
              mesh_.opposites[other] = h;
            }
          }
        } else {
          const int from = outline[a].vertex, to = outline[b].vertex;
          bool is_matched = false;
          for (auto& [waiting, start] : diagonals)
            if (waiting >= 0 && start == to && mesh_.origins[CutMesh::next(waiting)] == from) {
              mesh_.opposites[h] = waiting;
              mesh_.opposites[waiting] = h;
              waiting = -1;
              is_matched = true;
              break;
            }
          if (!is_matched) diagonals.push_back({h, from});
        }
      }
    }
  }
}

void SeparationPlaneCutter::cut(int first_seam) {
  for (std::size_t p = 0; p < points_.size(); ++p)
    if (is_kept(static_cast<int>(p))) {
      points_[p].vertex = static_cast<int>(mesh_.positions.size());
      mesh_.positions.push_back(points_[p].position);
    }
  for (const MixedTriangle& mixed : mixed_) {
    bool is_touched = false;
    for (int p = mixed.first_piece; p < mixed.first_piece + mixed.piece_count; ++p)
      is_touched |= is_kept(pieces_[p].points[0]);
    if (is_touched) subdivide(mixed, first_seam);
  }
  // Sides of the divided triangles meet: each other's parts, or a triangle that was left as it was.
  for (const EdgeRecord& record : records_) {
    if (record.parts[0] < 0 && record.parts[1] < 0) continue;
    int count = 1;
    for (int k = 0; k < record.point_count; ++k) count += is_kept(record.first_point + k);
    for (int k = 0; k < count; ++k) {
      const int one = record.parts[0] >= 0 ? parts_[record.parts[0] + k] : record.half_edge;
      const int other = record.parts[1] >= 0 ? parts_[record.parts[1] + k] : record.opposite;
      mesh_.opposites[one] = other;
      mesh_.opposites[other] = one;
    }
  }
}

}  // namespace

CutOutcome cut_along_separation(CutMesh& mesh, const NodeCells& node, const std::vector<std::uint8_t>& labels,
                                int first_seam) {
  SeparationPlaneCutter cutter(mesh, node, labels);
  cutter.find_network();
  CutOutcome outcome;
  if (!cutter.select_components()) {
    outcome.status = CutStatus::kNoSurface;
  } else if (outcome.crossed_half_edge = cutter.first_crossing(outcome.point); outcome.crossed_half_edge >= 0) {
    outcome.status = CutStatus::kCrossesSeam;
  } else {
    cutter.cut(first_seam);
  }
  return outcome;
}

void split_edge(CutMesh& mesh, int half_edge) {
  const int sides[2] = {half_edge, mesh.opposites[half_edge]};
  const int middle = static_cast<int>(mesh.positions.size());
  mesh.positions.push_back(0.5 * (mesh.positions[mesh.origins[sides[0]]] + mesh.positions[mesh.origins[sides[1]]]));
  int second_part[2];
  for (int k = 0; k < 2; ++k) {
    // Triangle a b c over the side a b becomes a m c and m b c.
    const int ab = sides[k], bc = CutMesh::next(ab), ca = CutMesh::next(bc);
    const int mb = static_cast<int>(mesh.origins.size());
    mesh.origins.insert(mesh.origins.end(), {middle, mesh.origins[bc], mesh.origins[ca]});
    mesh.opposites.insert(mesh.opposites.end(), {-1, mesh.opposites[bc], bc});
    mesh.seams.insert(mesh.seams.end(), {mesh.seams[ab], mesh.seams[bc], -1});
    mesh.opposites[mesh.opposites[bc]] = mb + 1;
    mesh.origins[bc] = middle;
    mesh.opposites[bc] = mb + 2;
    mesh.seams[bc] = -1;
    second_part[k] = mb;
  }
  for (int k = 0; k < 2; ++k) {
    mesh.opposites[sides[k]] = second_part[1 - k];
    mesh.opposites[second_part[1 - k]] = sides[k];
  }
}

}  // namespace skeletex
