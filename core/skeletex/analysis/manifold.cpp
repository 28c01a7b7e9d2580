// SPDX-License-Identifier: MIT
#include "skeletex/analysis/manifold.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numeric>
#include <span>

#include "skeletex/geometry/union_find.h"

namespace skeletex {
namespace {

/// One side of an edge: the corner of a triangle that it starts at.
struct Side {
  int other;   ///< the edge's larger vertex
  int corner;  ///< 3 * triangle + place of the vertex where the triangle enters the edge
};

/// The sides of all edges in buckets by the smaller vertex. A bucket holds few, so sorting them is cheap.
struct EdgeSides {
  std::vector<std::size_t> begin;  ///< per vertex, and the end
  std::vector<Side> sides;         ///< in a bucket by the larger vertex, then by corner
};

/// Lists triangles that cannot be used and vertices that are not.
/// \return per triangle whether it is used
std::vector<char> find_unusable(const TriangleMesh& mesh, ManifoldReport& report) {
  const int vertex_count = report.vertices;
  std::vector<char> is_referenced(vertex_count, 0), is_used(mesh.triangles.size(), 1);
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    const auto& [a, b, c] = mesh.triangles[t];
    bool is_good = a != b && b != c && c != a;
    for (const int v : mesh.triangles[t]) {
      const bool is_there = v >= 0 && v < vertex_count;
      if (is_there) is_referenced[v] = 1;
      is_good = is_good && is_there;
    }
    if (is_good) continue;
    is_used[t] = 0;
    report.degenerate_triangles.push_back(static_cast<int>(t));
  }
  for (int v = 0; v < vertex_count; ++v) {
    if (!mesh.positions[v].allFinite()) report.non_finite_vertices.push_back(v);
    if (!is_referenced[v]) report.unreferenced_vertices.push_back(v);
  }
  return is_used;
}

EdgeSides sides_of_edges(const TriangleMesh& mesh, const std::vector<char>& is_used) {
  const auto for_each_side = [&](auto&& act) {
    for (std::size_t t = 0; t < mesh.triangles.size(); ++t)
      for (int k = 0; k < 3 && is_used[t]; ++k) {
        const int from = mesh.triangles[t][k], to = mesh.triangles[t][(k + 1) % 3];
        act(std::min(from, to), std::max(from, to), 3 * static_cast<int>(t) + k);
      }
  };
  EdgeSides edges;
  edges.begin.assign(mesh.positions.size() + 1, 0);
  for_each_side([&](int smaller, int, int) { ++edges.begin[smaller + 1]; });
  std::partial_sum(edges.begin.begin(), edges.begin.end(), edges.begin.begin());
  edges.sides.resize(edges.begin.back());
  std::vector<std::size_t> next(edges.begin.begin(), edges.begin.end() - 1);
  for_each_side([&](int smaller, int larger, int corner) { edges.sides[next[smaller]++] = {larger, corner}; });
  for (std::size_t v = 0; v < mesh.positions.size(); ++v)
    std::sort(edges.sides.begin() + static_cast<std::ptrdiff_t>(edges.begin[v]),
              edges.sides.begin() + static_cast<std::ptrdiff_t>(edges.begin[v + 1]), [](const Side& a, const Side& b) {
                return a.other != b.other ? a.other < b.other : a.corner < b.corner;
              });
  return edges;
}

int end_corner(int corner) { return corner % 3 == 2 ? corner - 2 : corner + 1; }
int vertex_of(const TriangleMesh& mesh, int corner) { return mesh.triangles[corner / 3][corner % 3]; }

/// Files one edge under what it is, and joins the corners at its ends.
void add_edge(const TriangleMesh& mesh, VertexIndex vertex, std::span<const Side> uses, UnionFind& fans,
              ManifoldReport& report) {
  const int corner = uses[0].corner;
  ++report.edges;
  for (const Side& side : uses.subspan(1)) {
    const bool is_same_way = vertex_of(mesh, side.corner) == vertex_of(mesh, corner);
    fans.unite(corner, is_same_way ? side.corner : end_corner(side.corner));
    fans.unite(end_corner(corner), is_same_way ? end_corner(side.corner) : side.corner);
  }
  if (uses.size() == 1)
    report.boundary_edges.push_back({vertex_of(mesh, corner), vertex_of(mesh, end_corner(corner))});
  else if (uses.size() > 2)
    report.non_manifold_edges.push_back({vertex, uses[0].other});
  else if (vertex_of(mesh, corner) == vertex_of(mesh, uses[1].corner))
    report.misoriented_edges.push_back({vertex, uses[0].other});
}

/// Corners of one vertex that are joined through edges form a fan.
UnionFind join_fans(const TriangleMesh& mesh, const EdgeSides& edges, ManifoldReport& report) {
  UnionFind fans(3 * static_cast<int>(mesh.triangles.size()));
  for (int v = 0; v < report.vertices; ++v)
    for (std::size_t first = edges.begin[v]; first < edges.begin[v + 1];) {
      std::size_t stop = first + 1;
      while (stop < edges.begin[v + 1] && edges.sides[stop].other == edges.sides[first].other) ++stop;
      add_edge(mesh, v, {edges.sides.data() + first, stop - first}, fans, report);
      first = stop;
    }
  std::sort(report.boundary_edges.begin(), report.boundary_edges.end());
  return fans;
}

}  // namespace

ManifoldReport measure_manifold(const TriangleMesh& mesh) {
  ManifoldReport report;
  report.vertices = static_cast<int>(mesh.positions.size());
  report.triangles = static_cast<int>(mesh.triangles.size());
  const std::vector<char> is_used = find_unusable(mesh, report);
  UnionFind fans = join_fans(mesh, sides_of_edges(mesh, is_used), report);

  std::vector<int> fan_counts(report.vertices, 0);
  UnionFind parts(report.vertices);
  for (int t = 0; t < report.triangles; ++t) {
    if (!is_used[t]) continue;
    for (int k = 0; k < 3; ++k) fan_counts[mesh.triangles[t][k]] += fans.find(3 * t + k) == 3 * t + k;
    parts.unite(mesh.triangles[t][0], mesh.triangles[t][1]);
    parts.unite(mesh.triangles[t][0], mesh.triangles[t][2]);
  }
  int used_vertices = 0;
  for (int v = 0; v < report.vertices; ++v) {
    if (fan_counts[v] == 0) continue;
    ++used_vertices;
    if (fan_counts[v] > 1) report.non_manifold_vertices.push_back(v);
    report.components += parts.find(v) == v;
  }
  const int used_triangles = report.triangles - static_cast<int>(report.degenerate_triangles.size());
  report.genus = report.components - (used_vertices - report.edges + used_triangles) / 2;
  return report;
}

}  // namespace skeletex
