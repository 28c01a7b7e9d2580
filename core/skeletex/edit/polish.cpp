// SPDX-License-Identifier: MIT
#include "skeletex/edit/polish.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <set>

#include "skeletex/analysis/deformation.h"
#include "skeletex/geometry/self_intersection.h"
#include "skeletex/geometry/union_find.h"
#include "skeletex/model/error.h"

namespace skeletex {
namespace {

constexpr int kRounds = 20;
constexpr float kStep = 0.5f;       // of the way to the neighbours' mean, at the triangles of a fold
constexpr float kRingStep = 0.25f;  // at their neighbours

/// Per vertex how far it goes in this round.
std::vector<float> steps_of_vertices(const TriangleMesh& mesh, const SurfaceEdges& edges,
                                     const std::vector<int>& folds) {
  std::vector<float> steps(mesh.positions.size(), 0.f);
  for (const int fold : folds)
    for (const TriangleIndex triangle : edges.triangles[fold])
      for (const VertexIndex vertex : mesh.triangles[triangle]) steps[vertex] = kStep;
  for (const auto& [a, b] : edges.vertices) {
    if (steps[a] == kStep && steps[b] == 0) steps[b] = kRingStep;
    if (steps[b] == kStep && steps[a] == 0) steps[a] = kRingStep;
  }
  return steps;
}

/// Sums over the edges at each vertex that moves: of weighted neighbours, and of the weights.
void smooth(const SurfaceEdges& edges, const std::vector<double>& weights, const std::vector<float>& steps,
            std::vector<Vec3>& positions) {
  std::vector<Vec3> sums(positions.size(), Vec3::Zero());
  std::vector<double> totals(positions.size(), 0);
  for (std::size_t i = 0; i < weights.size(); ++i) {
    const auto [a, b] = edges.vertices[i];
    if (steps[a] == 0 && steps[b] == 0) continue;
    sums[a] += weights[i] * positions[b];
    sums[b] += weights[i] * positions[a];
    totals[a] += weights[i];
    totals[b] += weights[i];
  }
  for (std::size_t v = 0; v < positions.size(); ++v)
    if (steps[v] > 0) positions[v] += static_cast<double>(steps[v]) * (sums[v] / totals[v] - positions[v]);
}

/// Per vertex the connected part of the moved surface that it belongs to, -1 where it has not moved.
std::vector<int> moved_parts(const SurfaceEdges& edges, const std::vector<Vec3>& posed,
                             const std::vector<Vec3>& positions) {
  const int count = static_cast<int>(posed.size());
  const auto is_moved = [&](int v) { return positions[v] != posed[v]; };
  UnionFind parts(count);
  for (const auto& [a, b] : edges.vertices)
    if (is_moved(a) && is_moved(b)) parts.unite(a, b);
  std::vector<int> part(posed.size(), -1);
  for (int v = 0; v < count; ++v)
    if (is_moved(v)) part[v] = parts.find(v);
  return part;
}

/// Per part, by its number, the pairs of triangles that intersect, do not in the bind pose, and of which one is the
/// part's.
/// \param known  the pairs of the bind pose, sorted
std::vector<int> new_intersections(const std::vector<Triangle>& triangles, const std::vector<std::array<int, 2>>& known,
                                   const std::vector<Vec3>& positions, const std::vector<int>& part) {
  std::vector<int> counts(positions.size(), 0);
  for (const auto& pair : find_self_intersections({positions, triangles})) {
    if (std::binary_search(known.begin(), known.end(), pair)) continue;
    std::set<int> parts;
    for (const TriangleIndex triangle : pair)
      for (const VertexIndex vertex : triangles[triangle])
        if (part[vertex] >= 0) parts.insert(part[vertex]);
    for (const int i : parts) ++counts[i];
  }
  return counts;
}

/// Moves parts back that have got more intersections.
void revert_intersecting(const TriangleMesh& bind, const SurfaceEdges& edges, const std::vector<Vec3>& posed,
                         std::vector<Vec3>& positions) {
  const std::vector<int> part = moved_parts(edges, posed, positions);
  const auto known = find_self_intersections(bind);
  const std::vector<int> before = new_intersections(bind.triangles, known, posed, part),
                         after = new_intersections(bind.triangles, known, positions, part);
  for (std::size_t v = 0; v < posed.size(); ++v)
    if (part[v] >= 0 && after[part[v]] > before[part[v]]) positions[v] = posed[v];
}

}  // namespace

PolishReport polish_pose(const TriangleMesh& bind, std::vector<Vec3>& positions) {
  if (positions.size() != bind.positions.size())
    throw InputError(
        fmt::format("the mesh in the pose has {} vertices, in the bind pose {}; they must be two poses of one model",
                    positions.size(), bind.positions.size()));
  const SurfaceEdges edges = surface_edges(bind);
  const double shortest = 1e-9 * bounding_box(bind).diagonal();
  std::vector<double> weights;
  for (const auto& [a, b] : edges.vertices)
    weights.push_back(1 / std::max(shortest, (bind.positions[a] - bind.positions[b]).norm()));

  const std::vector<Vec3> posed = positions;
  std::vector<Vec3> current = positions;
  std::vector<int> folds = new_folds(bind, edges, current);
  PolishReport report{.folds_before = static_cast<long>(folds.size()), .folds_after = static_cast<long>(folds.size())};
  for (int round = 1; round <= kRounds && report.folds_after > 0; ++round) {
    smooth(edges, weights, steps_of_vertices(bind, edges, folds), current);
    folds = new_folds(bind, edges, current);
    if (static_cast<long>(folds.size()) >= report.folds_after) continue;
    report.folds_after = static_cast<long>(folds.size());
    report.rounds = round;
    positions = current;
  }
  if (report.rounds > 0) {
    revert_intersecting(bind, edges, posed, positions);
    report.folds_after = static_cast<long>(new_folds(bind, edges, positions).size());
  }
  for (std::size_t v = 0; v < posed.size(); ++v) {
    const double distance = (positions[v] - posed[v]).norm();
    report.moved_vertices += distance > 0;
    report.farthest = std::max(report.farthest, distance);
  }
  return report;
}

}  // namespace skeletex
