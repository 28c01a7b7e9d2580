// SPDX-License-Identifier: MIT
#include "skeletex/analysis/manifold.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numeric>

namespace skeletex {
namespace {

class DisjointSets {
 public:
  explicit DisjointSets(std::size_t size) : parent_(size) { std::iota(parent_.begin(), parent_.end(), 0); }
  int find(int i) {
    while (parent_[i] != i) i = parent_[i] = parent_[parent_[i]];
    return i;
  }
  void join(int i, int j) {
    i = find(i);
    j = find(j);
    if (i != j) parent_[std::max(i, j)] = std::min(i, j);
  }
  bool is_root(int i) const { return parent_[i] == i; }

 private:
  std::vector<int> parent_;
};

/// One side of an edge: the corner of a triangle that it starts at.
struct Side {
  int other;   ///< the edge's larger vertex
  int corner;  ///< 3 * triangle + place of the vertex where the triangle enters the edge
};

}  // namespace

ManifoldReport measure_manifold(const TriangleMesh& mesh) {
  ManifoldReport report;
  const int vertex_count = static_cast<int>(mesh.positions.size());
  const int triangle_count = static_cast<int>(mesh.triangles.size());
  report.vertices = vertex_count;
  report.triangles = triangle_count;

  std::vector<char> is_referenced(vertex_count, 0), is_used(triangle_count, 1);
  for (int t = 0; t < triangle_count; ++t) {
    const Triangle& triangle = mesh.triangles[t];
    bool is_good = true;
    for (const int v : triangle) {
      if (v >= 0 && v < vertex_count)
        is_referenced[v] = 1;
      else
        is_good = false;
    }
    if (triangle[0] == triangle[1] || triangle[1] == triangle[2] || triangle[2] == triangle[0]) is_good = false;
    if (is_good) continue;
    is_used[t] = 0;
    report.degenerate_triangles.push_back(t);
  }
  for (int v = 0; v < vertex_count; ++v) {
    if (!mesh.positions[v].allFinite()) report.non_finite_vertices.push_back(v);
    if (!is_referenced[v]) report.unreferenced_vertices.push_back(v);
  }

  // The sides of all edges in buckets by the smaller vertex; a bucket holds few, so sorting them is cheap.
  std::vector<std::size_t> begin(static_cast<std::size_t>(vertex_count) + 1, 0);
  const auto for_each_side = [&](auto&& act) {
    for (int t = 0; t < triangle_count; ++t) {
      if (!is_used[t]) continue;
      for (int k = 0; k < 3; ++k) {
        const int from = mesh.triangles[t][k], to = mesh.triangles[t][(k + 1) % 3];
        act(std::min(from, to), std::max(from, to), 3 * t + k);
      }
    }
  };
  for_each_side([&](int smaller, int, int) { ++begin[smaller + 1]; });
  std::partial_sum(begin.begin(), begin.end(), begin.begin());
  std::vector<Side> sides(begin.back());
  {
    std::vector<std::size_t> next(begin.begin(), begin.end() - 1);
    for_each_side([&](int smaller, int larger, int corner) { sides[next[smaller]++] = {larger, corner}; });
  }

  // Corners of one vertex that are joined through edges form a fan.
  DisjointSets fans(3 * static_cast<std::size_t>(triangle_count));
  const auto end_corner = [](int corner) { return corner % 3 == 2 ? corner - 2 : corner + 1; };
  const auto vertex_of = [&](int corner) { return mesh.triangles[corner / 3][corner % 3]; };
  for (int v = 0; v < vertex_count; ++v) {
    const auto first = sides.begin() + static_cast<std::ptrdiff_t>(begin[v]),
               last = sides.begin() + static_cast<std::ptrdiff_t>(begin[v + 1]);
    std::sort(first, last, [](const Side& a, const Side& b) {
      return a.other != b.other ? a.other < b.other : a.corner < b.corner;
    });
    for (auto it = first; it != last;) {
      auto stop = it + 1;
      while (stop != last && stop->other == it->other) ++stop;
      ++report.edges;
      for (auto side = it + 1; side != stop; ++side) {
        const bool is_same_way = vertex_of(side->corner) == vertex_of(it->corner);
        fans.join(it->corner, is_same_way ? side->corner : end_corner(side->corner));
        fans.join(end_corner(it->corner), is_same_way ? end_corner(side->corner) : side->corner);
      }
      const auto uses = stop - it;
      if (uses == 1)
        report.boundary_edges.push_back({vertex_of(it->corner), vertex_of(end_corner(it->corner))});
      else if (uses > 2)
        report.non_manifold_edges.push_back({v, it->other});
      else if (vertex_of(it->corner) == vertex_of((it + 1)->corner))
        report.misoriented_edges.push_back({v, it->other});
      it = stop;
    }
  }
  std::sort(report.boundary_edges.begin(), report.boundary_edges.end());

  std::vector<int> fan_counts(vertex_count, 0);
  DisjointSets parts(vertex_count);
  int used_vertices = 0;
  for (int t = 0; t < triangle_count; ++t) {
    if (!is_used[t]) continue;
    for (int k = 0; k < 3; ++k)
      if (fans.is_root(3 * t + k)) ++fan_counts[mesh.triangles[t][k]];
    parts.join(mesh.triangles[t][0], mesh.triangles[t][1]);
    parts.join(mesh.triangles[t][0], mesh.triangles[t][2]);
  }
  for (int v = 0; v < vertex_count; ++v) {
    if (fan_counts[v] == 0) continue;
    ++used_vertices;
    if (fan_counts[v] > 1) report.non_manifold_vertices.push_back(v);
    if (parts.is_root(v)) ++report.components;
  }
  const int used_triangles = triangle_count - static_cast<int>(report.degenerate_triangles.size());
  report.genus = report.components - (used_vertices - report.edges + used_triangles) / 2;
  return report;
}

}  // namespace skeletex
