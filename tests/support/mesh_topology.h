// SPDX-License-Identifier: MIT
#pragma once
#include <map>
#include <numeric>
#include <string>
#include <utility>
#include <vector>

#include "skeletex/geometry/mesh.h"

namespace skeletex {

/// Empty when the triangles form one closed, oriented 2-manifold of the given genus that uses every vertex; otherwise
/// the first rule that is broken. By definition, without the library: each directed edge once and its opposite once,
/// and the corners around a vertex form a single ring.
inline std::string broken_rule(const TriangleMesh& mesh, int genus) {
  const int vertices = static_cast<int>(mesh.positions.size());
  std::map<std::pair<int, int>, int> next;  // directed edge -> third vertex
  std::vector<int> corners(vertices, 0), parent(vertices), start(vertices, -1);
  std::iota(parent.begin(), parent.end(), 0);
  const auto root = [&](int v) {
    while (parent[v] != v) v = parent[v] = parent[parent[v]];
    return v;
  };
  for (const Triangle& t : mesh.triangles)
    for (int i = 0; i < 3; ++i) {
      const int a = t[i], b = t[(i + 1) % 3], c = t[(i + 2) % 3];
      if (a < 0 || a >= vertices) return "index out of range";
      if (a == b) return "a triangle holds vertex " + std::to_string(a) + " twice";
      if (!next.emplace(std::pair{a, b}, c).second)
        return "edge " + std::to_string(a) + "-" + std::to_string(b) + " is run through twice";
      ++corners[a];
      start[a] = b;
      parent[root(a)] = root(b);
    }
  for (const auto& [edge, third] : next)
    if (!next.count({edge.second, edge.first}))
      return "edge " + std::to_string(edge.first) + "-" + std::to_string(edge.second) + " is open";
  for (int v = 0; v < vertices; ++v) {
    if (corners[v] == 0) return "vertex " + std::to_string(v) + " is not used";
    int around = 0;
    for (int b = start[v]; around == 0 || b != start[v]; ++around) b = next.at({v, b});
    if (around != corners[v]) return "vertex " + std::to_string(v) + " has more than one fan";
    if (root(v) != root(0)) return "more than one component";
  }
  const long euler = vertices - static_cast<long>(next.size()) / 2 + static_cast<long>(mesh.triangles.size());
  if (euler != 2 - 2 * genus) return "Euler number " + std::to_string(euler) + " for genus " + std::to_string(genus);
  return {};
}

}  // namespace skeletex
