// SPDX-License-Identifier: MIT
// From texels to surface points and triangles (paper 3.6, appendix A), and the resampling of texels.
//
// Row items. All kernels but filter_rows run over a table of row pieces, ITEM_COLUMNS columns at most each, so that one
// launch serves all patches: items[k] = (patch, row, first column, index of the first column in the planes of vertices).
// NDRange: x = column within the piece, y = item; any work-group size is right, ITEM_COLUMNS x 1 is the one meant: what
// belongs to the row is then the same in a whole work-group, and neighbouring work-items touch neighbouring texels.
// Planes are separate float arrays; a texel lies at (patch.y + row) * texture_width + patch.x + column.
#include "skeletex_structs.h"

#ifndef ITEM_COLUMNS
#define ITEM_COLUMNS 64
#endif

// in   along, around, out: texels; patches, rows, columns: the tables of frame_tables()
// out  x, y, z: the points, relative to the origin of the patch records, at items[k].w + column
// The point is foot + m q, where q is the texel turned into the bone's own axes (s', o x s', o) and m q leaves the
// capsule of radius e = |q| around the bone: its cylinder, or the sphere at the end that q runs towards.
__kernel void displace(const int item_count, const int texture_width, __global const int4* restrict items,
                       __global const PatchRecord* restrict patches, __global const RowRecord* restrict rows,
                       __global const ColumnRecord* restrict columns, __global const float* restrict along,
                       __global const float* restrict around, __global const float* restrict out, __global float* restrict x,
                       __global float* restrict y, __global float* restrict z) {
  const int k = get_global_id(1);
  if (k >= item_count) return;
  const int4 item = items[k];
  __global const PatchRecord* restrict patch = patches + item.x;
  const int piece = get_global_id(0);
  const int column = item.z + piece;
  if (piece >= ITEM_COLUMNS || column >= patch->width) return;

  const RowRecord row = rows[patch->row_begin + item.y];
  const ColumnRecord at = columns[patch->column_begin + column];
  const int texel = (patch->y + item.y) * texture_width + patch->x + column;
  const float a = along[texel], c = around[texel], w = out[texel];
  const float bone_length = patch->length;

  // f = f_s s' + f_o o opens the frame: out = f / |f|, along = (f_s o - f_o s') / |f|, around = o x s'.
  const float slope = at.slope_head + row.station * (at.slope_tail - at.slope_head);
  const float f_s = row.cap_cos;
  const float f_o = row.cap_cos * slope + row.cap_sin;
  const float f_inverse = 1.0f / sqrt(f_s * f_s + f_o * f_o);
  const float q_s = (w * f_s - a * f_o) * f_inverse;
  const float q_o = (w * f_o + a * f_s) * f_inverse;

  const float across2 = q_s * q_s + c * c;
  const float e = sqrt(across2 + q_o * q_o);
  const float across = sqrt(across2);
  const float foot = row.station * bone_length;
  const float m_cylinder = e / across;
  const float exit = foot + m_cylinder * q_o;
  // The sphere of radius e about the node at distance `rest` ahead. e - rest sin is kept as a difference of lengths.
  const float e_inverse = 1.0f / e;
  const float rest = q_o < 0.0f ? foot : bone_length - foot;
  const float rest_across = rest * across * e_inverse;
  const float m_sphere = (rest * fabs(q_o) * e_inverse + sqrt(fmax(0.0f, (e - rest_across) * (e + rest_across)))) * e_inverse;
  const float m_solid = exit >= 0.0f && exit <= bone_length ? m_cylinder : m_sphere;
  const float m = e > 0.0f ? m_solid : 0.0f;

  const float p_s = m * (q_s * at.cosine - c * at.sine);
  const float p_b = m * (q_s * at.sine + c * at.cosine);
  const float p_o = foot + m * q_o;
  const int vertex = item.w + piece;
  x[vertex] = patch->head[0] + p_s * patch->s[0] + p_b * patch->b[0] + p_o * patch->axis[0];
  y[vertex] = patch->head[1] + p_s * patch->s[1] + p_b * patch->b[1] + p_o * patch->axis[1];
  z[vertex] = patch->head[2] + p_s * patch->s[2] + p_b * patch->b[2] + p_o * patch->axis[2];
}

// Both triangles of every quad between row item.y and the next, split along the diagonal that is shorter; of two that
// agree to rounding, the one from (row, column) to (row + 1, column + 1).
// in   x, y, z: the vertices; the next row follows its row in them
// out  triangles: six indices per quad, counter-clockwise from outside (u along, v around is clockwise)
__kernel void triangulate_quads(const int item_count, __global const int4* restrict items, __global const PatchRecord* restrict patches,
                                __global const int* restrict first_quads, __global const float* restrict x, __global const float* restrict y,
                                __global const float* restrict z, __global int* restrict triangles) {
  const int k = get_global_id(1);
  if (k >= item_count) return;
  const int4 item = items[k];
  const int width = patches[item.x].width;
  const int piece = get_global_id(0);
  const int column = item.z + piece;
  if (piece >= ITEM_COLUMNS || column >= width) return;

  const int v00 = item.w + piece;
  const int v01 = column + 1 < width ? v00 + 1 : item.w - item.z;
  const int v10 = v00 + width;
  const int v11 = v01 + width;
  const float fx = x[v11] - x[v00], fy = y[v11] - y[v00], fz = z[v11] - z[v00];
  const float gx = x[v10] - x[v01], gy = y[v10] - y[v01], gz = z[v10] - z[v01];
  const float first = fx * fx + fy * fy + fz * fz;
  const float second = gx * gx + gy * gy + gz * gz;
  const int is_second = second < 0.99999f * first;

  __global int* restrict t = triangles + 6 * (first_quads[k] + piece);
  t[0] = v00;
  t[1] = v01;
  t[2] = is_second ? v10 : v11;
  t[3] = is_second ? v10 : v00;
  t[4] = is_second ? v01 : v11;
  t[5] = is_second ? v11 : v10;
}

// One axis of a resampling: out at (new row, column) = sum of weights times in at old rows of the same column.
// in   taps: per new row of all patches, in the order of the row table: (first old row, count, first weight, unused);
//      patches: the new ones; widths, first_in: per patch the row length of `in` and where the patch begins in it
// out  planes in the order of the items, whose columns run over `widths`
__kernel void filter_rows(const int item_count, __global const int4* restrict items, __global const PatchRecord* restrict patches,
                          __global const int* restrict widths, __global const int* restrict first_in, __global const int4* restrict taps,
                          __global const float* restrict weights, __global const float* restrict in_x, __global const float* restrict in_y,
                          __global const float* restrict in_z, __global float* restrict out_x, __global float* restrict out_y,
                          __global float* restrict out_z) {
  const int k = get_global_id(1);
  if (k >= item_count) return;
  const int4 item = items[k];
  const int width = widths[item.x];
  const int piece = get_global_id(0);
  const int column = item.z + piece;
  if (piece >= ITEM_COLUMNS || column >= width) return;

  const int4 tap = taps[patches[item.x].row_begin + item.y];
  int from = first_in[item.x] + tap.x * width + column;
  float x = 0.0f, y = 0.0f, z = 0.0f;
  for (int i = 0; i < tap.y; ++i, from += width) {
    const float weight = weights[tap.z + i];
    x += weight * in_x[from];
    y += weight * in_y[from];
    z += weight * in_z[from];
  }
  out_x[item.w + piece] = x;
  out_y[item.w + piece] = y;
  out_z[item.w + piece] = z;
}

// The other axis: columns, which wrap round.
// in   taps: per new column of all patches, in the order of the column table: (first old column, count, first weight,
//      unused), the first in [0, old width) and the count at most the old width; widths: per patch the row length of `in`
// out  planes in the order of the items
__kernel void filter_columns(const int item_count, __global const int4* restrict items, __global const PatchRecord* restrict patches,
                             __global const int* restrict widths, __global const int* restrict first_in, __global const int4* restrict taps,
                             __global const float* restrict weights, __global const float* restrict in_x, __global const float* restrict in_y,
                             __global const float* restrict in_z, __global float* restrict out_x, __global float* restrict out_y,
                             __global float* restrict out_z) {
  const int k = get_global_id(1);
  if (k >= item_count) return;
  const int4 item = items[k];
  const int piece = get_global_id(0);
  const int column = item.z + piece;
  if (piece >= ITEM_COLUMNS || column >= patches[item.x].width) return;

  const int4 tap = taps[patches[item.x].column_begin + column];
  const int width = widths[item.x];
  const int row = first_in[item.x] + item.y * width;
  int from = tap.x;
  float x = 0.0f, y = 0.0f, z = 0.0f;
  for (int i = 0; i < tap.y; ++i) {
    const float weight = weights[tap.z + i];
    x += weight * in_x[row + from];
    y += weight * in_y[row + from];
    z += weight * in_z[row + from];
    from = from + 1 < width ? from + 1 : 0;
  }
  out_x[item.w + piece] = x;
  out_y[item.w + piece] = y;
  out_z[item.w + piece] = z;
}

// Texels of points: the inverse of displace. A texel is the direction from the foot in the frame (along, around, out),
// scaled to the distance of the point from the bone.
// in   x, y, z: points at items[k].w + column, in the bone's own axes: from H along s, b, o
// out  along, around, out: texels, at their places in the texture
__kernel void enter_tangent_space(const int item_count, const int texture_width, __global const int4* restrict items,
                                  __global const PatchRecord* restrict patches, __global const RowRecord* restrict rows,
                                  __global const ColumnRecord* restrict columns, __global const float* restrict x, __global const float* restrict y,
                                  __global const float* restrict z, __global float* restrict along, __global float* restrict around,
                                  __global float* restrict out) {
  const int k = get_global_id(1);
  if (k >= item_count) return;
  const int4 item = items[k];
  __global const PatchRecord* restrict patch = patches + item.x;
  const int piece = get_global_id(0);
  const int column = item.z + piece;
  if (piece >= ITEM_COLUMNS || column >= patch->width) return;

  const RowRecord row = rows[patch->row_begin + item.y];
  const ColumnRecord at = columns[patch->column_begin + column];
  const float bone_length = patch->length;
  const float p_s = x[item.w + piece], p_b = y[item.w + piece], p_o = z[item.w + piece];
  const float q_s = p_s * at.cosine + p_b * at.sine;
  const float q_c = p_b * at.cosine - p_s * at.sine;
  const float q_o = p_o - row.station * bone_length;
  const float beyond = p_o - clamp(p_o, 0.0f, bone_length);
  const float across2 = p_s * p_s + p_b * p_b;
  const float length = sqrt(across2 + q_o * q_o);
  const float scale = length > 0.0f ? sqrt(across2 + beyond * beyond) / length : 0.0f;

  const float slope = at.slope_head + row.station * (at.slope_tail - at.slope_head);
  const float f_s = row.cap_cos;
  const float f_o = row.cap_cos * slope + row.cap_sin;
  const float f_scale = scale / sqrt(f_s * f_s + f_o * f_o);
  const int texel = (patch->y + item.y) * texture_width + patch->x + column;
  along[texel] = (q_o * f_s - q_s * f_o) * f_scale;
  around[texel] = q_c * scale;
  out[texel] = (q_s * f_s + q_o * f_o) * f_scale;
}
