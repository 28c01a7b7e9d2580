// SPDX-License-Identifier: MIT
#include "skeletex/analysis/orientation.h"

#include <algorithm>
#include <tuple>

namespace skeletex {
namespace {

struct EdgeUse {
  int smaller, larger, triangle;
  bool is_forward;
};

struct NeighbourTriangle {
  TriangleIndex triangle;
  bool is_opposed;  ///< it runs through the common edge in the same direction
};

/// Per triangle those that share an edge with it alone.
std::vector<std::vector<NeighbourTriangle>> neighbours_of(const TriangleMesh& mesh, const std::vector<bool>& is_bad) {
  std::vector<EdgeUse> uses;
  for (int t = 0; t < static_cast<int>(mesh.triangles.size()); ++t)
    for (int k = 0; k < 3 && !is_bad[t]; ++k) {
      const int a = mesh.triangles[t][k], b = mesh.triangles[t][(k + 1) % 3];
      uses.push_back({std::min(a, b), std::max(a, b), t, a < b});
    }
  std::sort(uses.begin(), uses.end(), [](const EdgeUse& a, const EdgeUse& b) {
    return std::tie(a.smaller, a.larger, a.triangle) < std::tie(b.smaller, b.larger, b.triangle);
  });
  std::vector<std::vector<NeighbourTriangle>> neighbours(mesh.triangles.size());
  for (std::size_t i = 0; i < uses.size();) {
    std::size_t j = i + 1;
    while (j < uses.size() && uses[j].smaller == uses[i].smaller && uses[j].larger == uses[i].larger) ++j;
    if (j - i == 2) {
      const bool is_opposed = uses[i].is_forward == uses[i + 1].is_forward;
      neighbours[uses[i].triangle].push_back({uses[i + 1].triangle, is_opposed});
      neighbours[uses[i + 1].triangle].push_back({uses[i].triangle, is_opposed});
    }
    i = j;
  }
  return neighbours;
}

}  // namespace

TriangleTurns triangles_to_turn(const TriangleMesh& mesh, const ManifoldReport& report) {
  TriangleTurns turns;
  turns.is_turned.assign(mesh.triangles.size(), false);
  if (report.misoriented_edges.empty()) return turns;
  std::vector<bool> is_bad(mesh.triangles.size(), false);
  for (const int t : report.degenerate_triangles) is_bad[t] = true;
  const std::vector<std::vector<NeighbourTriangle>> neighbours = neighbours_of(mesh, is_bad);
  std::vector<bool>& turn = turns.is_turned;
  std::vector<bool> is_seen = is_bad;
  for (int seed = 0; seed < static_cast<int>(mesh.triangles.size()); ++seed) {
    if (is_seen[seed]) continue;
    std::vector<int> part{seed};
    is_seen[seed] = true;
    std::size_t turned = 0;
    for (std::size_t i = 0; i < part.size(); ++i) {
      turned += turn[part[i]];
      for (const auto& [other, is_opposed] : neighbours[part[i]]) {
        const bool wanted = turn[part[i]] != is_opposed;
        if (is_seen[other]) {
          turns.is_orientable = turns.is_orientable && turn[other] == wanted;
          continue;
        }
        turn[other] = wanted;
        is_seen[other] = true;
        part.push_back(other);
      }
    }
    if (2 * turned > part.size())
      for (const int t : part) turn[t] = !turn[t];
  }
  turns.count = std::count(turn.begin(), turn.end(), true);
  return turns;
}

}  // namespace skeletex
