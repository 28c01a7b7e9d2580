// SPDX-License-Identifier: MIT
#include "skeletex/convert/segment/cut.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <numbers>

#include "skeletex/convert/segment/separation_network.h"
#include "skeletex/math/portable.h"

namespace skeletex {

namespace {

/// The components that hold the first exits of the corner rays. A ray is known by its three cells and by which of the
/// two opposite ones it is.
std::vector<int> components_at_corner_rays(SeparationNetwork& network, const NodeCells& node) {
  std::map<std::array<int, 4>, std::pair<double, int>> first;
  for (std::size_t p = 0; p < network.points.size(); ++p) {
    if (network.points[p].triangle < 0) continue;
    std::array<int, 3> cells = network.points[p].cells;
    std::sort(cells.begin(), cells.end());
    const Vec3 &i = node.cells[cells[0]].direction, &j = node.cells[cells[1]].direction,
               &l = node.cells[cells[2]].direction;
    const Vec3 offset = network.points[p].position - node.position;
    const int side = offset.dot((i - j).cross(i - l)) > 0 ? 1 : 0;
    const double distance = offset.norm();
    const auto [it, is_new] = first.try_emplace({cells[0], cells[1], cells[2], side}, distance, static_cast<int>(p));
    if (!is_new && distance < it->second.first) it->second = {distance, static_cast<int>(p)};
  }
  std::vector<int> components;
  components.reserve(first.size());
  for (const auto& [ray, hit] : first) components.push_back(network.component(hit.second));
  return components;
}

/// What a ray meets first.
struct RayHit {
  double distance = std::numeric_limits<double>::infinity();
  int component = -1;
};

/// Rays in the one separation plane of two cells, evenly turned, and the pieces of loops that they meet.
std::vector<RayHit> cast_plane_rays(SeparationNetwork& network, const NodeCells& node) {
  constexpr int kRays = 256;
  constexpr double kStep = 2 * std::numbers::pi / kRays;
  const Vec3 normal = (node.cells[0].direction - node.cells[1].direction).normalized();
  Vec3::Index axis;
  normal.cwiseAbs().minCoeff(&axis);
  const Vec3 e = (Vec3::Unit(axis) - normal[axis] * normal).normalized(), f = normal.cross(e);
  std::vector<RayHit> first(kRays);
  for (const NetworkPiece& piece : network.pieces) {
    double x[2], y[2];
    for (int k = 0; k < 2; ++k) {
      const Vec3 offset = network.points[piece.points[k]].position - node.position;
      x[k] = offset.dot(e);
      y[k] = offset.dot(f);
    }
    const double area = x[0] * y[1] - x[1] * y[0];
    if (area == 0) continue;
    const int from = area > 0 ? 0 : 1;
    const double begin = portable::atan2(y[from], x[from]) / kStep;
    double end = portable::atan2(y[1 - from], x[1 - from]) / kStep;
    if (end < begin) end += kRays;
    for (int r = static_cast<int>(std::ceil(begin)); r <= end; ++r) {
      const double dx = portable::cos(r * kStep), dy = portable::sin(r * kStep);
      const double across = dx * (y[1] - y[0]) - dy * (x[1] - x[0]);
      if (across == 0) continue;
      const double distance = std::abs(area / across);
      RayHit& hit = first[(r % kRays + kRays) % kRays];
      if (distance < hit.distance) hit = {distance, network.component(piece.points[0])};
    }
  }
  return first;
}

/// The component that most rays meet first; of equal ones that with the nearest hit. -1 when there is none.
int component_of_most(const std::vector<RayHit>& hits) {
  std::map<int, std::pair<int, double>> votes;  // component -> hits, minus the nearest
  for (const RayHit& hit : hits) {
    if (hit.component < 0) continue;
    auto& vote = votes.try_emplace(hit.component, 0, -hit.distance).first->second;
    ++vote.first;
    vote.second = std::max(vote.second, -hit.distance);
  }
  const auto best =
      std::max_element(votes.begin(), votes.end(), [](const auto& a, const auto& b) { return a.second < b.second; });
  return best == votes.end() ? -1 : best->first;
}

/// Per point whether the mesh is cut there; empty when no separation plane meets the surface.
std::vector<char> choose_kept_points(SeparationNetwork& network, const NodeCells& node) {
  std::vector<int> components;
  if (node.cells.size() > 2) {
    components = components_at_corner_rays(network, node);
  } else if (const int component = component_of_most(cast_plane_rays(network, node)); component >= 0) {
    components = {component};
  }
  if (components.empty()) return {};
  std::vector<char> is_component_kept(network.points.size(), 0), is_kept(network.points.size());
  for (const int component : components) is_component_kept[component] = 1;
  for (int p = 0; p < static_cast<int>(is_kept.size()); ++p) is_kept[p] = is_component_kept[network.component(p)];
  return is_kept;
}

/// The first kept point on an earlier seam: its half-edge, -1 when there is none.
int first_crossing(const SeparationNetwork& network, const CutMesh& mesh, const std::vector<char>& is_kept,
                   Vec3& point) {
  for (const DividedEdge& edge : network.edges)
    for (int p = edge.first_point; p < edge.first_point + edge.point_count; ++p)
      if (mesh.seams[edge.half_edge] >= 0 && is_kept[p]) {
        point = network.points[p].position;
        return edge.half_edge;
      }
  return -1;
}

/// A corner of a convex piece of a triangle.
struct PieceCorner {
  VertexIndex vertex;
  Barycentric weights;
};

/// Divides a convex polygon, some of whose corners may be collinear, into triangles with positive area, the worst of
/// them as good as can be. Returns triples of corners.
std::vector<std::array<int, 3>> triangulate(const std::vector<PieceCorner>& corners,
                                            const std::vector<Vec3>& positions) {
  const int n = static_cast<int>(corners.size());
  if (n == 3) return {{0, 1, 2}};
  const auto quality = [&](int a, int b, int c) {
    const Barycentric &p = corners[a].weights, &q = corners[b].weights, &r = corners[c].weights;
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

/// Divides the mesh along the kept points of a network.
class TriangleDivider {
 public:
  TriangleDivider(CutMesh& mesh, SeparationNetwork& network, const std::vector<char>& is_kept, int first_seam)
      : mesh_(mesh), network_(network), is_kept_(is_kept), first_seam_(first_seam) {}

  void run() {
    for (std::size_t p = 0; p < network_.points.size(); ++p)
      if (is_kept_[p]) {
        network_.points[p].vertex = static_cast<int>(mesh_.positions.size());
        mesh_.positions.push_back(network_.points[p].position);
      }
    for (const MixedTriangle& mixed : network_.triangles) {
      bool is_touched = false;
      for (int p = mixed.first_piece; p < mixed.first_piece + mixed.piece_count; ++p)
        is_touched |= is_kept_[network_.pieces[p].points[0]] != 0;
      if (is_touched) divide(mixed);
    }
    link_edges();
  }

 private:
  /// A directed side of a region: part of the triangle's own side, or a piece of separation plane seen from its left or
  /// right.
  struct Side {
    int from, to, region;
    int seam;
    int part = -1;  ///< entry in parts_
    int twin = -1;  ///< piece and side: 2 piece + side
  };

  void divide(const MixedTriangle& mixed);
  void list_plane_sides(const MixedTriangle& mixed);
  void list_own_sides(TriangleIndex triangle);
  std::vector<int> take_polygon(int seed);
  void add_pieces(const MixedTriangle& mixed, const std::vector<int>& polygon);
  void link(int half_edge, int opposite) {
    mesh_.opposites[half_edge] = opposite;
    mesh_.opposites[opposite] = half_edge;
  }
  void link_plane(int half_edge, int local);
  void link_diagonal(int half_edge, int from, int to);
  void link_edges();
  void add_corner(VertexIndex vertex, const Barycentric& weights) {
    const auto known =
        std::find_if(corners_.begin(), corners_.end(), [&](const PieceCorner& c) { return c.vertex == vertex; });
    if (known == corners_.end()) corners_.push_back({vertex, weights});
  }

  CutMesh& mesh_;
  SeparationNetwork& network_;
  const std::vector<char>& is_kept_;
  int first_seam_;
  std::vector<int> parts_;  ///< half-edges of the parts of divided edges
  // Of the triangle at hand.
  std::vector<Side> sides_;
  std::vector<char> is_used_;  ///< per side
  std::vector<PieceCorner> corners_;
  UnionFind regions_;
  std::vector<std::array<int, 2>> diagonals_;  ///< half-edges that wait for their opposite, and where they start
  std::vector<int> plane_half_edges_;          ///< per piece and side
  bool is_first_ = true;                       ///< the next piece takes the triangle's place
};

/// Pieces that are not kept join the regions on their sides.
void TriangleDivider::list_plane_sides(const MixedTriangle& mixed) {
  regions_ = UnionFind(mixed.region_count);
  for (int m = mixed.first_merge; m < mixed.first_merge + mixed.merge_count; ++m)
    regions_.unite(network_.merges[m][0], network_.merges[m][1]);
  for (int p = mixed.first_piece; p < mixed.first_piece + mixed.piece_count; ++p) {
    const NetworkPiece& piece = network_.pieces[p];
    if (!is_kept_[piece.points[0]]) {
      regions_.unite(piece.regions[0], piece.regions[1]);
      continue;
    }
    const int a = network_.points[piece.points[0]].vertex, b = network_.points[piece.points[1]].vertex;
    sides_.push_back({a, b, piece.regions[0], first_seam_ + piece.cells[0], -1, 2 * p});
    sides_.push_back({b, a, piece.regions[1], first_seam_ + piece.cells[1], -1, 2 * p + 1});
    for (const int point : piece.points)
      add_corner(network_.points[point].vertex, network_.weights_in(point, mixed.triangle));
  }
}

/// The parts of the triangle's three sides, between kept points.
void TriangleDivider::list_own_sides(TriangleIndex triangle) {
  int ring_size = 0;
  for (int c = 0; c < 3; ++c) ring_size += network_.edge(3 * triangle + c).point_count;
  int region = 0;
  for (int h = 3 * triangle; h < 3 * triangle + 3; ++h) {
    DividedEdge& edge = network_.edge(h);
    const bool is_forward = edge.half_edge == h;
    Barycentric weights{};
    weights[h % 3] = 1;
    add_corner(mesh_.origins[h], weights);
    const auto begin = is_kept_.begin() + edge.first_point;
    const int kept_count = static_cast<int>(std::count(begin, begin + edge.point_count, 1));
    int& first_part = edge.parts[is_forward ? 0 : 1];
    first_part = static_cast<int>(parts_.size());
    parts_.resize(parts_.size() + static_cast<std::size_t>(kept_count) + 1, -1);
    int from = mesh_.origins[h], part = 0;
    const auto add_part = [&](int to) {
      sides_.push_back({from, to, region, mesh_.seams[h], first_part + (is_forward ? part : kept_count - part), -1});
      from = to;
      ++part;
    };
    for (int k = 0; k < edge.point_count; ++k) {
      const int point = edge.first_point + (is_forward ? k : edge.point_count - 1 - k);
      if (is_kept_[point]) add_part(network_.points[point].vertex);
      region = (region + 1) % ring_size;
    }
    add_part(mesh_.target(h));
  }
}

/// The unused sides that follow each other around a region, from one of them on.
std::vector<int> TriangleDivider::take_polygon(int seed) {
  const int root = regions_.find(sides_[seed].region);
  std::vector<int> polygon;
  for (int s = seed; s >= 0;) {
    is_used_[s] = 1;
    polygon.push_back(s);
    int following = -1;
    for (std::size_t q = 0; q < sides_.size(); ++q)
      if (!is_used_[q] && sides_[q].from == sides_[s].to && regions_.find(sides_[q].region) == root)
        following = static_cast<int>(q);
    s = following;
  }
  return polygon;
}

void TriangleDivider::link_plane(int half_edge, int local) {
  plane_half_edges_[local] = half_edge;
  if (const int other = plane_half_edges_[local ^ 1]; other >= 0) link(half_edge, other);
}

void TriangleDivider::link_diagonal(int half_edge, int from, int to) {
  for (auto& [waiting, start] : diagonals_)
    if (waiting >= 0 && start == to && mesh_.origins[CutMesh::next(waiting)] == from) {
      link(half_edge, waiting);
      waiting = -1;
      return;
    }
  diagonals_.push_back({half_edge, from});
}

/// Triangulates a region.
void TriangleDivider::add_pieces(const MixedTriangle& mixed, const std::vector<int>& polygon) {
  std::vector<PieceCorner> outline;
  outline.reserve(polygon.size());
  for (const int s : polygon)
    outline.push_back(*std::find_if(corners_.begin(), corners_.end(),
                                    [&](const PieceCorner& c) { return c.vertex == sides_[s].from; }));
  for (const auto& triple : triangulate(outline, mesh_.positions)) {
    int base = 3 * mixed.triangle;
    if (!is_first_) {
      base = static_cast<int>(mesh_.origins.size());
      mesh_.origins.resize(base + 3);
      mesh_.opposites.resize(base + 3);
      mesh_.seams.resize(base + 3);
    }
    is_first_ = false;
    for (int c = 0; c < 3; ++c) {
      const int h = base + c, a = triple[c], b = triple[(c + 1) % 3];
      mesh_.origins[h] = outline[a].vertex;
      mesh_.seams[h] = -1;
      if (b != (a + 1) % static_cast<int>(outline.size())) {
        link_diagonal(h, outline[a].vertex, outline[b].vertex);
        continue;
      }
      const Side& side = sides_[polygon[a]];
      mesh_.seams[h] = side.seam;
      if (side.part >= 0)
        parts_[side.part] = h;
      else
        link_plane(h, side.twin - 2 * mixed.first_piece);
    }
  }
}

void TriangleDivider::divide(const MixedTriangle& mixed) {
  sides_.clear(), corners_.clear(), diagonals_.clear();
  list_plane_sides(mixed);
  list_own_sides(mixed.triangle);
  plane_half_edges_.assign(2 * mixed.piece_count, -1);
  is_used_.assign(sides_.size(), 0);
  is_first_ = true;
  for (int seed = 0; seed < static_cast<int>(sides_.size()); ++seed)
    if (!is_used_[seed]) add_pieces(mixed, take_polygon(seed));
}

/// Sides of the divided triangles meet each other's parts, or a triangle that was left as it was.
void TriangleDivider::link_edges() {
  for (const DividedEdge& edge : network_.edges) {
    if (edge.parts[0] < 0 && edge.parts[1] < 0) continue;
    int count = 1;
    for (int p = edge.first_point; p < edge.first_point + edge.point_count; ++p) count += is_kept_[p];
    for (int k = 0; k < count; ++k)
      link(edge.parts[0] >= 0 ? parts_[edge.parts[0] + k] : edge.half_edge,
           edge.parts[1] >= 0 ? parts_[edge.parts[1] + k] : edge.opposite);
  }
}

}  // namespace

CutOutcome cut_along_separation(CutMesh& mesh, const NodeCells& node, const std::vector<std::uint8_t>& labels,
                                int first_seam) {
  SeparationNetwork network(mesh, node, labels);
  const std::vector<char> is_kept = choose_kept_points(network, node);
  CutOutcome outcome;
  if (is_kept.empty()) {
    outcome.status = CutStatus::kNoSurface;
  } else if (outcome.crossed_half_edge = first_crossing(network, mesh, is_kept, outcome.point);
             outcome.crossed_half_edge >= 0) {
    outcome.status = CutStatus::kCrossesSeam;
  } else {
    TriangleDivider(mesh, network, is_kept, first_seam).run();
  }
  return outcome;
}

}  // namespace skeletex
