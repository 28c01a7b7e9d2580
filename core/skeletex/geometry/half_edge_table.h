// SPDX-License-Identifier: MIT
#pragma once
#include <span>
#include <vector>

#include "skeletex/geometry/mesh.h"

namespace skeletex {

/// Neighbourhoods of an oriented triangle list with boundary. Half-edge 3t + c runs from corner c of triangle t to
/// corner (c + 1) % 3.
struct HalfEdgeTable {
  std::vector<int> twins;  ///< per half-edge, the opposite one; -1 on a boundary
  /// Half-edges out of vertex v are outgoing[begin[v]] to outgoing[begin[v + 1] - 1], ascending; they lead to
  /// `targets`.
  std::vector<int> begin, outgoing, targets;

  static int next(int h) { return h % 3 == 2 ? h - 2 : h + 1; }
  static int previous(int h) { return h % 3 == 0 ? h + 2 : h - 1; }
  /// The next half-edge out of the same vertex, counter-clockwise seen from outside; -1 at a boundary.
  int turn_left(int h) const { return twins[previous(h)]; }
  /// The same, clockwise.
  int turn_right(int h) const { return twins[h] < 0 ? -1 : next(twins[h]); }
};

/// \pre every directed edge occurs at most once
HalfEdgeTable link_half_edges(std::span<const Triangle> triangles, int vertex_count);

}  // namespace skeletex
