// SPDX-License-Identifier: MIT
#pragma once
#include <span>
#include <vector>

#include "skeletex/geometry/mesh.h"

namespace skeletex {

/// The graph of a symmetric sparse matrix whose vertices lie in space, such as those of a mesh.
struct SparseGraph {
  std::span<const Vec3> positions;
  /// Neighbours of vertex v are targets[begin[v]] to targets[begin[v + 1] - 1].
  std::span<const int> begin, targets;
  std::vector<char> is_unknown;  ///< the others are fixed
  /// Unknowns where two matrices of this graph differ. Their neighbours that are not last have the same entries in
  /// both.
  std::vector<char> is_last;

  std::span<const int> neighbours(int v) const { return targets.subspan(begin[v], begin[v + 1] - begin[v]); }
};

/// Vertices that are eliminated together: number first to first + pivots - 1 of the order.
struct Front {
  int first = 0, pivots = 0;
  /// The vertices that are then joined to each other, by their numbers: all later, ascending.
  std::vector<int> boundary;
  std::vector<int> children;  ///< fronts whose boundaries lie in these pivots and this boundary
  int parent = -1;
  int subtree = 0;       ///< the first front of this one's subtree, which is a run of fronts
  int size = 0;          ///< pivots of the subtree
  bool is_last = false;  ///< its pivots are those where two matrices differ
};

/// The unknowns of a graph in an order of elimination.
struct Dissection {
  std::vector<int> order;
  std::vector<int> number;    ///< of every vertex; -1 where it is fixed
  std::vector<Front> fronts;  ///< children before parents
};

/// Nested dissection (George 1973): the vertices that separate two halves, cut across the longest extent, come after
/// both; and so on in each half. The vertices of `is_last` come after all others.
Dissection dissect(const SparseGraph& graph);

}  // namespace skeletex
