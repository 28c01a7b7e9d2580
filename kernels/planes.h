// SPDX-License-Identifier: MIT
// Points in a buffer: all x, then all y, then all z. Likewise texels: along, around, out.
#ifndef PLANES_H
#define PLANES_H

typedef struct Point {
  float x, y, z;
} Point;

typedef struct Planes {
  global const float *x, *y, *z;
} Planes;

typedef struct MutablePlanes {
  global float *x, *y, *z;
} MutablePlanes;

// Declares pointers to the three planes, by their own names, for loops over columns.
#define PLANES(type, x, y, z, values, count) type *x = values, *y = x + (count), *z = y + (count)

__attribute__((always_inline)) Planes planes_of(global const float* values, int count) {
  const Planes planes = {values, values + count, values + 2 * count};
  return planes;
}

__attribute__((always_inline)) MutablePlanes mutable_planes_of(global float* values, int count) {
  const MutablePlanes planes = {values, values + count, values + 2 * count};
  return planes;
}

__attribute__((always_inline)) Point point_at(Planes planes, int i) {
  const Point p = {planes.x[i], planes.y[i], planes.z[i]};
  return p;
}

__attribute__((always_inline)) void set_point(MutablePlanes planes, int i, Point p) {
  planes.x[i] = p.x, planes.y[i] = p.y, planes.z[i] = p.z;
}

#endif
