// SPDX-License-Identifier: MIT
#include "skeletex/close/fill_holes.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numeric>
#include <set>

#include "skeletex/analysis/manifold.h"
#include "skeletex/analysis/orientation.h"
#include "skeletex/close/manifold_parts.h"
#include "skeletex/geometry/self_intersection.h"
#include "skeletex/geometry/triangle_tree.h"
#include "skeletex/geometry/union_find.h"

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
      const VertexIndex vertex = ways.back();
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

/// Turns triangles that do not agree with most of their component on what is outside, where that is possible.
/// \return how many
long turn_triangles(TriangleMesh& mesh) {
  const TriangleTurns turns = triangles_to_turn(mesh, measure_manifold(mesh));
  if (!turns.is_orientable) return 0;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t)
    if (turns.is_turned[t]) std::swap(mesh.triangles[t][1], mesh.triangles[t][2]);
  return turns.count;
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
    if (!hole.refusal.empty()) {
      ++left;
      if (!widest || hole.size > widest->size) widest = &hole;
    }
  if (widest)
    return fmt::format(
        "{} hole{} cannot be filled: the widest, {} edges around {}, {:.1f} % of the diagonal across, {}", left,
        left == 1 ? "" : "s", widest->loop.size(), text_of(widest->centre), 100 * widest->size / diagonal,
        widest->refusal);
  if (!report.boundary_edges.empty())
    return fmt::format("{} edges have one triangle only", report.boundary_edges.size());
  if (!report.non_manifold_vertices.empty())
    return fmt::format("parts touch in {} single vertices", report.non_manifold_vertices.size());
  if (report.components > 1) return fmt::format("it has {} parts", report.components);
  return {};
}

/// Fillings on a mesh: triangles that are in place, and the hole of each.
struct Fillings {
  std::vector<Triangle> triangles;
  std::vector<int> holes;
  void remove(const std::vector<Hole>& all) {
    std::size_t kept = 0;
    for (std::size_t i = 0; i < holes.size(); ++i)
      if (all[holes[i]].refusal.empty()) triangles[kept] = triangles[i], holes[kept++] = holes[i];
    triangles.resize(kept);
    holes.resize(kept);
  }
};

TriangleMesh with_fillings(const TriangleMesh& mesh, const Fillings& fillings) {
  TriangleMesh filled = mesh;
  filled.triangles.insert(filled.triangles.end(), fillings.triangles.begin(), fillings.triangles.end());
  return filled;
}

std::vector<Hole> find_holes(const TriangleMesh& mesh, const std::vector<std::array<int, 2>>& boundary_edges) {
  std::vector<Hole> holes;
  for (std::vector<int>& loop : boundary_loops(boundary_edges)) {
    Hole hole;
    std::vector<Vec3> points;
    for (const int v : loop) {
      points.push_back(mesh.positions[v]);
      hole.centre += mesh.positions[v] / static_cast<double>(loop.size());
    }
    hole.size = bounding_box(points).diagonal();
    hole.loop = std::move(loop);
    holes.push_back(std::move(hole));
  }
  return holes;
}

Fillings triangulate_holes(const TriangleMesh& mesh, std::vector<Hole>& holes) {
  EdgeSet edges;
  const auto add_edges = [&](const Triangle& t) {
    for (int k = 0; k < 3; ++k) edges.insert({std::min(t[k], t[(k + 1) % 3]), std::max(t[k], t[(k + 1) % 3])});
  };
  for (const Triangle& t : mesh.triangles) add_edges(t);
  Fillings fillings;
  for (int h = 0; h < static_cast<int>(holes.size()); ++h) {
    Hole& hole = holes[h];
    if (static_cast<int>(hole.loop.size()) > kMostHoleEdges) {
      hole.refusal = fmt::format("has more than {} edges", kMostHoleEdges);
      continue;
    }
    const std::vector<Triangle> filling = triangulate(mesh.positions, hole.loop, edges);
    if (filling.empty()) hole.refusal = "has no triangulation that leaves the mesh a surface";
    for (const Triangle& t : filling) {
      fillings.triangles.push_back(t);
      fillings.holes.push_back(h);
      add_edges(t);
    }
  }
  return fillings;
}

/// Marks holes whose fillings intersect the mesh or each other.
void mark_intersecting(const TriangleMesh& mesh, const Fillings& fillings, std::vector<Hole>& holes) {
  const TriangleMesh filled = with_fillings(mesh, fillings);
  const int before = static_cast<int>(mesh.triangles.size());
  std::vector<int> query(fillings.triangles.size());
  std::iota(query.begin(), query.end(), before);
  for (const auto& pair : find_self_intersections(filled, build_triangle_tree(filled), query))
    for (const TriangleIndex triangle : pair)
      if (triangle >= before) holes[fillings.holes[triangle - before]].is_intersecting = true;
}

/// Refuses holes of parts that stay sheets when they are filled.
void refuse_sheets(const TriangleMesh& mesh, const Fillings& fillings, std::vector<Hole>& holes) {
  /// Of the 1.5th power of the area; a ball has 0.094, a box of 1 x 1 x 0.01 has 0.0034.
  constexpr double kLeastVolume = 0.002;
  const TriangleMesh filled = with_fillings(mesh, fillings);
  UnionFind parts = connected_vertices(filled);
  struct Extent {
    double area = 0, volume = 0;
  };
  std::map<int, Extent> extents;
  const Vec3 origin = bounding_box(mesh).centre();
  for (const Triangle& t : filled.triangles) {
    const Vec3 area = area_vector(filled, t);
    Extent& extent = extents[parts.find(t[0])];
    extent.area += area.norm();
    extent.volume += (filled.positions[t[0]] - origin).dot(area) / 3;
  }
  for (const int h : fillings.holes) {
    const Extent& extent = extents.at(parts.find(holes[h].loop[0]));
    if (std::abs(extent.volume) < kLeastVolume * extent.area * std::sqrt(extent.area))
      holes[h].refusal = "is the rim of a sheet that encloses nothing";
  }
}

}  // namespace

FillResult fill_holes(TriangleMesh& mesh) {
  FillResult result;
  result.origins = remove_useless(mesh);
  result.turned = turn_triangles(mesh);
  result.removed = remove_non_manifold_edges(mesh, result.origins);
  const double diagonal = bounding_box(mesh).diagonal();
  result.holes = find_holes(mesh, measure_manifold(mesh).boundary_edges);
  Fillings fillings = triangulate_holes(mesh, result.holes);
  refuse_sheets(mesh, fillings, result.holes);
  fillings.remove(result.holes);
  mark_intersecting(mesh, fillings, result.holes);
  mesh = with_fillings(mesh, fillings);
  result.copies = split_non_manifold_vertices(mesh);
  result.origins.resize(mesh.triangles.size(), -1);
  result.obstacle = obstacle_of(measure_manifold(mesh), result.holes, diagonal);
  return result;
}

}  // namespace skeletex
