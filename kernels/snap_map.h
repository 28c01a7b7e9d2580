// SPDX-License-Identifier: MIT
// The map around a texel while texels snap, whose rows then have their even columns first, see snap.cl.
#include "extremes.h"
#include "skeletex_structs.h"

#define MARGIN 0.6f  // cells that the rows next to a seam or pole keep from it

// The place of a column in its row by colour.
int by_colour(int column, int width) { return (column >> 1) + ((column & 1) ? (width + 1) >> 1 : 0); }

// A texel among its row's by colour; columns one beyond either end wrap round.
int coloured_at(global const PatchRecord* restrict p, int texture_width, int column, int row) {
  const int wrapped = column < 0 ? column + p->width : column < p->width ? column : column - p->width;
  return (p->y + row) * texture_width + p->x + by_colour(wrapped, p->width);
}

// A texel and its eight neighbours.
typedef struct Neighbours {
  int own, left, right;  // those below and above them are a line of the texture away
} Neighbours;

Neighbours neighbours_of(global const PatchRecord* restrict p, int texture_width, int column, int row) {
  const Neighbours n = {coloured_at(p, texture_width, column, row), coloured_at(p, texture_width, column - 1, row),
                        coloured_at(p, texture_width, column + 1, row)};
  return n;
}

// The three corners of the quad (0, 0), a, b, c, counter-clockwise, whose cross product depends on (0, 0).
__attribute__((always_inline)) float least_cross(float ax, float ay, float bx, float by, float cx, float cy) {
  const float own = ax * cy - ay * cx, at_a = (ax - bx) * ay - (ay - by) * ax, at_c = cx * (cy - by) - cy * (cx - bx);
  return lesser(own, lesser(at_a, at_c));
}

// The smallest cross product at the corners of the four quads around a texel that depend on its offset, if that were
// (dx, dy); at most 0 when it would come too near to a seam, whose own samples are not at the columns.
__attribute__((always_inline)) float cross_around(Neighbours n, int height, int texture_width, int row, float dx,
                                                  float dy, global const float* offset_x,
                                                  global const float* offset_y) {
  const float rx = 1.0f + offset_x[n.right] - dx, ry = offset_y[n.right] - dy, lx = -1.0f + offset_x[n.left] - dx,
              ly = offset_y[n.left] - dy;
  const int above = texture_width, below = -texture_width;
  const float ax = offset_x[n.own + above] - dx, ay = 1.0f + offset_y[n.own + above] - dy;
  const float bx = offset_x[n.own + below] - dx, by = -1.0f + offset_y[n.own + below] - dy;
  const float right_above =
      least_cross(rx, ry, 1.0f + offset_x[n.right + above] - dx, 1.0f + offset_y[n.right + above] - dy, ax, ay);
  const float left_above =
      least_cross(ax, ay, -1.0f + offset_x[n.left + above] - dx, 1.0f + offset_y[n.left + above] - dy, lx, ly);
  const float left_below =
      least_cross(lx, ly, -1.0f + offset_x[n.left + below] - dx, -1.0f + offset_y[n.left + below] - dy, bx, by);
  const float right_below =
      least_cross(bx, by, 1.0f + offset_x[n.right + below] - dx, -1.0f + offset_y[n.right + below] - dy, rx, ry);
  const int is_near_end = ((float)row + dy < MARGIN) | ((float)row + dy > (float)(height - 1) - MARGIN);
  // No choice between the two: the compiler would put loads of neighbours behind it, each a gather under a mask.
  return lesser(is_near_end ? 0.0f : INFINITY,
                lesser(lesser(right_above, left_above), lesser(left_below, right_below)));
}

// The same, compiled once.
__attribute__((noinline)) float cross_around_one(Neighbours n, int height, int texture_width, int row, float dx,
                                                 float dy, global const float* offset_x, global const float* offset_y) {
  return cross_around(n, height, texture_width, row, dx, dy, offset_x, offset_y);
}
