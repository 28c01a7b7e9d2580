// SPDX-License-Identifier: MIT
// Segmentation: which bone's cell a point lies in, at every node (design section 2: the cells at a node are the
// spherical Voronoi cells of the bone directions, label = argmax of a dot product).
//
// classify_points, NDRange (points, nodes); any work-group size.
//   in  points      [3][points]   x, y, z, relative to an origin
//   in  cell_begin  [nodes + 1]   first cell of each node; a node has 1 to 250 of them
//   in  cells       [4 * cells]   direction x, y, z, offset: value = point . direction + offset
//   in  margin      [nodes]       largest rounding error of the lead of one value over another
//   out labels      [nodes][points]  cell within the node, counted from 0; 255 where the lead is not above the margin

#include "segment_structs.h"

kernel void classify_points(const ClassifyParameters parameters, global const float* restrict points,
                            global const int* restrict cell_begin, global const float* restrict cells,
                            global const float* restrict margin, global uchar* restrict labels) {
  const int p = (int)get_global_id(0), n = (int)get_global_id(1), point_count = parameters.point_count;
  if (p >= point_count || n >= parameters.node_count) return;
  const float px = points[p], py = points[point_count + p], pz = points[2 * point_count + p];
  const int begin = cell_begin[n], end = cell_begin[n + 1];
  int best = 0;
  float first = -INFINITY, second = -INFINITY;
  for (int c = begin; c < end; ++c) {
    const float value = px * cells[4 * c] + py * cells[4 * c + 1] + pz * cells[4 * c + 2] + cells[4 * c + 3];
    const int is_larger = value > first;
    second = is_larger ? first : fmax(second, value);
    best = is_larger ? c - begin : best;
    first = is_larger ? value : first;
  }
  labels[(size_t)n * (size_t)point_count + (size_t)p] = first - second > margin[n] ? (uchar)best : (uchar)255;
}
