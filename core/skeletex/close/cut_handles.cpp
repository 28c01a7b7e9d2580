// SPDX-License-Identifier: MIT
#include "skeletex/close/cut_handles.h"

#include <algorithm>
#include <array>
#include <limits>
#include <map>
#include <numeric>
#include <queue>
#include <set>

#include "skeletex/analysis/manifold.h"
#include "skeletex/close/fill_holes.h"
#include "skeletex/geometry/half_edge_table.h"
#include "skeletex/geometry/union_find.h"

namespace skeletex {
namespace {

/// A closed path of vertices, each once. It begins and ends beside the edge that closes it.
struct Loop {
  std::vector<int> vertices;
  double length = 0;
};

/// Loops of a closed mesh that do not part it.
class LoopSearch {
 public:
  explicit LoopSearch(const TriangleMesh& mesh)
      : mesh_(mesh), table_(link_half_edges(mesh.triangles, static_cast<int>(mesh.positions.size()))) {}

  /// One short loop for each of a basis, the shortest first.
  std::vector<Loop> short_loops() const {
    std::vector<Loop> loops;
    for (Loop& wide : loops_through(mesh_.triangles[0][0])) {
      // Its closing edge lies by the handle, however far the root is.
      Loop best = std::move(wide);
      for (int root = best.vertices.front();; root = best.vertices[best.vertices.size() / 2]) {
        const std::vector<Loop> others = loops_through(root, best.length);
        const auto shortest = std::ranges::min_element(others, {}, &Loop::length);
        if (shortest == others.end() || !(shortest->length < best.length)) break;
        best = *shortest;
      }
      loops.push_back(std::move(best));
    }
    std::ranges::sort(loops, {}, &Loop::length);
    return loops;
  }

 private:
  int origin(int h) const { return mesh_.triangles[h / 3][h % 3]; }
  int target(int h) const { return origin(HalfEdgeTable::next(h)); }
  double edge_length(int h) const { return (mesh_.positions[target(h)] - mesh_.positions[origin(h)]).norm(); }

  struct Paths {
    std::vector<double> distance;
    std::vector<int> entry;  ///< per vertex the half-edge that leads to it; -1: the root, and beyond the reach
  };
  Paths shortest_paths(int root, double reach) const {
    Paths paths{std::vector<double>(mesh_.positions.size(), std::numeric_limits<double>::infinity()),
                std::vector<int>(mesh_.positions.size(), -1)};
    using Reached = std::pair<double, int>;
    std::priority_queue<Reached, std::vector<Reached>, std::greater<>> queue;
    queue.emplace(paths.distance[root] = 0, root);
    while (!queue.empty()) {
      const auto [distance, v] = queue.top();
      queue.pop();
      if (distance > paths.distance[v]) continue;
      for (int k = table_.begin[v]; k < table_.begin[v + 1]; ++k) {
        const int h = table_.outgoing[k], to = table_.targets[k];
        const double reached = distance + edge_length(h);
        if (reached >= paths.distance[to] || reached > reach) continue;
        queue.emplace(paths.distance[to] = reached, to);
        paths.entry[to] = h;
      }
    }
    return paths;
  }

  /// A basis of the loops within a reach of a root: each runs along shortest paths from there, but for the edge that
  /// closes it. The paths form a tree, which does not part a surface, so its branches beyond the reach are left out.
  std::vector<Loop> loops_through(int root, double reach = std::numeric_limits<double>::infinity()) const {
    const Paths paths = shortest_paths(root, reach);
    const auto is_on_path = [&](int h) { return paths.entry[target(h)] == h; };
    const auto is_reached = [&](int v) { return paths.distance[v] < std::numeric_limits<double>::infinity(); };
    UnionFind triangles(static_cast<int>(mesh_.triangles.size()));
    std::vector<std::pair<double, int>> others;
    for (int h = 0; h < static_cast<int>(table_.twins.size()); ++h) {
      if (h > table_.twins[h]) continue;
      if (!is_reached(origin(h)) || !is_reached(target(h)))
        triangles.unite(h / 3, table_.twins[h] / 3);
      else if (!is_on_path(h) && !is_on_path(table_.twins[h]))
        others.emplace_back(paths.distance[origin(h)] + edge_length(h) + paths.distance[target(h)], h);
    }
    // Edges off the paths join triangles, those of long loops first, until they form a tree over all triangles. Each
    // edge that is left closes a loop of the basis.
    std::ranges::sort(others, std::greater<>());
    std::vector<Loop> loops;
    for (const auto& [length, h] : others) {
      if (triangles.find(h / 3) == triangles.find(table_.twins[h] / 3))
        loops.push_back(loop_closed_by(h, paths));
      else
        triangles.unite(h / 3, table_.twins[h] / 3);
    }
    return loops;
  }

  std::vector<int> path_to_root(VertexIndex vertex, const Paths& paths) const {
    std::vector<int> path{vertex};
    while (paths.entry[path.back()] >= 0) path.push_back(origin(paths.entry[path.back()]));
    return path;
  }
  /// Without the way that both of its halves share.
  Loop loop_closed_by(int h, const Paths& paths) const {
    std::vector<int> there = path_to_root(origin(h), paths), back = path_to_root(target(h), paths);
    while (there.size() > 1 && back.size() > 1 && there[there.size() - 2] == back[back.size() - 2])
      there.pop_back(), back.pop_back();
    const double length = paths.distance[there.front()] + edge_length(h) + paths.distance[back.front()] -
                          2 * paths.distance[there.back()];
    there.insert(there.end(), back.rbegin() + 1, back.rend());
    return {std::move(there), length};
  }

  const TriangleMesh& mesh_;
  HalfEdgeTable table_;
};

bool is_connected(const TriangleMesh& mesh) {
  UnionFind parts = connected_vertices(mesh);
  return std::ranges::all_of(mesh.triangles,
                             [&](const Triangle& t) { return parts.find(t[0]) == parts.find(mesh.triangles[0][0]); });
}

/// Moves the rims of fillings, which lie on each other in pairs, into the triangles beside them.
/// \param origins  per triangle; -1: it is of a filling
void draw_apart(TriangleMesh& mesh, const std::vector<int>& origins) {
  constexpr double kShare = 0.25;  // of the triangle's height, or of its edge
  std::set<std::array<int, 2>> filled_edges;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t)
    for (int k = 0; k < 3 && origins[t] < 0; ++k)
      filled_edges.insert({mesh.triangles[t][k], mesh.triangles[t][(k + 1) % 3]});
  struct Move {
    Vec3 direction = Vec3::Zero();
    double length = std::numeric_limits<double>::infinity();
  };
  std::map<int, Move> moves;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t)
    for (int k = 0; k < 3 && origins[t] >= 0; ++k) {
      const int from = mesh.triangles[t][k], to = mesh.triangles[t][(k + 1) % 3];
      if (!filled_edges.contains({to, from})) continue;
      const Vec3 edge = mesh.positions[to] - mesh.positions[from];
      Vec3 inwards = mesh.positions[mesh.triangles[t][(k + 2) % 3]] - mesh.positions[from];
      if (edge.squaredNorm() > 0) inwards -= edge * (edge.dot(inwards) / edge.squaredNorm());
      const double height = inwards.norm();
      for (const int v : {from, to}) {
        if (height > 0) moves[v].direction += inwards / height;
        moves[v].length = std::min({moves[v].length, height, edge.norm()});
      }
    }
  for (const auto& [v, move] : moves)
    if (move.direction.norm() > 0) mesh.positions[v] += kShare * move.length * move.direction.normalized();
}

/// Cuts a mesh along a loop. The triangles left of it get vertices of their own.
/// \param copies  takes the vertex that each new one is a copy of
/// \return false, and nothing is changed, where the loop touches a boundary or parts the mesh
bool cut_along(const std::vector<int>& loop, TriangleMesh& mesh, std::vector<int>& copies) {
  const HalfEdgeTable table = link_half_edges(mesh.triangles, static_cast<int>(mesh.positions.size()));
  const auto target = [&](int h) { return mesh.triangles[h / 3][HalfEdgeTable::next(h) % 3]; };
  TriangleMesh cut = mesh;
  for (std::size_t i = 0; i < loop.size(); ++i) {
    const int v = loop[i], after = loop[(i + 1) % loop.size()], before = loop[(i + loop.size() - 1) % loop.size()];
    int h = -1;
    for (int k = table.begin[v]; k < table.begin[v + 1]; ++k)
      if (table.targets[k] == after) h = table.outgoing[k];
    const int copy = static_cast<int>(cut.positions.size());
    for (; h >= 0 && target(h) != before; h = table.turn_left(h)) cut.triangles[h / 3][h % 3] = copy;
    if (h < 0) return false;
    cut.positions.push_back(mesh.positions[v]);
  }
  if (!is_connected(cut)) return false;
  mesh = std::move(cut);
  copies.insert(copies.end(), loop.begin(), loop.end());
  return true;
}

/// Cuts along loops that have no vertex in common.
/// \param loops  of the mesh, the shortest first
std::vector<CutLoop> cut_short_loops(const std::vector<Loop>& loops, double longest, TriangleMesh& mesh,
                                     std::vector<int>& copies) {
  std::vector<CutLoop> cuts;
  std::vector<bool> is_taken(mesh.positions.size());
  const TriangleMesh whole = mesh;
  for (const Loop& loop : loops) {
    if (loop.length > longest) break;
    if (std::ranges::any_of(loop.vertices, [&](int v) { return is_taken[v]; })) continue;
    if (!cut_along(loop.vertices, mesh, copies)) continue;
    CutLoop& cut = cuts.emplace_back(CutLoop{Vec3::Zero(), loop.length});
    for (const int v : loop.vertices) {
      is_taken[v] = true;
      cut.centre += whole.positions[v] / static_cast<double>(loop.vertices.size());
    }
  }
  return cuts;
}

}  // namespace

HandleCuts cut_handles(TriangleMesh& mesh, double longest) {
  HandleCuts result;
  result.origins.resize(mesh.triangles.size());
  std::iota(result.origins.begin(), result.origins.end(), 0);
  const int before = static_cast<int>(mesh.positions.size());
  while (measure_manifold(mesh).genus > 0) {
    TriangleMesh cut = mesh;
    std::vector<int> copies;
    const std::vector<Loop> short_loops = LoopSearch(mesh).short_loops();
    result.shortest_left = short_loops.front().length;
    const std::vector<CutLoop> loops = cut_short_loops(short_loops, longest, cut, copies);
    if (loops.empty()) break;
    const FillResult filling = fill_holes(cut);
    if (!filling.obstacle.empty() || !filling.copies.empty()) {
      result.is_stuck = true;
      break;
    }
    draw_apart(cut, filling.origins);
    mesh = std::move(cut);
    result.shortest_left = 0;
    result.loops.insert(result.loops.end(), loops.begin(), loops.end());
    for (const int v : copies) result.copies.push_back(v < before ? v : result.copies[v - before]);
    std::vector<int> origins;
    for (const int t : filling.origins) origins.push_back(t < 0 ? -1 : result.origins[t]);
    result.origins = std::move(origins);
  }
  return result;
}

}  // namespace skeletex
