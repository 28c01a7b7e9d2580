// SPDX-License-Identifier: MIT
#include "skeletex/close/manifold_parts.h"

#include <algorithm>
#include <array>
#include <map>
#include <set>

#include "skeletex/analysis/manifold.h"
#include "skeletex/geometry/union_find.h"

namespace skeletex {
namespace {

using EdgeSet = std::set<std::array<int, 2>>;

EdgeSet bad_edges(const TriangleMesh& mesh) {
  const ManifoldReport report = measure_manifold(mesh);
  EdgeSet edges;
  for (const auto* list : {&report.non_manifold_edges, &report.misoriented_edges})
    for (const auto& [a, b] : *list) edges.insert({std::min(a, b), std::max(a, b)});
  return edges;
}

/// Keeps the triangles for which that is so.
template <typename Keep>
void keep_triangles(TriangleMesh& mesh, std::vector<int>& origins, const Keep& is_kept) {
  std::size_t kept = 0;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t)
    if (is_kept(mesh.triangles[t])) {
      mesh.triangles[kept] = mesh.triangles[t];
      origins[kept++] = origins[t];
    }
  mesh.triangles.resize(kept);
  origins.resize(kept);
}

/// The connected components of a mesh; a triangle is in that of its first vertex.
struct Components {
  UnionFind vertices;
  std::map<int, double> areas;  ///< by component
  explicit Components(const TriangleMesh& mesh) : vertices(connected_vertices(mesh)) {
    for (const Triangle& t : mesh.triangles) areas[vertices.find(t[0])] += area_vector(mesh, t).norm();
  }
};

/// \param triangles  all at the vertex
/// \param copies  per new vertex the one that it is a copy of
void split_vertex(VertexIndex vertex, const std::vector<int>& triangles, TriangleMesh& mesh, std::vector<int>& copies) {
  UnionFind sheets(static_cast<int>(triangles.size()));
  std::map<int, int> seen;  // another corner -> a triangle with it
  for (int i = 0; i < static_cast<int>(triangles.size()); ++i)
    for (const int corner : mesh.triangles[triangles[i]])
      if (corner != vertex)
        if (const auto [at, is_new] = seen.emplace(corner, i); !is_new) sheets.unite(i, at->second);
  std::map<int, int> vertex_of_sheet{{sheets.find(0), vertex}};
  for (int i = 0; i < static_cast<int>(triangles.size()); ++i) {
    const auto [at, is_new] = vertex_of_sheet.emplace(sheets.find(i), static_cast<int>(mesh.positions.size()));
    if (is_new) {
      mesh.positions.push_back(mesh.positions[vertex]);
      copies.push_back(vertex);
    }
    std::replace(mesh.triangles[triangles[i]].begin(), mesh.triangles[triangles[i]].end(), static_cast<int>(vertex),
                 at->second);
  }
}

}  // namespace

int remove_non_manifold_edges(TriangleMesh& mesh, std::vector<int>& origins) {
  constexpr double kMost = 0.02;  // of the triangles
  constexpr std::size_t kFew = 12;
  constexpr double kDangling = 0.001;  // of the area
  const EdgeSet edges = bad_edges(mesh);
  if (edges.empty()) return 0;
  TriangleMesh rest = mesh;
  std::vector<int> rest_origins = origins;
  keep_triangles(rest, rest_origins, [&](const Triangle& t) {
    for (int k = 0; k < 3; ++k)
      if (edges.contains({std::min(t[k], t[(k + 1) % 3]), std::max(t[k], t[(k + 1) % 3])})) return false;
    return true;
  });
  Components components(rest);
  const double least = kDangling * surface_area(rest);
  std::set<int> dangling;
  for (const auto& edge : edges)
    for (const int v : edge)
      if (const auto found = components.areas.find(components.vertices.find(v));
          found != components.areas.end() && found->second < least)
        dangling.insert(found->first);
  keep_triangles(rest, rest_origins,
                 [&](const Triangle& t) { return !dangling.contains(components.vertices.find(t[0])); });
  const std::size_t removed = mesh.triangles.size() - rest.triangles.size();
  if (removed > std::max(kFew, static_cast<std::size_t>(kMost * static_cast<double>(origins.size())))) return 0;
  mesh = std::move(rest);
  origins = std::move(rest_origins);
  return static_cast<int>(removed);
}

std::vector<int> split_non_manifold_vertices(TriangleMesh& mesh) {
  const std::vector<int> touching = measure_manifold(mesh).non_manifold_vertices;
  std::map<int, std::vector<int>> triangles_at;
  for (const int v : touching) triangles_at[v];
  for (int t = 0; t < static_cast<int>(mesh.triangles.size()); ++t)
    for (const int v : mesh.triangles[t])
      if (const auto found = triangles_at.find(v); found != triangles_at.end()) found->second.push_back(t);
  std::vector<int> copies;
  for (const auto& [vertex, triangles] : triangles_at) split_vertex(vertex, triangles, mesh, copies);
  return copies;
}

int remove_small_components(TriangleMesh& mesh, double share) {
  Components components(mesh);
  const double least = share * surface_area(mesh);
  std::erase_if(mesh.triangles,
                [&](const Triangle& t) { return components.areas.at(components.vertices.find(t[0])) < least; });
  return static_cast<int>(std::count_if(components.areas.begin(), components.areas.end(),
                                        [&](const auto& component) { return component.second < least; }));
}

double keep_largest_component(TriangleMesh& mesh, std::vector<int>& origins) {
  Components components(mesh);
  const auto largest = std::max_element(components.areas.begin(), components.areas.end(),
                                        [](const auto& a, const auto& b) { return a.second < b.second; });
  if (largest == components.areas.end()) return 0;
  TriangleMesh part = mesh;
  std::vector<int> part_origins = origins;
  keep_triangles(part, part_origins,
                 [&](const Triangle& t) { return components.vertices.find(t[0]) == largest->first; });
  if (!measure_manifold(part).is_closed_manifold()) return 0;
  const double share = largest->second / surface_area(mesh);
  mesh = std::move(part);
  origins = std::move(part_origins);
  return share;
}

}  // namespace skeletex
