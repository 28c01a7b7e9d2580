// SPDX-License-Identifier: MIT
// The surface of one model's bone around the bone of another (paper 5). NDRange of all kernels: one work-group of any
// size per row, whose work-items take columns in turn.
#include "planes.h"
#include "transfer_structs.h"

// 1 at an end of the part, 0 from `width` rows on.
static float faded(const float rows, const float width, const int is_linear) {
  const float share = width > 0.0f ? clamp(rows / width, 0.0f, 1.0f) : (rows > 0.0f ? 1.0f : 0.0f);
  return is_linear ? 1.0f - share : 0.5f + 0.5f * cos(3.14159265f * share);
}

// Four points of the source's lattice and their weights, for one texel of the result.
typedef struct {
  int v00, v01, v10, v11;
  float w00, w01, w10, w11;
} Place;

// column: receives the source's column, with its fraction
static Place place_on_source(__global const TransferPatch* restrict from, __global const TransferColumn* restrict here,
                             const float axial, const int row, float* restrict column) {
  const float period = (float)from->width, frequency = 1.0f / period;
  const int source_last = from->height - 1;
  const float lifted = here->head_column + axial * (here->tail_column - here->head_column);
  *column = lifted - period * floor(lifted * frequency);
  const int left_any = (int)*column;
  const float right_share = *column - (float)left_any;
  const int left = left_any >= from->width ? left_any - from->width : left_any;
  const int right = left + 1 < from->width ? left + 1 : 0;

  const float inside = clamp(here->row_begin + here->row_step * (float)row, 0.0f, (float)source_last);
  const float at_row = from->sign < 0.0f ? (float)source_last - inside : inside;
  const int below = min((int)at_row, source_last - 1);
  const float above_share = at_row - (float)below;

  const int p = from->begin + below * from->width;
  const Place place = {p + left,
                       p + right,
                       p + left + from->width,
                       p + right + from->width,
                       (1.0f - above_share) * (1.0f - right_share),
                       (1.0f - above_share) * right_share,
                       above_share * (1.0f - right_share),
                       above_share * right_share};
  return place;
}

static float read_at(const Place* restrict p, __global const float* restrict plane) {
  return p->w00 * plane[p->v00] + p->w01 * plane[p->v01] + p->w10 * plane[p->v10] + p->w11 * plane[p->v11];
}

// Places the source's points around the result's bones: scaled along the bone and across it, sheared where separation
// planes differ, and with corrections at both ends.
// in   corrections: planes of column_count floats, [((end * bands + band) * 2 + is_slope) * 3 + axis]: the offset where
//      the part begins (first_row and last_row of the columns), and its change per row from there
//      source: planes s, b, o of the points of the source's lattice, all rows, in the axes of their own bones from
//      their heads. target: the same of the target's
// out  points: planes s, b, o, in the axes of the result's bones from their heads
__kernel void place_part(const TransferParameters transfer, __global const TransferRow* restrict rows,
                         __global const TransferPatch* restrict patches,
                         __global const TransferColumn* restrict columns, __global const float* restrict corrections,
                         __global const float* restrict source, __global const float* restrict target,
                         __global float* restrict points) {
  const int k = get_group_id(0);
  if (k >= transfer.row_count) return;
  PLANES(global const float, in_s, in_b, in_o, source, transfer.source_count);
  PLANES(global const float, target_s, target_b, target_o, target, transfer.target_count);
  PLANES(global float, s, b, o, points, transfer.point_count);
  const int row = rows[k].row, vertex = rows[k].vertex, width = rows[k].width, column_count = transfer.column_count;
  __global const TransferPatch* restrict from = patches + rows[k].patch;
  const float sign = from->sign;
  const float frequency = 1.0f / (float)from->width, turn = 1.0f / (float)width;
  const float axial = rows[k].axial, scale = rows[k].scale;

  for (int j = get_local_id(0); j < width; j += get_local_size(0)) {
    __global const TransferColumn* restrict here = columns + from->column_begin + j;
    float column;
    const Place place = place_on_source(from, here, axial, row, &column);
    const float read_s = read_at(&place, in_s), read_b = read_at(&place, in_b), read_o = read_at(&place, in_o);

    // From the source's angle to the one here.
    const float own = 6.28318531f * turn * (float)j;
    const float angle = own - sign * 6.28318531f * frequency * column;
    const float cosine = cos(angle), sine = sin(angle);
    const float turned_s = cosine * read_s - sign * sine * read_b;
    const float turned_b = sine * read_s + sign * cosine * read_b;
    const float along = sign < 0.0f ? from->source_length - read_o : read_o;
    const float across = turned_s * cos(own) + turned_b * sin(own);
    const float shear = (1.0f - axial) * here->head_shear + axial * here->tail_shear;
    float point_o = from->length_offset + from->length_scale * along + shear * across;
    float point_s = scale * turned_s + from->lean_s * (from->lean_end - point_o),
          point_b = scale * turned_b + from->lean_b * (from->lean_end - point_o);

    if (from->target_begin >= 0) {
      const float kept =
          fmin(1.0f, faded(fmax(0.0f, (float)row - here->first_row), from->head_width, from->is_linear) +
                         faded(fmax(0.0f, here->last_row - (float)row), from->tail_width, from->is_linear));
      const int t = from->target_begin + row * width + j;
      point_s += kept * (target_s[t] - point_s);
      point_b += kept * (target_b[t] - point_b);
      point_o += kept * (target_o[t] - point_o);
    }
    for (int end = 0; end < 2 && from->target_begin < 0; ++end) {
      const float distance = fmax(0.0f, end == 0 ? (float)row - here->first_row : here->last_row - (float)row);
      float fade_width = end == 0 ? from->head_width : from->tail_width;
      for (int band = 0; band < SKELETEX_TRANSFER_BANDS; ++band, fade_width *= 0.7f) {
        if (distance > 0.0f && distance >= fade_width) break;
        const float fade = faded(distance, fade_width, from->is_linear);
        __global const float* restrict c =
            corrections + (end * SKELETEX_TRANSFER_BANDS + band) * 6 * column_count + from->column_begin + j;
        point_s += fade * (c[0] + distance * c[3 * column_count]);
        point_b += fade * (c[column_count] + distance * c[4 * column_count]);
        point_o += fade * (c[2 * column_count] + distance * c[5 * column_count]);
      }
    }
    s[vertex + j] = point_s;
    b[vertex + j] = point_b;
    o[vertex + j] = point_o;
  }
}

// Reads any points of the source's lattice at the places where place_part reads them.
// in   source: planes x, y, z of the points     out  points: planes x, y, z
__kernel void read_source(const TransferParameters transfer, __global const TransferRow* restrict rows,
                          __global const TransferPatch* restrict patches,
                          __global const TransferColumn* restrict columns, __global const float* restrict source,
                          __global float* restrict points) {
  const int k = get_group_id(0);
  if (k >= transfer.row_count) return;
  PLANES(global const float, in_x, in_y, in_z, source, transfer.source_count);
  PLANES(global float, x, y, z, points, transfer.point_count);
  const int patch = rows[k].patch, row = rows[k].row, vertex = rows[k].vertex, width = rows[k].width;
  const float axial = rows[k].axial;
  for (int j = get_local_id(0); j < width; j += get_local_size(0)) {
    float column;
    const Place place =
        place_on_source(patches + patch, columns + patches[patch].column_begin + j, axial, row, &column);
    x[vertex + j] = read_at(&place, in_x);
    y[vertex + j] = read_at(&place, in_y);
    z[vertex + j] = read_at(&place, in_z);
  }
}

// Restores the target's texels, bit by bit, where it keeps its surface.
// in   target: planes along, around, out of the target's texels     in and out  texels: the same of the result's
__kernel void keep_target(const TransferParameters transfer, __global const TransferRow* restrict rows,
                          __global const TransferPatch* restrict patches,
                          __global const TransferColumn* restrict columns, __global const float* restrict target,
                          __global float* restrict texels) {
  const int k = get_group_id(0);
  if (k >= transfer.row_count) return;
  PLANES(global const float, in_along, in_around, in_out, target, transfer.target_count);
  PLANES(global float, along, around, out, texels, transfer.target_count);
  const int row = rows[k].row, texel = rows[k].texel, width = rows[k].width;
  __global const TransferColumn* restrict here = columns + patches[rows[k].patch].column_begin;
  for (int j = get_local_id(0); j < width; j += get_local_size(0)) {
    if ((float)row > here[j].first_row && (float)row < here[j].last_row) continue;
    along[texel + j] = in_along[texel + j];
    around[texel + j] = in_around[texel + j];
    out[texel + j] = in_out[texel + j];
  }
}
