// SPDX-License-Identifier: MIT
// From maps to texels. Positions are planes x, y, z over the whole texture, relative to the model's origin.
//   cover_texels        triangles of all charts   -> per texel the triangle that covers it (lowest index wins)
//   read_surface        that triangle             -> position, of texels that nothing holds
//   read_listed         the same for a list of texels that read beside their place in the lattice
//   place_anchored      vertices and edges of the mesh -> position, of texels that sit on them
//   place_spd_points    distances along SPD rays  -> position
//   place_points        a list of texels          -> position (end rows: seams and poles)
//   prefilter_positions positions                 -> positions moved against their second differences
//   encode_texels       positions                 -> texels in bone tangent space (along, around, out)
// Maps are two buffers, `triangles` and `values`, see map_triangle.h. Reading positions are offsets from the texels'
// own places in the lattice, in cells: a plane around, a plane along.
#include "bone_frame.h"
#include "map_triangle.h"
#include "prefilter.h"
#include "rounding.h"
#include "row_group.h"
#include "skeletex_structs.h"

// v at which the edge from (ua, va) to (ub, vb) crosses u; the caller has checked that it does.
float crossing(float ua, float va, float ub, float vb, float u) {
  const float span = ub - ua;
  return span == 0.0f ? va : va + (vb - va) * clamp((u - ua) / span, 0.0f, 1.0f);
}

// NDRange (triangles, any): the second dimension strides over a triangle's rows.
kernel void cover_texels(const MapParameters p, global const int* restrict triangles,
                         global const float* restrict values, global const PatchRecord* restrict patches,
                         global int* restrict texel_triangles) {
  const int t = (int)get_global_id(0);
  if (t >= p.maps.triangle_count) return;
  const Maps maps = maps_of(p.maps, triangles, values);
  const MapTriangle m = load_triangle(maps, t);
  global const PatchRecord* restrict patch = patches + maps.patches[t];
  const int width = patch->width, height = patch->height;
  global const float *row_high = maps.row_high + patch->row_begin, *row_low = maps.row_low + patch->row_begin;
  const int origin = patch->y * p.texture_width + patch->x;

  const float lowest = fmin(0.0f, fmin(m.du1, m.du2)), highest = fmax(0.0f, fmax(m.du1, m.du2));
  // First row not below the triangle, by bisection, with a row of slack for rounding.
  int first = 0, last = height;
  while (first < last) {
    const int middle = (first + last) / 2;
    const float u = (row_high[middle] - m.u_base_high) + (row_low[middle] - m.u_base_low);
    if (u < lowest)
      first = middle + 1;
    else
      last = middle;
  }
  const float tolerance_u = 4e-7f * (highest - lowest);
  for (int row = max(1, first - 1) + (int)get_global_id(1); row < height - 1; row += (int)get_global_size(1)) {
    const float u = (row_high[row] - m.u_base_high) + (row_low[row] - m.u_base_low);
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
    const int line = origin + row * p.texture_width;
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
// its last triangle, and point_of at its border.
MapPlace walk_to(const Maps maps, const int covering, const int column, const float beside, const int width,
                 const int row, const float above) {
  const int most_steps = beside != 0.0f || above != 0.0f ? 1000 : 0;
  MapPlace place;
  place.t = covering;
  for (int steps = 0;; ++steps) {
    const MapTriangle m = load_triangle(maps, place.t);
    const float u = row_offset(m, maps, row, above), v = turned_offset(m, column, beside, width);
    if (m.pole == 0)
      place.w = plain_weights_at(m, u, v);  // most are
    else
      place.w = weights_at(m, u, v);
    if (!is_outside(place.w) || steps == most_steps) break;
    const float w0 = 1.0f - place.w.w1 - place.w.w2, least = fmin(w0, fmin(place.w.w1, place.w.w2));
    const int corner = least == w0 ? 0 : least == place.w.w1 ? 1 : 2;
    const int next = maps.across[corner * maps.triangle_count + place.t];
    if (next < 0) break;
    place.t = next;
  }
  return place;
}

__attribute__((always_inline)) Point point_of(const Maps maps, const MapPlace place) {
  // Rounding may have put it a little outside.
  const float inner1 = fmax(0.0f, place.w.w1), inner2 = fmax(0.0f, place.w.w2),
              scale = 1.0f / fmax(1.0f, inner1 + inner2);
  const float w1 = inner1 * scale, w2 = inner2 * scale;
  const int count = maps.triangle_count;
  const Point a = point_at(maps.vertices, maps.corners[place.t]),
              b = point_at(maps.vertices, maps.corners[count + place.t]),
              c = point_at(maps.vertices, maps.corners[2 * count + place.t]);
  const Point point = {a.x + w1 * (b.x - a.x) + w2 * (c.x - a.x), a.y + w1 * (b.y - a.y) + w2 * (c.y - a.y),
                       a.z + w1 * (b.z - a.z) + w2 * (c.z - a.z)};
  return point;
}

// NDRange: one work-group of ROW_ITEMS per row, as in reconstruct.cl. Texels of the rows (lattice_rows) that nothing
// holds read at their place in the lattice plus their offset; the points of all others become 0, and are placed later.
// in/out  texel_triangles: that cover the texels' places; where the texels read
kernel void read_surface(const MapParameters p, global const int* restrict lattice_rows,
                         global const PatchRecord* restrict patches, global const int* restrict triangles,
                         global const float* restrict values, global const float* restrict offsets,
                         global const int* restrict anchors, global int* restrict texel_triangles,
                         global float* restrict points) {
  const int k = get_group_id(0);
  if (k >= p.count) return;
  const Maps maps = maps_of(p.maps, triangles, values);
  const MutablePlanes all = mutable_planes_of(points, p.texel_count);
  global const PatchRecord* restrict patch = patches + lattice_rows[4 * k];
  const int width = patch->width, row = patch->row_begin + lattice_rows[4 * k + 1];
  const int first = (patch->y + lattice_rows[4 * k + 1]) * p.texture_width + patch->x;
  global const float *offset_x = offsets + first, *offset_y = offset_x + p.texel_count;
  // Most are in the triangle that covers their place: all look there first, as vector instructions. Others get a
  // negative number.
  for (int j = get_local_id(0); j < width; j += ROW_ITEMS) {
    const int texel = first + j, covering = texel_triangles[texel], t = min(covering, maps.triangle_count - 1);
    const int reads = (covering != NO_TRIANGLE) & (anchors[texel] == 0);
    const float dx = offset_x[j], dy = offset_y[j];
    const MapTriangle m = load_triangle(maps, t);
    const MapPlace place = {t, weights_at(m, inner_row_offset(m, maps, row, dy), turned_offset(m, j, dx, width))};
    const Point point = point_of(maps, place);
    const int walks = reads & ((dx != 0.0f) | (dy != 0.0f)) & is_outside(place.w);
    all.x[texel] = reads ? point.x : 0.0f, all.y[texel] = reads ? point.y : 0.0f;
    all.z[texel] = reads ? point.z : 0.0f;
    texel_triangles[texel] = walks ? -1 - covering : covering;
  }
  for (int j = get_local_id(0); j < width; j += ROW_ITEMS) {
    const int texel = first + j;
    if (texel_triangles[texel] >= 0) continue;
    const MapPlace place = walk_to(maps, -1 - texel_triangles[texel], j, offset_x[j], width, row, offset_y[j]);
    texel_triangles[texel] = place.t;
    set_point(all, texel, point_of(maps, place));
  }
}

// NDRange: count. Texels of a list that nothing holds; what covers their places stays.
kernel void read_listed(const MapParameters p, global const int* restrict texels,
                        global const PatchRecord* restrict patches, global const int* restrict triangles,
                        global const float* restrict values, global const float* restrict offsets,
                        global const int* restrict texel_triangles, global float* restrict points) {
  const int i = (int)get_global_id(0);
  if (i >= p.count) return;
  const int texel = texels[p.first + i], covering = texel_triangles[texel];
  if (covering == NO_TRIANGLE) return;
  const Maps maps = maps_of(p.maps, triangles, values);
  global const PatchRecord* patch = patches + maps.patches[covering];
  const MapPlace place = walk_to(maps, covering, texel % p.texture_width - patch->x, offsets[texel], patch->width,
                                 patch->row_begin + texel / p.texture_width - patch->y, offsets[p.texel_count + texel]);
  set_point(mutable_planes_of(points, p.texel_count), texel, point_of(maps, place));
}

// NDRange: texels of the texture. Those on vertices and edges of the mesh take the points there.
// in   offsets: a third plane, where on its edge a texel is
//      feature_points: numbers of the vertices' points among those of the maps, then two per edge
kernel void place_anchored(const MapParameters p, global const int* restrict anchors,
                           global const float* restrict offsets, global const int* restrict feature_points,
                           global const float* restrict values, global float* restrict points) {
  const int texel = (int)get_global_id(0);
  if (texel >= p.texel_count || anchors[texel] == 0) return;
  const int anchor = anchors[texel], edge = p.vertex_count + 2 * (-1 - anchor);
  const Planes vertices = planes_of(values + 4 * p.maps.vertex_count, p.maps.vertex_count);
  const Point a = point_at(vertices, feature_points[anchor > 0 ? anchor - 1 : edge]),
              b = anchor > 0 ? a : point_at(vertices, feature_points[edge + 1]);
  const float s = anchor > 0 ? 0.0f : offsets[2 * p.texel_count + texel];
  const Point point = {a.x + s * (b.x - a.x), a.y + s * (b.y - a.y), a.z + s * (b.z - a.z)};
  set_point(mutable_planes_of(points, p.texel_count), texel, point);
}

// NDRange (texture width, texture height). Texels with a negative distance are left as they are.
kernel void place_spd_points(const TexelParameters p, global const int* restrict texel_patches,
                             global const float* restrict distances, global const PatchRecord* restrict patches,
                             global const RowRecord* restrict rows, global const float* restrict columns,
                             global float* restrict points) {
  const int texel = (int)get_global_id(1) * p.texture_width + (int)get_global_id(0);
  if ((int)get_global_id(0) >= p.texture_width || texel >= p.texel_count) return;
  const int number = texel_patches[texel];
  const float distance = distances[texel];
  if (number < 0 || distance < 0.0f) return;
  global const PatchRecord* patch = patches + number;
  const int column = texel % p.texture_width - patch->x, row = texel / p.texture_width - patch->y;
  float foot[3], out[3];
  frame_of(patch, rows[patch->row_begin + row], column_at(columns, p.column_count, patch->column_begin + column), foot,
           out);
  const Point point = {foot[0] + distance * out[0], foot[1] + distance * out[1], foot[2] + distance * out[2]};
  set_point(mutable_planes_of(points, p.texel_count), texel, point);
}

// NDRange (count). in   from: planes of `count` values
kernel void place_points(const TexelParameters p, global const int* restrict texels, global const float* restrict from,
                         global float* restrict points) {
  const int i = (int)get_global_id(0);
  if (i < p.count)
    set_point(mutable_planes_of(points, p.texel_count), texels[i], point_at(planes_of(from, p.count), i));
}

// NDRange: one work-group of ROW_ITEMS per row, as in reconstruct.cl. The prefilter, of inner rows; the others, and
// texels with one of the bits `kept`, stay as they are. in   lattice_rows: all
kernel void prefilter_positions(const TexelParameters p, global const int* restrict lattice_rows,
                                global const PatchRecord* restrict patches, global const int* restrict are_kept,
                                global const float* restrict points, global float* restrict filtered) {
  const int k = get_group_id(0), line = p.texture_width;
  if (k >= p.count) return;
  const Planes from = planes_of(points, p.texel_count);
  const MutablePlanes to = mutable_planes_of(filtered, p.texel_count);
  global const PatchRecord* restrict patch = patches + lattice_rows[4 * k];
  const int row = lattice_rows[4 * k + 1], width = patch->width, texel = (patch->y + row) * line + patch->x;
  if (row == 0 || row == patch->height - 1) {
    for (int j = get_local_id(0); j < width; j += ROW_ITEMS) set_point(to, texel + j, point_at(from, texel + j));
    return;
  }
  // What wraps round apart from the rest; see lattice.cl for `one`.
  const int one = min(width, 1);
  for (int j = 1 + get_local_id(0); j < width - 1; j += ROW_ITEMS) {
    const int own = texel + j, is_kept = (are_kept[own] & p.kept) != 0;
    const Point q = prefilter_point(from, own, own - one, own + one, own - line, own + line);
    const float px = is_kept ? from.x[own] : q.x, py = is_kept ? from.y[own] : q.y, pz = is_kept ? from.z[own] : q.z;
    to.x[own] = px, to.y[own] = py, to.z[own] = pz;
  }
  for (int side = get_local_id(0); side < 2; side += ROW_ITEMS) {
    const int own = side == 0 ? texel : texel + width - 1, is_kept = (are_kept[own] & p.kept) != 0;
    const Point q = prefilter_point(from, own, side == 0 ? texel + width - 1 : own - 1, side == 0 ? texel + 1 : texel,
                                    own - line, own + line);
    set_point(to, own, is_kept ? point_at(from, own) : q);
  }
}

// NDRange: one work-group of ROW_ITEMS per row, as in reconstruct.cl.
// in  lattice_rows: all
kernel void encode_texels(const TexelParameters p, global const int* restrict lattice_rows,
                          global const PatchRecord* restrict patches, global const RowRecord* restrict rows,
                          global const float* restrict columns, global const float* restrict points,
                          global float* restrict texels) {
  const int k = get_group_id(0);
  if (k >= p.count) return;
  const Planes from = planes_of(points, p.texel_count);
  const MutablePlanes to = mutable_planes_of(texels, p.texel_count);
  global const PatchRecord* restrict patch = patches + lattice_rows[4 * k];
  global const RowRecord* restrict r = rows + patch->row_begin + lattice_rows[4 * k + 1];
  const int first = (patch->y + lattice_rows[4 * k + 1]) * p.texture_width + patch->x, width = patch->width;
  for (int j = get_local_id(0); j < width; j += ROW_ITEMS) {
    const ColumnRecord c = column_at(columns, p.column_count, patch->column_begin + j);
    const Point point = point_at(from, first + j);
    float foot[3], out[3];
    frame_of(patch, *r, c, foot, out);
    const float dx = point.x - foot[0], dy = point.y - foot[1], dz = point.z - foot[2];
    // around = o x s' = -sine s + cosine b; along = out x around
    float around_axis[3];
    for (int i = 0; i < 3; ++i) around_axis[i] = c.cosine * patch->b[i] - c.sine * patch->s[i];
    const float ax = out[1] * around_axis[2] - out[2] * around_axis[1];
    const float ay = out[2] * around_axis[0] - out[0] * around_axis[2];
    const float az = out[0] * around_axis[1] - out[1] * around_axis[0];
    // Distance to the bone segment.
    const float hx = point.x - patch->head[0], hy = point.y - patch->head[1], hz = point.z - patch->head[2];
    const float axial = clamp(hx * patch->axis[0] + hy * patch->axis[1] + hz * patch->axis[2], 0.0f, patch->length);
    const float ex = hx - axial * patch->axis[0], ey = hy - axial * patch->axis[1], ez = hz - axial * patch->axis[2];
    const float distance = sqrt(ex * ex + ey * ey + ez * ez);
    const float length = sqrt(dx * dx + dy * dy + dz * dz);
    const float scale = length > 0.0f ? distance / length : 0.0f;
    to.x[first + j] = scale * (dx * ax + dy * ay + dz * az);
    to.y[first + j] = scale * (dx * around_axis[0] + dy * around_axis[1] + dz * around_axis[2]);
    to.z[first + j] = scale * (dx * out[0] + dy * out[1] + dz * out[2]);
  }
}
