// SPDX-License-Identifier: MIT
// Vectors between vertices of a field of three.
#ifndef SURFACE_MATH_H
#define SURFACE_MATH_H

void edge_between(__global const float* restrict points, const int count, const int from, const int to,
                  float* restrict edge) {
  edge[0] = points[to] - points[from];
  edge[1] = points[count + to] - points[count + from];
  edge[2] = points[2 * count + to] - points[2 * count + from];
}

#endif
