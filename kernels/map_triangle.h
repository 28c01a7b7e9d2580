// SPDX-License-Identifier: MIT
// Triangles of maps, for the kernels that read surfaces. Map coordinates are pairs of floats (high + low): differences
// of near values keep their relative precision, however small the triangle. A triangle's corner 2 is its pole where it
// has one; corner 0 is the base of all differences.
#ifndef MAP_TRIANGLE_H
#define MAP_TRIANGLE_H

#include "planes.h"
#include "texel_structs.h"

// The maps of all VSM patches. Vertices are relative to the model's origin; row_high, row_low: u of the rows of all
// patches.
typedef struct Maps {
  int triangle_count;
  global const int *corners, *turns, *across, *poles, *patches;
  global const float *u_high, *u_low, *v_high, *v_low, *row_high, *row_low;
  Planes vertices;
} Maps;

// in   triangles: see MAP_CORNERS; values: planes u_high, u_low, v_high, v_low, x, y, z, then row_high, row_low
__attribute__((always_inline)) Maps maps_of(MapSizes sizes, global const int* triangles, global const float* values) {
  const int count = sizes.triangle_count, vertices = sizes.vertex_count;
  Maps maps;
  maps.triangle_count = count;
  maps.corners = triangles + MAP_CORNERS * count, maps.turns = triangles + MAP_TURNS * count;
  maps.across = triangles + MAP_ACROSS * count;
  maps.poles = triangles + MAP_POLES * count, maps.patches = triangles + MAP_PATCHES * count;
  maps.u_high = values, maps.u_low = values + vertices;
  maps.v_high = values + 2 * vertices, maps.v_low = values + 3 * vertices;
  maps.vertices = planes_of(values + 4 * vertices, vertices);
  maps.row_high = values + 7 * vertices, maps.row_low = maps.row_high + sizes.row_count;
  return maps;
}

typedef struct MapTriangle {
  float du1, dv1, du2, dv2;  // corners 1 and 2 from corner 0
  float u_base_high, u_base_low, v_base_high, v_base_low;
  int pole;  // 0, -1: head's, +1: tail's at corner 2 (then du2 reaches the pole's row and dv2 is unused)
} MapTriangle;

__attribute__((always_inline)) MapTriangle load_triangle(Maps maps, int t) {
  global const int *corners = maps.corners, *turns = maps.turns;
  global const float *u_high = maps.u_high, *u_low = maps.u_low, *v_high = maps.v_high, *v_low = maps.v_low;
  const int count = maps.triangle_count, a = corners[t], b = corners[count + t], c = corners[2 * count + t];
  MapTriangle m;
  m.u_base_high = u_high[a];
  m.u_base_low = u_low[a];
  m.v_base_high = v_high[a] + (float)turns[t];
  // The turn is exact; what its addition rounds off goes to the low part.
  m.v_base_low = v_low[a] + (v_high[a] - (m.v_base_high - (float)turns[t]));
  m.du1 = (u_high[b] - u_high[a]) + (u_low[b] - u_low[a]);
  m.du2 = (u_high[c] - u_high[a]) + (u_low[c] - u_low[a]);
  m.dv1 = ((v_high[b] - v_high[a]) + (float)(turns[count + t] - turns[t])) + (v_low[b] - v_low[a]);
  m.dv2 = ((v_high[c] - v_high[a]) + (float)(turns[2 * count + t] - turns[t])) + (v_low[c] - v_low[a]);
  m.pole = maps.poles[t];
  return m;
}

// v of a column from the triangle's base.
__attribute__((always_inline)) float column_offset(MapTriangle m, int column, int width) {
  const float high = (float)column / (float)width;
  const float low = fma(-high, (float)width, (float)column) / (float)width;
  return (high - m.v_base_high) + (low - m.v_base_low);
}

// u from the triangle's base of a reading position: a row of the table, and the share of the way to the next one.
__attribute__((always_inline)) float row_offset(MapTriangle m, Maps maps, int row, float share) {
  global const float *row_high = maps.row_high, *row_low = maps.row_low;
  const int next = share < 0.0f ? row - 1 : share > 0.0f ? row + 1 : row;
  const float span = (row_high[next] - row_high[row]) + (row_low[next] - row_low[row]);
  return ((row_high[row] - m.u_base_high) + (row_low[row] - m.u_base_low)) + fabs(share) * span;
}

// The same of an inner row: where texels of one row look together, nothing of it is gathered.
__attribute__((always_inline)) float inner_row_offset(MapTriangle m, Maps maps, int row, float share) {
  global const float *row_high = maps.row_high, *row_low = maps.row_low;
  const float before = (row_high[row - 1] - row_high[row]) + (row_low[row - 1] - row_low[row]);
  const float after = (row_high[row + 1] - row_high[row]) + (row_low[row + 1] - row_low[row]);
  return ((row_high[row] - m.u_base_high) + (row_low[row] - m.u_base_low)) +
         fabs(share) * (share < 0.0f ? before : after);
}

// Weights of corners 1 and 2. (By value: see prefilter.h.)
typedef struct CornerWeights {
  float w1, w2;
} CornerWeights;

// Where a map's triangle without a pole has a point at (u, v), both from the triangle's base. Weights are negative, or
// their sum is above 1, outside the triangle.
__attribute__((always_inline)) CornerWeights plain_weights_at(MapTriangle m, float u, float v) {
  // Scaled by the extents, so that products of tiny differences stay in range.
  const float scale_u = 1.0f / fmax(fmax(fabs(m.du1), fabs(m.du2)), 1e-30f),
              scale_v = 1.0f / fmax(fmax(fabs(m.dv1), fabs(m.dv2)), 1e-30f);
  const float a1 = m.du1 * scale_u, b1 = m.dv1 * scale_v, a2 = m.du2 * scale_u, b2 = m.dv2 * scale_v;
  const float pu = u * scale_u, pv = v * scale_v;
  const float determinant = a1 * b2 - a2 * b1;
  const float inverse = determinant == 0.0f ? 0.0f : 1.0f / determinant;
  const CornerWeights w = {(pu * b2 - a2 * pv) * inverse, (a1 * pv - pu * b1) * inverse};
  return w;
}

// The same of any. Without branches: loops around it become vector instructions.
__attribute__((always_inline)) CornerWeights weights_at(MapTriangle m, float u, float v) {
  const CornerWeights plain = plain_weights_at(m, u, v);
  // The trapezoid between the edge 0-1 and the pole's row.
  const float lambda = m.dv1 == 0.0f ? 0.0f : v / m.dv1;
  const float edge = lambda * m.du1;
  const float rest = m.du2 - edge;
  const float tau = rest == 0.0f ? 1.0f : (u - edge) / rest;
  const int is_plain = m.pole == 0;
  const CornerWeights w = {is_plain ? plain.w1 : (1.0f - tau) * lambda, is_plain ? plain.w2 : tau};
  return w;
}

// v from the triangle's base of a reading position, at the turn that lies nearest to the triangle's middle.
__attribute__((always_inline)) float turned_offset(MapTriangle m, int column, float share, int width) {
  const float middle = m.pole == 0 ? (m.dv1 + m.dv2) / 3.0f : 0.5f * m.dv1;
  const float beside = share / (float)width, offset = column_offset(m, column, width) + beside;
  // Rounded to the nearest: rint() would not become one instruction.
  const int lift = (int)(((middle - offset) + 12582912.0f) - 12582912.0f);
  return lift == 0 ? offset : column_offset(m, column + lift * width, width) + beside;
}

#endif
