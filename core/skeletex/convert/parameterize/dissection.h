// SPDX-License-Identifier: MIT
#pragma once
#include <vector>

#include "skeletex/convert/parameterize/chart.h"

namespace skeletex {

/// Vertices that are eliminated together: number first to first + pivots - 1 of the order.
struct Front {
  int first = 0, pivots = 0;
  std::vector<int>
      boundary;  ///< the vertices that are then joined to each other, by their numbers: all later, ascending
  std::vector<int> children;  ///< fronts whose boundaries lie in these pivots and this boundary
  int parent = -1;
  int subtree = 0;               ///< the first front of this one's subtree, which is a run of fronts
  int size = 0;                  ///< pivots of the subtree
  bool is_beside_poles = false;  ///< its pivots are the neighbours of the chart's poles
};

/// The inner vertices of a chart in an order of elimination.
struct Dissection {
  std::vector<int> order;
  std::vector<int> number;    ///< of every vertex of the chart; -1 where it is fixed
  std::vector<Front> fronts;  ///< children before parents
};

/// Nested dissection (George 1973): the vertices that separate two halves, cut across the longest extent, come after
/// both; and so on in each half. The neighbours of poles come last of all.
Dissection dissect(const Chart& chart);

}  // namespace skeletex
