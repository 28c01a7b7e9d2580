// SPDX-License-Identifier: MIT
#include "skeletex/close/fill_holes.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <limits>
#include <map>
#include <set>

#include "skeletex/analysis/manifold.h"

namespace skeletex {
namespace {

/// The loops of a boundary, each through different vertices: where several meet in a vertex, they part there.
std::vector<std::vector<int>> boundary_loops(const std::vector<std::array<int, 2>>& edges) {
  std::map<int, std::vector<int>> next;  // a hole's triangle runs against those at its edges
  for (const auto& [from, to] : edges) next[to].push_back(from);
  std::vector<std::vector<int>> loops;
  for (const auto& [start, unused] : next) {
    std::vector<int> path{start};
    std::map<int, std::size_t> place{{start, 0}};
    while (!path.empty()) {
      std::vector<int>& ways = next[path.back()];
      if (ways.empty()) break;
      const int vertex = ways.back();
      ways.pop_back();
      const auto found = place.find(vertex);
      if (found == place.end()) {
        place[vertex] = path.size();
        path.push_back(vertex);
        continue;
      }
      const auto first = path.begin() + static_cast<std::ptrdiff_t>(found->second);
      loops.emplace_back(first, path.end());
      for (auto passed = first + 1; passed != path.end(); ++passed) place.erase(*passed);
      path.erase(first + 1, path.end());
    }
  }
  return loops;
}

using EdgeSet = std::set<std::array<int, 2>>;

/// The triangulation of a polygon in space with the least area; none of its inner edges may be one of the mesh.
/// \return empty where there is none
std::vector<Triangle> triangulate(const std::vector<Vec3>& positions, const std::vector<int>& loop,
                                  const EdgeSet& edges) {
  const int n = static_cast<int>(loop.size());
  const auto at = [&](int i) -> const Vec3& { return positions[loop[i]]; };
  const auto is_free = [&](int i, int k) {
    return k - i == 1 || (i == 0 && k == n - 1) ||
           edges.count({std::min(loop[i], loop[k]), std::max(loop[i], loop[k])}) == 0;
  };
  std::vector<double> least(static_cast<std::size_t>(n) * n, 0);
  std::vector<int> split(static_cast<std::size_t>(n) * n, -1);
  for (int span = 2; span < n; ++span)
    for (int i = 0; i + span < n; ++i) {
      const int k = i + span;
      double best = std::numeric_limits<double>::infinity();
      for (int m = i + 1; m < k && is_free(i, k); ++m) {
        const double area = least[i * n + m] + least[m * n + k] + 0.5 * (at(m) - at(i)).cross(at(k) - at(i)).norm();
        if (area < best) best = area, split[i * n + k] = m;
      }
      least[i * n + k] = best;
    }
  std::vector<Triangle> triangles;
  std::vector<std::array<int, 2>> open{{0, n - 1}};
  while (!open.empty()) {
    const auto [i, k] = open.back();
    open.pop_back();
    if (k - i < 2) continue;
    const int m = split[i * n + k];
    if (m < 0) return {};
    triangles.push_back({loop[i], loop[m], loop[k]});
    open.push_back({i, m});
    open.push_back({m, k});
  }
  return triangles;
}

/// Takes triangles away that have two corners in one vertex, and all but one of those with the same corners.
/// \return per triangle that is left its number before
std::vector<int> remove_useless(TriangleMesh& mesh) {
  std::set<Triangle> seen;
  std::vector<Triangle> kept;
  std::vector<int> origins;
  for (int i = 0; i < static_cast<int>(mesh.triangles.size()); ++i) {
    const Triangle& t = mesh.triangles[i];
    Triangle sorted = t;
    std::sort(sorted.begin(), sorted.end());
    if (sorted[0] == sorted[1] || sorted[1] == sorted[2] || !seen.insert(sorted).second) continue;
    kept.push_back(t);
    origins.push_back(i);
  }
  mesh.triangles = std::move(kept);
  return origins;
}

std::string obstacle_of(const ManifoldReport& report, const std::vector<Hole>& holes, double diagonal) {
  if (!report.non_manifold_edges.empty())
    return fmt::format("{} edges have more than two triangles", report.non_manifold_edges.size());
  if (!report.misoriented_edges.empty())
    return fmt::format("triangles on both sides of {} edges do not agree on what is outside",
                       report.misoriented_edges.size());
  const Hole* widest = nullptr;
  int left = 0;
  for (const Hole& hole : holes)
    if (!hole.is_filled) {
      ++left;
      if (!widest || hole.size > widest->size) widest = &hole;
    }
  if (widest)
    return fmt::format(
        "{} holes are too large to fill; the largest has {} edges around {}, {:.1f} % of the diagonal "
        "across",
        left, widest->loop.size(), text_of(widest->centre), 100 * widest->size / diagonal);
  if (!report.boundary_edges.empty())
    return fmt::format("{} edges have one triangle only", report.boundary_edges.size());
  if (!report.non_manifold_vertices.empty())
    return fmt::format("parts touch in {} single vertices", report.non_manifold_vertices.size());
  if (report.components > 1) return fmt::format("it has {} parts", report.components);
  return {};
}

}  // namespace

FillResult fill_holes(TriangleMesh& mesh, const FillOptions& options) {
  FillResult result;
  result.origins = remove_useless(mesh);
  const double diagonal = bounding_box(mesh).diagonal();
  ManifoldReport report = measure_manifold(mesh);
  EdgeSet edges;
  for (const Triangle& t : mesh.triangles)
    for (int k = 0; k < 3; ++k) edges.insert({std::min(t[k], t[(k + 1) % 3]), std::max(t[k], t[(k + 1) % 3])});
  for (std::vector<int>& loop : boundary_loops(report.boundary_edges)) {
    Hole hole;
    TriangleMesh points;
    for (const int v : loop) {
      points.positions.push_back(mesh.positions[v]);
      hole.centre += mesh.positions[v] / static_cast<double>(loop.size());
    }
    hole.size = bounding_box(points).diagonal();
    if (hole.size <= options.largest * diagonal && static_cast<int>(loop.size()) <= options.most_edges) {
      const std::vector<Triangle> filling = triangulate(mesh.positions, loop, edges);
      for (const Triangle& t : filling) {
        mesh.triangles.push_back(t);
        result.origins.push_back(-1);
        for (int k = 0; k < 3; ++k) edges.insert({std::min(t[k], t[(k + 1) % 3]), std::max(t[k], t[(k + 1) % 3])});
      }
      hole.is_filled = !filling.empty();
    }
    hole.loop = std::move(loop);
    result.holes.push_back(std::move(hole));
  }
  report = measure_manifold(mesh);
  result.obstacle = obstacle_of(report, result.holes, diagonal);
  return result;
}

}  // namespace skeletex
