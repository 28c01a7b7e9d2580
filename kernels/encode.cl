// SPDX-License-Identifier: MIT
// From maps to texels. Positions are planes x, y, z over the whole texture, relative to the model's origin.
//   cover_texels        triangles of all charts   -> per texel the triangle that covers it (lowest index wins)
//   read_surface        that triangle             -> position, and a mark on every triangle that is read
//   read_listed         the same for a list of texels that read beside their place in the lattice
//   read_snapped        the same for all texels, which may be on vertices and edges of the mesh
//   place_spd_points    distances along SPD rays  -> position
//   place_points        a list of texels          -> position (end rows: seams and poles)
//   prefilter_positions positions                 -> positions moved against their second differences
//   encode_texels       positions                 -> texels in bone tangent space (along, around, out)
#include "bone_frame.h"
#include "map_triangle.h"
#include "prefilter.h"
#include "rounding.h"
#include "row_group.h"
#include "skeletex_structs.h"

// A number that no other work-item of the group gets.
#if ROW_ITEMS > 1
#define NEXT_OF(counter) atomic_inc(&counter)
#else
#define NEXT_OF(counter) counter++
#endif

// v at which the edge from (ua, va) to (ub, vb) crosses u; the caller has checked that it does.
float crossing(float ua, float va, float ub, float vb, float u) {
  const float span = ub - ua;
  return span == 0.0f ? va : va + (vb - va) * clamp((u - ua) / span, 0.0f, 1.0f);
}

// NDRange (triangles, any): the second dimension strides over a triangle's rows.
kernel void cover_texels(const int triangle_count, global const int* restrict corners, global const int* restrict turns,
                         global const int* restrict poles, global const int* restrict triangle_patches,
                         global const float* restrict u_high, global const float* restrict u_low,
                         global const float* restrict v_high, global const float* restrict v_low,
                         global const PatchRecord* restrict patches, global const float* restrict row_high,
                         global const float* restrict row_low, const int texture_width,
                         global int* restrict texel_triangles) {
  const int t = (int)get_global_id(0);
  if (t >= triangle_count) return;
  const MapTriangle m = load_triangle(t, triangle_count, corners, turns, poles, u_high, u_low, v_high, v_low);
  const int patch = triangle_patches[t];
  const int width = patches[patch].width, height = patches[patch].height;
  const int row_begin = patches[patch].row_begin;
  const int origin = patches[patch].y * texture_width + patches[patch].x;

  const float lowest = fmin(0.0f, fmin(m.du1, m.du2)), highest = fmax(0.0f, fmax(m.du1, m.du2));
  // First row not below the triangle, by bisection, with a row of slack for rounding.
  int first = 0, last = height;
  while (first < last) {
    const int middle = (first + last) / 2;
    const float u = (row_high[row_begin + middle] - m.u_base_high) + (row_low[row_begin + middle] - m.u_base_low);
    if (u < lowest)
      first = middle + 1;
    else
      last = middle;
  }
  const float tolerance_u = 4e-7f * (highest - lowest);
  for (int row = max(1, first - 1) + (int)get_global_id(1); row < height - 1; row += (int)get_global_size(1)) {
    const float u = (row_high[row_begin + row] - m.u_base_high) + (row_low[row_begin + row] - m.u_base_low);
    if (u > highest + tolerance_u) break;
    if (u < lowest - tolerance_u) continue;
    float left = INFINITY, right = -INFINITY;
    if (m.pole == 0) {
      const float uc = clamp(u, lowest, highest);
      if ((uc - 0.0f) * (uc - m.du1) <= 0.0f) {
        const float v = crossing(0.0f, 0.0f, m.du1, m.dv1, uc);
        left = fmin(left, v), right = fmax(right, v);
        if (m.du1 == 0.0f) left = fmin(left, m.dv1), right = fmax(right, m.dv1);
      }
      if ((uc - m.du1) * (uc - m.du2) <= 0.0f) {
        const float v = crossing(m.du1, m.dv1, m.du2, m.dv2, uc);
        left = fmin(left, v), right = fmax(right, v);
        if (m.du1 == m.du2) left = fmin(left, m.dv2), right = fmax(right, m.dv2);
      }
      if ((uc - m.du2) * (uc - 0.0f) <= 0.0f) {
        const float v = crossing(m.du2, m.dv2, 0.0f, 0.0f, uc);
        left = fmin(left, v), right = fmax(right, v);
        if (m.du2 == 0.0f) left = fmin(left, m.dv2), right = fmax(right, m.dv2);
      }
    } else {
      // The trapezoid between the edge 0-1 and the pole's row: all of the edge's v, or the part of it that u has
      // passed.
      const float side = (float)m.pole;
      const bool past0 = side * u >= 0.0f, past1 = side * (u - m.du1) >= 0.0f;
      if (!past0 && !past1) continue;
      const float cut = crossing(0.0f, 0.0f, m.du1, m.dv1, u);
      const float v0 = past0 ? 0.0f : cut, v1 = past1 ? m.dv1 : cut;
      left = fmin(v0, v1), right = fmax(v0, v1);
    }
    if (!(left <= right)) continue;
    const float extent = fmax(fabs(m.dv1), m.pole == 0 ? fabs(m.dv2) : 0.0f);
    const float tolerance = 4e-7f * extent + 1e-12f;
    const float base = m.v_base_high + m.v_base_low;
    const int begin = floor_of((base + left) * (float)width) - 1;
    const int end = ceil_of((base + right) * (float)width) + 1;
    const int line = origin + row * texture_width;
    // Wrapped once: a remainder takes longer than all else in this loop.
    int wrapped = (begin % width + width) % width;
    for (int column = begin; column <= end; ++column) {
      const int texel = line + wrapped;
      wrapped = wrapped + 1 < width ? wrapped + 1 : 0;
      const float v = column_offset(m, column, width);
      if (v < left - tolerance || v > right + tolerance) continue;
      atomic_min(&texel_triangles[texel], t);
    }
  }
}

// A triangle of the map, and the weights there of its corners 1 and 2.
typedef struct MapPlace {
  int t;
  CornerWeights w;
} MapPlace;

// With a margin for rounding.
__attribute__((always_inline)) int is_outside(CornerWeights w) {
  return fmin(1.0f - w.w1 - w.w2, fmin(w.w1, w.w2)) < -1e-6f;
}

// The place in the map of a reading position, column + beside and row + above in cells, from the triangle that covers
// the texel's own place: always across the edge that the point is furthest behind. A walk that does not arrive stays at
// its last triangle, and point_of at its border. across: per triangle the ones behind the edges opposite to its
// corners, three planes; -1 at the map's border
MapPlace walk_to(const int covering, const int column, const float beside, const int width, const int row,
                 const float above, const int triangle_count, global const int* restrict corners,
                 global const int* restrict turns, global const int* restrict poles, global const int* restrict across,
                 global const float* restrict u_high, global const float* restrict u_low,
                 global const float* restrict v_high, global const float* restrict v_low,
                 global const float* restrict row_high, global const float* restrict row_low) {
  const int most_steps = beside != 0.0f || above != 0.0f ? 1000 : 0;
  MapPlace place;
  place.t = covering;
  for (int steps = 0;; ++steps) {
    const MapTriangle m = load_triangle(place.t, triangle_count, corners, turns, poles, u_high, u_low, v_high, v_low);
    const float u = row_offset(m, row_high, row_low, row, above), v = turned_offset(m, column, beside, width);
    if (m.pole == 0)
      place.w = plain_weights_at(m, u, v);  // most are
    else
      place.w = weights_at(m, u, v);
    if (!is_outside(place.w) || steps == most_steps) break;
    const float w0 = 1.0f - place.w.w1 - place.w.w2, least = fmin(w0, fmin(place.w.w1, place.w.w2));
    const int corner = least == w0 ? 0 : least == place.w.w1 ? 1 : 2;
    const int next = across[corner * triangle_count + place.t];
    if (next < 0) break;
    place.t = next;
  }
  return place;
}

typedef struct SurfacePoint {
  float x, y, z;
} SurfacePoint;

__attribute__((always_inline)) SurfacePoint point_of(const MapPlace place, const int triangle_count,
                                                     global const int* corners, global const float* vertex_x,
                                                     global const float* vertex_y, global const float* vertex_z) {
  // Rounding may have put it a little outside.
  const float inner1 = fmax(0.0f, place.w.w1), inner2 = fmax(0.0f, place.w.w2),
              scale = 1.0f / fmax(1.0f, inner1 + inner2);
  const float w1 = inner1 * scale, w2 = inner2 * scale;
  const int a = corners[place.t], b = corners[triangle_count + place.t], c = corners[2 * triangle_count + place.t];
  const SurfacePoint point = {vertex_x[a] + w1 * (vertex_x[b] - vertex_x[a]) + w2 * (vertex_x[c] - vertex_x[a]),
                              vertex_y[a] + w1 * (vertex_y[b] - vertex_y[a]) + w2 * (vertex_y[c] - vertex_y[a]),
                              vertex_z[a] + w1 * (vertex_z[b] - vertex_z[a]) + w2 * (vertex_z[c] - vertex_z[a])};
  return point;
}

// NDRange: one work-group of ROW_ITEMS per row, as in reconstruct.cl. Every texel of the rows (lattice_rows) reads at
// its place in the lattice plus its offset, in cells; those that no triangle covers keep their points.
kernel void read_surface(const int row_count, const int texture_width, const int triangle_count,
                         global const int* restrict lattice_rows, global const int* restrict texel_triangles,
                         global const int* restrict corners, global const int* restrict turns,
                         global const int* restrict poles, global const float* restrict u_high,
                         global const float* restrict u_low, global const float* restrict v_high,
                         global const float* restrict v_low, global const float* restrict vertex_x,
                         global const float* restrict vertex_y, global const float* restrict vertex_z,
                         global const PatchRecord* restrict patches, global const float* restrict row_high,
                         global const float* restrict row_low, global const float* restrict offset_x,
                         global const float* restrict offset_y, global float* restrict x, global float* restrict y,
                         global float* restrict z, global int* restrict is_triangle_read) {
  const int k = get_group_id(0);
  if (k >= row_count) return;
  global const PatchRecord* restrict p = patches + lattice_rows[4 * k];
  const int width = p->width, row = p->row_begin + lattice_rows[4 * k + 1];
  const int first = (p->y + lattice_rows[4 * k + 1]) * texture_width + p->x;
  for (int j = get_local_id(0); j < width; j += ROW_ITEMS) {
    const int texel = first + j, is_covered = texel_triangles[texel] != NO_TRIANGLE,
              t = min(texel_triangles[texel], triangle_count - 1);
    const MapTriangle m = load_triangle(t, triangle_count, corners, turns, poles, u_high, u_low, v_high, v_low);
    const MapPlace place = {t, weights_at(m, inner_row_offset(m, row_high, row_low, row, offset_y[texel]),
                                          turned_offset(m, j, offset_x[texel], width))};
    const SurfacePoint point = point_of(place, triangle_count, corners, vertex_x, vertex_y, vertex_z);
    const float px = is_covered ? point.x : x[texel], py = is_covered ? point.y : y[texel],
                pz = is_covered ? point.z : z[texel];
    x[texel] = px, y[texel] = py, z[texel] = pz;
  }
  // Apart, as it writes to chance places.
  for (int j = get_local_id(0); j < width; j += ROW_ITEMS)
    if (texel_triangles[first + j] != NO_TRIANGLE) is_triangle_read[texel_triangles[first + j]] = 1;
}

// NDRange: count. Both for a list of texels that nothing holds; what covers their places stays.
kernel void read_listed(const int count, const int texture_width, const int triangle_count,
                        global const int* restrict texels, global const int* restrict texel_patches,
                        global const int* restrict texel_triangles, global const int* restrict corners,
                        global const int* restrict turns, global const int* restrict poles,
                        global const int* restrict across, global const float* restrict u_high,
                        global const float* restrict u_low, global const float* restrict v_high,
                        global const float* restrict v_low, global const float* restrict vertex_x,
                        global const float* restrict vertex_y, global const float* restrict vertex_z,
                        global const PatchRecord* restrict patches, global const float* restrict row_high,
                        global const float* restrict row_low, global const float* restrict offset_x,
                        global const float* restrict offset_y, global float* restrict x, global float* restrict y,
                        global float* restrict z, global int* restrict is_triangle_read) {
  const int i = (int)get_global_id(0);
  if (i >= count) return;
  const int texel = texels[i];
  if (texel_triangles[texel] == NO_TRIANGLE) return;
  global const PatchRecord* p = patches + texel_patches[texel];
  const MapPlace place = walk_to(texel_triangles[texel], texel % texture_width - p->x, offset_x[texel], p->width,
                                 p->row_begin + texel / texture_width - p->y, offset_y[texel], triangle_count, corners,
                                 turns, poles, across, u_high, u_low, v_high, v_low, row_high, row_low);
  const SurfacePoint point = point_of(place, triangle_count, corners, vertex_x, vertex_y, vertex_z);
  x[texel] = point.x, y[texel] = point.y, z[texel] = point.z;
  is_triangle_read[place.t] = 1;
}

#define SNAPPED_COLUMNS 256  // of a row that a group looks at together

// NDRange: one work-group of ROW_ITEMS per row, as in reconstruct.cl. What snapping has made of the regular grid:
// texels on vertices and edges of the mesh take those points, others that have moved read where they are now, the rest
// stays. in   lattice_rows: all; home_x, home_y: the regular grid's offsets; snapped_x, snapped_y, snapped_anchors,
// parameters: by colour, as snap.cl leaves them;
//      vertex_points: number of a vertex' point in the planes; edge_points: two per edge
// out  offset_x, offset_y, anchors: the same, columns one after the other; texel_triangles: of texels on vertices and
// edges as they were
kernel void read_snapped(
    const int row_count, const int texture_width, const int triangle_count, global const int* restrict lattice_rows,
    global const int* restrict even_triangles, global const int* restrict corners, global const int* restrict turns,
    global const int* restrict poles, global const int* restrict across, global const float* restrict u_high,
    global const float* restrict u_low, global const float* restrict v_high, global const float* restrict v_low,
    global const float* restrict vertex_x, global const float* restrict vertex_y, global const float* restrict vertex_z,
    global const PatchRecord* restrict patches, global const float* restrict row_high,
    global const float* restrict row_low, global const float* restrict home_x, global const float* restrict home_y,
    global const float* restrict snapped_x, global const float* restrict snapped_y,
    global const int* restrict snapped_anchors, global const float* restrict parameters,
    global const int* restrict vertex_points, global const int* restrict edge_points,
    global const float* restrict even_x, global const float* restrict even_y, global const float* restrict even_z,
    global float* restrict offset_x, global float* restrict offset_y, global int* restrict anchors,
    global int* restrict texel_triangles, global float* restrict x, global float* restrict y, global float* restrict z,
    global int* restrict is_triangle_read) {
  local int listed[SNAPPED_COLUMNS], is_beyond[SNAPPED_COLUMNS], listed_count;
  local float point_x[SNAPPED_COLUMNS], point_y[SNAPPED_COLUMNS], point_z[SNAPPED_COLUMNS];
  const int k = get_group_id(0);
  if (k >= row_count) return;
  global const PatchRecord* restrict p = patches + lattice_rows[4 * k];
  const int width = p->width, row = p->row_begin + lattice_rows[4 * k + 1],
            first = (p->y + lattice_rows[4 * k + 1]) * texture_width + p->x;
  for (int begin = 0; begin < width; begin += SNAPPED_COLUMNS) {
    if (get_local_id(0) == 0) listed_count = 0;
    WAIT_FOR_GROUP(CLK_LOCAL_MEM_FENCE);
    for (int j = begin + get_local_id(0); j < min(begin + SNAPPED_COLUMNS, width); j += ROW_ITEMS) {
      const int texel = first + j, by_colour = first + (j >> 1) + ((j & 1) ? (width + 1) >> 1 : 0);
      const int anchor = snapped_anchors[by_colour], t = even_triangles[texel];
      const float dx = snapped_x[by_colour], dy = snapped_y[by_colour];
      SurfacePoint point = {even_x[texel], even_y[texel], even_z[texel]};
      if (anchor != 0) {
        const int a = anchor > 0 ? vertex_points[anchor - 1] : edge_points[2 * (-1 - anchor)];
        const int b = anchor > 0 ? a : edge_points[2 * (-1 - anchor) + 1];
        const float s = anchor > 0 ? 0.0f : parameters[by_colour];
        point.x = vertex_x[a] + s * (vertex_x[b] - vertex_x[a]);
        point.y = vertex_y[a] + s * (vertex_y[b] - vertex_y[a]);
        point.z = vertex_z[a] + s * (vertex_z[b] - vertex_z[a]);
      } else if (t != NO_TRIANGLE && (dx != 0.0f || dy != 0.0f || home_x[texel] != 0.0f || home_y[texel] != 0.0f)) {
        listed[NEXT_OF(listed_count)] = j;
      }
      texel_triangles[texel] = t, anchors[texel] = anchor;
      offset_x[texel] = dx, offset_y[texel] = dy;
      x[texel] = point.x, y[texel] = point.y, z[texel] = point.z;
    }
    WAIT_FOR_GROUP(CLK_LOCAL_MEM_FENCE | CLK_GLOBAL_MEM_FENCE);
    // Most are still in the triangle that covers their place: all look there first, as vector instructions.
    const int count = listed_count;
    for (int i = get_local_id(0); i < count; i += ROW_ITEMS) {
      const int j = listed[i], texel = first + j, t = even_triangles[texel];
      const MapTriangle m = load_triangle(t, triangle_count, corners, turns, poles, u_high, u_low, v_high, v_low);
      const MapPlace place = {t, weights_at(m, inner_row_offset(m, row_high, row_low, row, offset_y[texel]),
                                            turned_offset(m, j, offset_x[texel], width))};
      const SurfacePoint point = point_of(place, triangle_count, corners, vertex_x, vertex_y, vertex_z);
      is_beyond[i] = is_outside(place.w);
      point_x[i] = point.x, point_y[i] = point.y, point_z[i] = point.z;
    }
    WAIT_FOR_GROUP(CLK_LOCAL_MEM_FENCE);
    for (int i = get_local_id(0); i < count; i += ROW_ITEMS) {
      const int j = listed[i], texel = first + j;
      SurfacePoint point = {point_x[i], point_y[i], point_z[i]};
      int t = even_triangles[texel];
      if (is_beyond[i]) {
        const MapPlace place = walk_to(t, j, offset_x[texel], width, row, offset_y[texel], triangle_count, corners,
                                       turns, poles, across, u_high, u_low, v_high, v_low, row_high, row_low);
        t = place.t;
        point = point_of(place, triangle_count, corners, vertex_x, vertex_y, vertex_z);
        texel_triangles[texel] = t;
      }
      x[texel] = point.x, y[texel] = point.y, z[texel] = point.z;
      is_triangle_read[t] = 1;
    }
    WAIT_FOR_GROUP(CLK_LOCAL_MEM_FENCE);
  }
}

// NDRange (texture width, texture height). Texels with a negative distance are left as they are.
kernel void place_spd_points(const int texture_width, const int texture_height,
                             global const int* restrict texel_patches, global const float* restrict distances,
                             global const PatchRecord* restrict patches, global const RowRecord* restrict rows,
                             global const ColumnRecord* restrict columns, global float* restrict x,
                             global float* restrict y, global float* restrict z) {
  const int column = (int)get_global_id(0), line = (int)get_global_id(1);
  if (column >= texture_width || line >= texture_height) return;
  const int texel = line * texture_width + column;
  const int patch = texel_patches[texel];
  const float distance = distances[texel];
  if (patch < 0 || distance < 0.0f) return;
  global const PatchRecord* p = patches + patch;
  float foot[3], out[3];
  frame_of(p, rows[p->row_begin + line - p->y], columns[p->column_begin + column - p->x], foot, out);
  x[texel] = foot[0] + distance * out[0];
  y[texel] = foot[1] + distance * out[1];
  z[texel] = foot[2] + distance * out[2];
}

// NDRange (count).
kernel void place_points(const int count, global const int* restrict texels, global const float* restrict from_x,
                         global const float* restrict from_y, global const float* restrict from_z,
                         global float* restrict x, global float* restrict y, global float* restrict z) {
  const int i = (int)get_global_id(0);
  if (i >= count) return;
  const int texel = texels[i];
  x[texel] = from_x[i];
  y[texel] = from_y[i];
  z[texel] = from_z[i];
}

// NDRange: one work-group of ROW_ITEMS per row, as in reconstruct.cl. The prefilter, of inner rows; the others, and
// texels with one of the bits `kept`, stay as they are. in   lattice_rows: all
kernel void prefilter_positions(const int row_count, const int texture_width, const int kept,
                                global const int* restrict lattice_rows, global const PatchRecord* restrict patches,
                                global const int* restrict are_kept, global const float* restrict x,
                                global const float* restrict y, global const float* restrict z,
                                global float* restrict out_x, global float* restrict out_y,
                                global float* restrict out_z) {
  const int k = get_group_id(0);
  if (k >= row_count) return;
  global const PatchRecord* restrict p = patches + lattice_rows[4 * k];
  const int row = lattice_rows[4 * k + 1], width = p->width, texel = (p->y + row) * texture_width + p->x;
  if (row == 0 || row == p->height - 1) {
    for (int j = get_local_id(0); j < width; j += ROW_ITEMS)
      out_x[texel + j] = x[texel + j], out_y[texel + j] = y[texel + j], out_z[texel + j] = z[texel + j];
    return;
  }
  // What wraps round apart from the rest; see lattice.cl for `one`.
  const int one = min(width, 1);
  for (int j = 1 + get_local_id(0); j < width - 1; j += ROW_ITEMS) {
    const int own = texel + j, is_kept = (are_kept[own] & kept) != 0;
    const FilteredPoint q =
        prefilter_point(x, y, z, own, own - one, own + one, own - texture_width, own + texture_width);
    const float px = is_kept ? x[own] : q.x, py = is_kept ? y[own] : q.y, pz = is_kept ? z[own] : q.z;
    out_x[own] = px, out_y[own] = py, out_z[own] = pz;
  }
  for (int side = get_local_id(0); side < 2; side += ROW_ITEMS) {
    const int own = side == 0 ? texel : texel + width - 1, is_kept = (are_kept[own] & kept) != 0;
    const FilteredPoint q = prefilter_point(x, y, z, own, side == 0 ? texel + width - 1 : own - 1,
                                            side == 0 ? texel + 1 : texel, own - texture_width, own + texture_width);
    out_x[own] = is_kept ? x[own] : q.x, out_y[own] = is_kept ? y[own] : q.y, out_z[own] = is_kept ? z[own] : q.z;
  }
}

// NDRange: one work-group of ROW_ITEMS per row, as in reconstruct.cl.
// in  lattice_rows: all
kernel void encode_texels(const int row_count, const int texture_width, global const int* restrict lattice_rows,
                          global const PatchRecord* restrict patches, global const RowRecord* restrict rows,
                          global const ColumnRecord* restrict columns, global const float* restrict x,
                          global const float* restrict y, global const float* restrict z, global float* restrict along,
                          global float* restrict around, global float* restrict out_plane) {
  const int k = get_group_id(0);
  if (k >= row_count) return;
  global const PatchRecord* restrict p = patches + lattice_rows[4 * k];
  global const RowRecord* restrict r = rows + p->row_begin + lattice_rows[4 * k + 1];
  global const ColumnRecord* restrict first_column = columns + p->column_begin;
  const int first = (p->y + lattice_rows[4 * k + 1]) * texture_width + p->x, width = p->width;
  for (int j = get_local_id(0); j < width; j += ROW_ITEMS) {
    const int texel = first + j;
    const ColumnRecord c = first_column[j];
    float foot[3], out[3];
    frame_of(p, *r, c, foot, out);
    const float dx = x[texel] - foot[0], dy = y[texel] - foot[1], dz = z[texel] - foot[2];
    // around = o x s' = -sine s + cosine b; along = out x around
    float around_axis[3];
    for (int i = 0; i < 3; ++i) around_axis[i] = c.cosine * p->b[i] - c.sine * p->s[i];
    const float ax = out[1] * around_axis[2] - out[2] * around_axis[1];
    const float ay = out[2] * around_axis[0] - out[0] * around_axis[2];
    const float az = out[0] * around_axis[1] - out[1] * around_axis[0];
    // Distance to the bone segment.
    const float hx = x[texel] - p->head[0], hy = y[texel] - p->head[1], hz = z[texel] - p->head[2];
    const float axial = clamp(hx * p->axis[0] + hy * p->axis[1] + hz * p->axis[2], 0.0f, p->length);
    const float ex = hx - axial * p->axis[0], ey = hy - axial * p->axis[1], ez = hz - axial * p->axis[2];
    const float distance = sqrt(ex * ex + ey * ey + ez * ez);
    const float length = sqrt(dx * dx + dy * dy + dz * dz);
    const float scale = length > 0.0f ? distance / length : 0.0f;
    along[texel] = scale * (dx * ax + dy * ay + dz * az);
    around[texel] = scale * (dx * around_axis[0] + dy * around_axis[1] + dz * around_axis[2]);
    out_plane[texel] = scale * (dx * out[0] + dy * out[1] + dz * out[2]);
  }
}
