// SPDX-License-Identifier: MIT
// Segmentation: which bone's cell a point lies in, at every node (design section 2: the cells at a node are the
// spherical Voronoi cells of the bone directions, label = argmax of a dot product).
//
// classify_points, NDRange (points, nodes); any work-group size.
//   in  x, y, z     [points]      relative to an origin
//   in  cell_begin  [nodes + 1]   first cell of each node; a node has 1 to 250 of them
//   in  cells       [4 * cells]   direction x, y, z, offset: value = point . direction + offset
//   in  margin      [nodes]       largest rounding error of the lead of one value over another
//   out labels      [nodes][points]  cell within the node, counted from 0; 255 where the lead is not above the margin

__kernel void classify_points(__global const float* restrict x, __global const float* restrict y,
                              __global const float* restrict z, __global const int* restrict cell_begin,
                              __global const float* restrict cells, __global const float* restrict margin,
                              __global uchar* restrict labels, const int point_count, const int node_count) {
  const int p = (int)get_global_id(0);
  const int n = (int)get_global_id(1);
  if (p >= point_count || n >= node_count) return;
  const float px = x[p], py = y[p], pz = z[p];
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
