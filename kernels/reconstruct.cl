// SPDX-License-Identifier: MIT
// From texels to surface points and triangles (paper 3.6, appendix A), and the resampling of texels.
//
// Rows. Every kernel runs over a table of lattice rows, so that one launch serves all patches: four ints per row,
// (patch, row, number of its first vertex in the planes of points, number of its first quad). NDRange: one work-group
// per row, of any size; work-items take columns in turn, so that neighbours touch neighbouring texels. On a GPU a group
// of some warps is meant. On a CPU groups of one are, and the compiler turns the loop over columns into vector
// instructions: hence plain scalars on separate planes, selects instead of branches, and what belongs to the row loaded
// before the loop.
// Planes. Points (x, y, z) and texels (along, around, out) are planes behind each other in one buffer. A texel lies at
// (patch.y + row) * texture_width + patch.x + column of its plane. The column table is four planes of column_count
// floats: cosine, sine, slope_head, slope_tail (see ColumnRecord).
#include "capsule.h"
#include "planes.h"
#include "quad_diagonal.h"
#include "reconstruct_structs.h"
#include "skeletex_structs.h"

// The points of texels, relative to the origin of the patch records.
// The point is foot + m q, where q is the texel turned into the bone's own axes (s', o x s', o), and m q is where the
// ray along q leaves the capsule of radius |q| around the bone (capsule.h).
__kernel void displace(const DisplaceParameters p, __global const int* restrict lattice_rows,
                       __global const PatchRecord* restrict patches, __global const RowRecord* restrict rows,
                       __global const float* restrict columns, __global const float* restrict texels,
                       __global float* restrict points) {
  const int k = get_group_id(0);
  if (k >= p.row_count) return;
  PLANES(global const float, along, around, out, texels, p.texel_count);
  PLANES(global float, x, y, z, points, p.point_count);
  __global const PatchRecord* restrict patch = patches + lattice_rows[4 * k];
  const int row = lattice_rows[4 * k + 1], vertex = lattice_rows[4 * k + 2];
  const int width = patch->width;
  const int texel = (patch->y + row) * p.texture_width + patch->x;
  const float head_x = patch->head[0], head_y = patch->head[1], head_z = patch->head[2];
  const float s_x = patch->s[0], s_y = patch->s[1], s_z = patch->s[2];
  const float b_x = patch->b[0], b_y = patch->b[1], b_z = patch->b[2];
  const float o_x = patch->axis[0], o_y = patch->axis[1], o_z = patch->axis[2];
  __global const RowRecord* restrict record = rows + patch->row_begin + row;
  const float axial = record->axial, cap_cos = record->cap_cos, cap_sin = record->cap_sin;
  const float foot = axial * patch->length, foot_to_tail = patch->length - foot;
  PLANES(global const float, cosines, sines, head_slopes, columns + patch->column_begin, p.column_count);
  __global const float* restrict tail_slopes = head_slopes + p.column_count;

  const int step = get_local_size(0);
  for (int j = get_local_id(0); j < width; j += step) {
    const float cosine = cosines[j], sine = sines[j];
    const float a = along[texel + j], c = around[texel + j], w = out[texel + j];

    // f = f_s s' + f_o o opens the frame: out = f / |f|, along = (f_s o - f_o s') / |f|, around = o x s'.
    const float slope = head_slopes[j] + axial * (tail_slopes[j] - head_slopes[j]);
    const float f_s = cap_cos;
    const float f_o = cap_cos * slope + cap_sin;
    const float f_inverse = 1.0f / sqrt(f_s * f_s + f_o * f_o);
    const float q_s = (w * f_s - a * f_o) * f_inverse;
    const float q_o = (w * f_o + a * f_s) * f_inverse;

    const float q_o2 = q_o * q_o;
    const float across2 = q_s * q_s + c * c;
    const float e2 = across2 + q_o2;
    const float e2_inverse = 1.0f / e2;
    const float m_capsule = leave_capsule_of_own_length(q_o, across2 * e2_inverse, e2_inverse, foot, foot_to_tail);
    const float m = e2 > 0.0f ? m_capsule : 0.0f;

    const float p_s = m * (q_s * cosine - c * sine);
    const float p_b = m * (q_s * sine + c * cosine);
    const float p_o = foot + m * q_o;
    x[vertex + j] = head_x + p_s * s_x + p_b * b_x + p_o * o_x;
    y[vertex + j] = head_y + p_s * s_y + p_b * b_y + p_o * o_y;
    z[vertex + j] = head_z + p_s * s_z + p_b * b_z + p_o * o_z;
  }
}

void write_quad(__global int* restrict t, int is_second, const int at[4][4]) {
  t[0] = at[1][1];
  t[1] = at[1][2];
  t[2] = is_second ? at[2][1] : at[2][2];
  t[3] = is_second ? at[2][1] : at[1][1];
  t[4] = is_second ? at[1][2] : at[2][2];
  t[5] = is_second ? at[2][2] : at[2][1];
}

// The 4 x 4 vertices around a quad, see quad_diagonal.h. Beyond the first and last inner row they repeat the quad's
// own.
void vertices_around(int vertex, int width, int column, int has_before, int has_after, int at[4][4]) {
  const int next = column + 1 < width ? column + 1 : 0;
  const int columns[4] = {column > 0 ? column - 1 : width - 1, column, next, next + 1 < width ? next + 1 : 0};
  for (int i = 0; i < 4; ++i) {
    at[0][i] = vertex + columns[i] - (has_before ? width : 0);
    at[1][i] = vertex + columns[i];
    at[2][i] = vertex + columns[i] + width;
    at[3][i] = vertex + columns[i] + (has_after ? 2 : 1) * width;
  }
}

// Both triangles of every quad between a row and the next, by the nearer diagonal or, for models whose texels lie on
// edges of the surface, by the smoother one.
// in   points: the vertices of inner rows; the next row follows its row in them
// out  triangles: six indices per quad, counter-clockwise from outside (u along, v around is clockwise)
__kernel void triangulate(const TriangulateParameters p, __global const int* restrict lattice_rows,
                          __global const PatchRecord* restrict patches, __global const float* restrict points,
                          __global int* restrict triangles) {
  const int k = get_group_id(0);
  if (k >= p.row_count) return;
  const Planes inner = planes_of(points, p.point_count);
  const int width = patches[lattice_rows[4 * k]].width;
  const int row = lattice_rows[4 * k + 1], vertex = lattice_rows[4 * k + 2], quad = lattice_rows[4 * k + 3];
  const int has_before = row > 1, has_after = row + 2 < patches[lattice_rows[4 * k]].height - 1;
  const int step = get_local_size(0);
  for (int j = get_local_id(0); j < width; j += step) {
    int at[4][4];
    vertices_around(vertex, width, j, has_before, has_after, at);
    const int is_second = p.is_smooth ? takes_second_if_smoother(at, has_before, has_after, inner)
                                      : takes_second_if_nearer(at, has_before, has_after, inner);
    write_quad(triangles + 6 * (quad + j), is_second, at);
  }
}

// One axis of a resampling: out at (new row, column) = sum of weights times in at old rows of the same column.
// in   taps: per new row of all patches, in the order of the row table, four ints: (first old row, count, first weight,
//      unused). patches: the new ones. widths, first_in: per patch the row length of `in` and where the patch begins in
//      it. in: points
// out  points in rows of `widths` columns
__kernel void filter_rows(const ResampleParameters p, __global const int* restrict lattice_rows,
                          __global const PatchRecord* restrict patches, __global const int* restrict widths,
                          __global const int* restrict first_in, __global const int* restrict taps,
                          __global const float* restrict weights, __global const float* restrict in,
                          __global float* restrict out) {
  const int k = get_group_id(0);
  if (k >= p.row_count) return;
  PLANES(global const float, in_x, in_y, in_z, in, p.in_count);
  PLANES(global float, out_x, out_y, out_z, out, p.out_count);
  const int patch = lattice_rows[4 * k], vertex = lattice_rows[4 * k + 2];
  const int width = widths[patch];
  __global const int* restrict tap = taps + 4 * (patches[patch].row_begin + lattice_rows[4 * k + 1]);
  const int count = tap[1];
  __global const float* restrict weight = weights + tap[2];
  const int first = first_in[patch] + tap[0] * width;

  const int begin = get_local_id(0), step = get_local_size(0);
  for (int j = begin; j < width; j += step) {
    out_x[vertex + j] = 0.0f;
    out_y[vertex + j] = 0.0f;
    out_z[vertex + j] = 0.0f;
  }
  for (int i = 0; i < count; ++i) {
    const float w = weight[i];
    const int from = first + i * width;
    for (int j = begin; j < width; j += step) {
      out_x[vertex + j] += w * in_x[from + j];
      out_y[vertex + j] += w * in_y[from + j];
      out_z[vertex + j] += w * in_z[from + j];
    }
  }
}

// The other axis: columns, which wrap round.
// in   taps: per new column of all patches, in the order of the column table, four ints: (first old column, count,
//      first weight, unused), the first in [0, old width) and the count at most the old width. The rest as above
// out  points in rows as wide as the patches
__kernel void filter_columns(const ResampleParameters p, __global const int* restrict lattice_rows,
                             __global const PatchRecord* restrict patches, __global const int* restrict widths,
                             __global const int* restrict first_in, __global const int* restrict taps,
                             __global const float* restrict weights, __global const float* restrict in,
                             __global float* restrict out) {
  const int k = get_group_id(0);
  if (k >= p.row_count) return;
  PLANES(global const float, in_x, in_y, in_z, in, p.in_count);
  PLANES(global float, out_x, out_y, out_z, out, p.out_count);
  const int patch = lattice_rows[4 * k], vertex = lattice_rows[4 * k + 2];
  const int old_width = widths[patch], width = patches[patch].width;
  const int row = first_in[patch] + lattice_rows[4 * k + 1] * old_width;
  __global const int* restrict row_taps = taps + 4 * patches[patch].column_begin;

  const int step = get_local_size(0);
  for (int j = get_local_id(0); j < width; j += step) {
    const int count = row_taps[4 * j + 1];
    __global const float* restrict weight = weights + row_taps[4 * j + 2];
    int from = row_taps[4 * j];
    float sum_x = 0.0f, sum_y = 0.0f, sum_z = 0.0f;
    for (int i = 0; i < count; ++i) {
      sum_x += weight[i] * in_x[row + from];
      sum_y += weight[i] * in_y[row + from];
      sum_z += weight[i] * in_z[row + from];
      from = from + 1 < old_width ? from + 1 : 0;
    }
    out_x[vertex + j] = sum_x;
    out_y[vertex + j] = sum_y;
    out_z[vertex + j] = sum_z;
  }
}

// Keeps fitted points near sampled ones: a fitted point is off by at most `share` of an edge of the sampled lattice
// that ends there. That edge is the longer of two: the shorter one along the rows and the shorter one around. A
// least-squares fit moves points by a small part of an edge where the surface is smooth; where it jumps, one edge is
// long, and the fit swings out next to it.
// in      sampled: points of all rows of every patch, in_count per plane
// in/out  fitted: the same, out_count per plane
__kernel void limit_fit(const ResampleParameters p, __global const int* restrict lattice_rows,
                        __global const PatchRecord* restrict patches, __global const float* restrict sampled,
                        __global float* restrict fitted) {
  const int k = get_group_id(0);
  if (k >= p.row_count) return;
  PLANES(global const float, sampled_x, sampled_y, sampled_z, sampled, p.in_count);
  PLANES(global float, x, y, z, fitted, p.out_count);
  __global const PatchRecord* restrict patch = patches + lattice_rows[4 * k];
  const int row = lattice_rows[4 * k + 1], vertex = lattice_rows[4 * k + 2];
  const int width = patch->width;
  const int below = row > 0 ? -width : width, above = row + 1 < patch->height ? width : -width;

  const int step = get_local_size(0);
  for (int j = get_local_id(0); j < width; j += step) {
    const int v = vertex + j, left = vertex + (j > 0 ? j - 1 : width - 1), right = vertex + (j + 1 < width ? j + 1 : 0);
    const float px = sampled_x[v], py = sampled_y[v], pz = sampled_z[v];
    const int neighbours[4] = {v + below, v + above, left, right};
    float lengths2[4];
    for (int i = 0; i < 4; ++i) {
      const float ex = sampled_x[neighbours[i]] - px, ey = sampled_y[neighbours[i]] - py,
                  ez = sampled_z[neighbours[i]] - pz;
      lengths2[i] = ex * ex + ey * ey + ez * ez;
    }
    const float most2 = p.share * p.share * fmax(fmin(lengths2[0], lengths2[1]), fmin(lengths2[2], lengths2[3]));
    const float dx = x[v] - px, dy = y[v] - py, dz = z[v] - pz;
    const float move2 = dx * dx + dy * dy + dz * dz;
    const float kept = move2 > most2 ? sqrt(most2 / move2) : 1.0f;
    x[v] = px + kept * dx;
    y[v] = py + kept * dy;
    z[v] = pz + kept * dz;
  }
}

// Texels of points: the inverse of displace. A texel is the direction from the foot in the frame (along, around, out),
// scaled to the distance of the point from the bone.
// in   points: in the bone's own axes, from H along s, b, o
// out  texels, at their places in the texture
__kernel void enter_tangent_space(const DisplaceParameters p, __global const int* restrict lattice_rows,
                                  __global const PatchRecord* restrict patches, __global const RowRecord* restrict rows,
                                  __global const float* restrict columns, __global const float* restrict points,
                                  __global float* restrict texels) {
  const int k = get_group_id(0);
  if (k >= p.row_count) return;
  PLANES(global const float, x, y, z, points, p.point_count);
  PLANES(global float, along, around, out, texels, p.texel_count);
  __global const PatchRecord* restrict patch = patches + lattice_rows[4 * k];
  const int row = lattice_rows[4 * k + 1], vertex = lattice_rows[4 * k + 2];
  const int width = patch->width;
  const int texel = (patch->y + row) * p.texture_width + patch->x;
  const float bone_length = patch->length;
  __global const RowRecord* restrict record = rows + patch->row_begin + row;
  const float axial = record->axial, cap_cos = record->cap_cos, cap_sin = record->cap_sin;
  const float foot = axial * bone_length;
  PLANES(global const float, cosines, sines, head_slopes, columns + patch->column_begin, p.column_count);
  __global const float* restrict tail_slopes = head_slopes + p.column_count;

  const int step = get_local_size(0);
  for (int j = get_local_id(0); j < width; j += step) {
    const float p_s = x[vertex + j], p_b = y[vertex + j], p_o = z[vertex + j];
    const float q_s = p_s * cosines[j] + p_b * sines[j];
    const float q_c = p_b * cosines[j] - p_s * sines[j];
    const float q_o = p_o - foot;
    const float beyond = p_o - clamp(p_o, 0.0f, bone_length);
    const float across2 = p_s * p_s + p_b * p_b;
    const float length2 = across2 + q_o * q_o;
    const float ratio = sqrt((across2 + beyond * beyond) / length2);
    const float scale = length2 > 0.0f ? ratio : 0.0f;

    const float slope = head_slopes[j] + axial * (tail_slopes[j] - head_slopes[j]);
    const float f_s = cap_cos;
    const float f_o = cap_cos * slope + cap_sin;
    const float f_scale = scale / sqrt(f_s * f_s + f_o * f_o);
    along[texel + j] = (q_o * f_s - q_s * f_o) * f_scale;
    around[texel + j] = q_c * scale;
    out[texel + j] = (q_s * f_s + q_o * f_o) * f_scale;
  }
}
