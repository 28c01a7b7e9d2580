// SPDX-License-Identifier: MIT
#include "skeletex/parameterize/half_edge_table.h"

namespace skeletex {

HalfEdgeTable link_half_edges(std::span<const Triangle> triangles, int vertex_count) {
  const int count = 3 * static_cast<int>(triangles.size());
  const auto from = [&](int h) { return triangles[h / 3][h % 3]; };
  const auto to = [&](int h) { return triangles[h / 3][(h + 1) % 3]; };
  std::vector<int> begin(vertex_count + 1, 0), outgoing(count);
  for (int h = 0; h < count; ++h) ++begin[from(h) + 1];
  for (int v = 0; v < vertex_count; ++v) begin[v + 1] += begin[v];
  std::vector<int> fill(begin.begin(), begin.end() - 1);
  for (int h = 0; h < count; ++h) outgoing[fill[from(h)]++] = h;

  HalfEdgeTable table;
  table.twins.assign(count, -1);
  for (int h = 0; h < count; ++h) {
    if (table.twins[h] >= 0) continue;
    for (int k = begin[to(h)]; k < begin[to(h) + 1]; ++k)
      if (to(outgoing[k]) == from(h)) {
        table.twins[h] = outgoing[k];
        table.twins[outgoing[k]] = h;
        break;
      }
  }
  return table;
}

}  // namespace skeletex
