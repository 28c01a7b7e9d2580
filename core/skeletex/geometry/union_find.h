// SPDX-License-Identifier: MIT
#pragma once
#include <algorithm>
#include <numeric>
#include <vector>

#include "skeletex/geometry/mesh.h"

namespace skeletex {

/// Disjoint sets of the numbers from 0 on. A set is known by its smallest member.
class UnionFind {
 public:
  explicit UnionFind(int count = 0) : parents_(count) { std::iota(parents_.begin(), parents_.end(), 0); }

  /// Adds a number, in a set of its own.
  /// \return it
  int add() {
    parents_.push_back(static_cast<int>(parents_.size()));
    return parents_.back();
  }
  int find(int x) {
    while (parents_[x] != x) x = parents_[x] = parents_[parents_[x]];
    return x;
  }
  void unite(int a, int b) {
    a = find(a);
    b = find(b);
    parents_[std::max(a, b)] = std::min(a, b);
  }

 private:
  std::vector<int> parents_;
};

/// The vertices of a mesh, joined by its triangles: a set is a connected part.
inline UnionFind connected_vertices(const TriangleMesh& mesh) {
  UnionFind vertices(static_cast<int>(mesh.positions.size()));
  for (const Triangle& t : mesh.triangles) vertices.unite(t[0], t[1]), vertices.unite(t[0], t[2]);
  return vertices;
}

}  // namespace skeletex
