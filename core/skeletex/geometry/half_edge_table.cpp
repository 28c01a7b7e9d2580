// SPDX-License-Identifier: MIT
#include "skeletex/geometry/half_edge_table.h"

#include <numeric>

namespace skeletex {

HalfEdgeTable link_half_edges(std::span<const Triangle> triangles, int vertex_count) {
  const int count = 3 * static_cast<int>(triangles.size());
  HalfEdgeTable table;
  table.begin.assign(vertex_count + 1, 0);
  for (const Triangle& t : triangles)
    for (const int v : t) ++table.begin[v + 1];
  std::partial_sum(table.begin.begin(), table.begin.end(), table.begin.begin());
  table.outgoing.resize(count), table.targets.resize(count);
  std::vector<int> next(table.begin.begin(), table.begin.end() - 1);
  int h = 0;
  for (const Triangle& t : triangles)
    for (const int c : {0, 1, 2}) {
      const int at = next[t[c]]++;
      table.outgoing[at] = h++;
      table.targets[at] = t[(c + 1) % 3];
    }
  table.twins.assign(count, -1);
  for (int v = 0; v < vertex_count; ++v)
    for (int k = table.begin[v]; k < table.begin[v + 1]; ++k) {
      const int to = table.targets[k];
      if (to < v) continue;
      for (int back = table.begin[to]; back < table.begin[to + 1]; ++back)
        if (table.targets[back] == v) {
          table.twins[table.outgoing[k]] = table.outgoing[back];
          table.twins[table.outgoing[back]] = table.outgoing[k];
          break;
        }
    }
  return table;
}

}  // namespace skeletex
