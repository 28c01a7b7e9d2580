// SPDX-License-Identifier: MIT
// Flat triangles over points on a surface lie on its inner side where it is convex. So points move by -1/16 of their
// second differences in both lattice directions, along the lattice's normal. Planes of points; numbers of a point and
// of its neighbours. (By value: through pointers PoCL's compiler no longer sees that the loops around it may become
// vector instructions.)
#include "planes.h"

__attribute__((always_inline)) Point prefilter_point(Planes points, int own, int left, int right, int below,
                                                     int above) {
  global const float *x = points.x, *y = points.y, *z = points.z;
  const float ux = x[above] - x[below], uy = y[above] - y[below], uz = z[above] - z[below];
  const float vx = x[right] - x[left], vy = y[right] - y[left], vz = z[right] - z[left];
  const float nx = vy * uz - vz * uy, ny = vz * ux - vx * uz, nz = vx * uy - vy * ux;
  const float length2 = nx * nx + ny * ny + nz * nz;
  const float dx = (x[above] - x[own]) + (x[below] - x[own]) + (x[right] - x[own]) + (x[left] - x[own]);
  const float dy = (y[above] - y[own]) + (y[below] - y[own]) + (y[right] - y[own]) + (y[left] - y[own]);
  const float dz = (z[above] - z[own]) + (z[below] - z[own]) + (z[right] - z[own]) + (z[left] - z[own]);
  const float move = length2 > 0.0f ? -0.0625f * (dx * nx + dy * ny + dz * nz) / length2 : 0.0f;
  const Point p = {x[own] + move * nx, y[own] + move * ny, z[own] + move * nz};
  return p;
}
