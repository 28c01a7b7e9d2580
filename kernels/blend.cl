// SPDX-License-Identifier: MIT
// Texels as weighted sums of the texels of other textures, each read at a place of its own: morphs and transfers (paper
// 5).
//
// in   lattice_rows: the rows to do, four ints each: patch, row, two unused (see reconstruct.cl)
//      patches, rows: the result's. sources: per source and patch [source * patch_count + patch]
//      source_rows: per source and row to do [source * row_count + k]
//      columns: per source and column of the result (BlendColumn). Between head and tail what is read and how slopes
//      rise run along the curve that poses take (EASED in pose.cl), so that what differs at one end does not break the
//      surface at the other; and what is not even around the bone, at corners, fades out within END_REACH of its end.
//      source_slopes: pairs per column of a source: the separation planes' slopes at head and tail, as the result's
//      bone runs. A texel is turned from the slope that its frame has in the source, with the rise, to that of the
//      result's frame. result_columns: of the result (ColumnRecord)
//      texels: planes along, around, out of in_count floats, of all sources
// out  blended: the same of the result's texture, texture_width columns
// NDRange: one work-group per row, of any size; work-items take columns in turn (see reconstruct.cl). A column of the
// result is done by one work-item for all sources, so sums need no barrier and have a fixed order.
// Reads are linear between the four texels around. Where a place is a texel's own, the result is weight * texel
// exactly.
#include "blend_structs.h"
#include "skeletex_structs.h"

// How far from an end of a bone its corners are felt, as a share of the way to the other end.
#define END_REACH 0.3f

__kernel void blend_texels(const int row_count, const int source_count, const int patch_count, const int texture_width,
                           __global const int* restrict lattice_rows, __global const PatchRecord* restrict patches,
                           __global const RowRecord* restrict rows, __global const BlendSource* restrict sources,
                           __global const BlendRow* restrict source_rows, __global const BlendColumn* restrict columns,
                           __global const float* restrict source_slopes,
                           __global const ColumnRecord* restrict result_columns, const int in_count,
                           __global const float* restrict texels, const int out_count,
                           __global float* restrict blended) {
  const int k = get_group_id(0);
  if (k >= row_count) return;
  __global const float* restrict in_along = texels;
  __global const float* restrict in_around = in_along + in_count;
  __global const float* restrict in_out = in_around + in_count;
  __global float* restrict along = blended;
  __global float* restrict around = along + out_count;
  __global float* restrict out = around + out_count;
  const int patch_index = lattice_rows[4 * k], row = lattice_rows[4 * k + 1];
  __global const PatchRecord* restrict patch = patches + patch_index;
  const int width = patch->width;
  const int texel = (patch->y + row) * texture_width + patch->x;
  const float axial = rows[patch->row_begin + row].axial;
  const float eased = axial * axial * (3.0f - 2.0f * axial);
  const float near_head = fmax(0.0f, 1.0f - axial / END_REACH),
              near_tail = fmax(0.0f, 1.0f - (1.0f - axial) / END_REACH);
  const float head_share = (1.0f - eased) * near_head * near_head * (3.0f - 2.0f * near_head),
              even_head_share = 1.0f - eased - head_share;
  const float tail_share = eased * near_tail * near_tail * (3.0f - 2.0f * near_tail),
              even_tail_share = eased - tail_share;
  __global const ColumnRecord* restrict slopes = result_columns + patch->column_begin;
  const int first = get_local_id(0), step = get_local_size(0);

  for (int i = 0; i < source_count; ++i) {
    __global const BlendSource* restrict source = sources + i * patch_count + patch_index;
    const float weight = source_rows[i * row_count + k].weight, from_row = source_rows[i * row_count + k].row;
    const int source_width = source->width, stride = source->stride;
    const int below = clamp((int)from_row, 0, source->height - 2);
    const float above_share = from_row - (float)below;
    const float w_above = weight * above_share, w_below = weight * (1.0f - above_share);
    const float sign = source->sign;
    const float period = (float)source_width, frequency = 1.0f / period;
    const int begin = source->begin + below * stride;
    __global const BlendColumn* restrict places = columns + source->column_begin;
    const int turns_texels = source->slope_begin >= 0;
    __global const float* restrict source_slope = source_slopes + (turns_texels ? 2 * source->slope_begin : 0);

    for (int j = first; j < width; j += step) {
      __global const BlendColumn* restrict place = places + j;
      const float at_head = place->head;
      const float lifted = at_head + even_head_share * (place->even_head - at_head) +
                           tail_share * (place->tail - at_head) + even_tail_share * (place->even_tail - at_head);
      const float column = lifted - period * floor(lifted * frequency);
      const int left_any = (int)column;
      const float right_share = column - (float)left_any;
      const int left = left_any >= source_width ? left_any - source_width : left_any;
      const int right = left + 1 < source_width ? left + 1 : 0;
      const float left_share = 1.0f - right_share;
      const float w00 = w_below * left_share, w01 = w_below * right_share, w10 = w_above * left_share,
                  w11 = w_above * right_share;
      const int a = begin + left, b = begin + right, c = a + stride, d = b + stride;
      const float a_sum = sign * (w00 * in_along[a] + w01 * in_along[b] + w10 * in_along[c] + w11 * in_along[d]);
      const float read_around =
          sign * (w00 * in_around[a] + w01 * in_around[b] + w10 * in_around[c] + w11 * in_around[d]);
      const float o_sum = w00 * in_out[a] + w01 * in_out[b] + w10 * in_out[c] + w11 * in_out[d];
      // From the frame of slope k to that of `slope`: by the angle between (1, k) and (1, slope), where it is no
      // rounding.
      const float slope = slopes[j].slope_head + axial * (slopes[j].slope_tail - slopes[j].slope_head);
      const int l = turns_texels ? 2 * left : 0, r = turns_texels ? 2 * right : 0;
      const float own_head = left_share * source_slope[l] + right_share * source_slope[r];
      const float own_tail = left_share * source_slope[l + 1] + right_share * source_slope[r + 1];
      const float k = own_head + axial * (own_tail - own_head) + head_share * place->head_rise +
                      even_head_share * place->even_head_rise + tail_share * place->tail_rise +
                      even_tail_share * place->even_tail_rise;
      const float square = 1.0f + slope * slope;
      const int is_turned = turns_texels && fabs(k - slope) > 1e-5f * square;
      const float inverse = 1.0f / sqrt(square * (1.0f + k * k));
      const float cosine = is_turned ? (1.0f + slope * k) * inverse : 1.0f,
                  sine = is_turned ? (k - slope) * inverse : 0.0f;
      const float read_along = cosine * a_sum + sine * o_sum, read_out = cosine * o_sum - sine * a_sum;
      along[texel + j] = i == 0 ? read_along : along[texel + j] + read_along;
      around[texel + j] = i == 0 ? read_around : around[texel + j] + read_around;
      out[texel + j] = i == 0 ? read_out : out[texel + j] + read_out;
    }
  }
}

// Adds to the texels what rows miss at their ends, fading out along the bone.
// moves: six planes of column_count floats, columns of all patches: along, around, out at the head, then at the tail
// NDRange: rows, as above.
__kernel void move_ends(const int row_count, const int texture_width, const int column_count,
                        __global const int* restrict lattice_rows, __global const PatchRecord* restrict patches,
                        __global const RowRecord* restrict rows, __global const float* restrict moves,
                        const int texel_count, __global float* restrict texels) {
  const int k = get_group_id(0);
  if (k >= row_count) return;
  __global float* restrict along = texels;
  __global float* restrict around = along + texel_count;
  __global float* restrict out = around + texel_count;
  __global const PatchRecord* restrict patch = patches + lattice_rows[4 * k];
  const int row = lattice_rows[4 * k + 1], texel = (patch->y + row) * texture_width + patch->x;
  const float u = rows[patch->row_begin + row].u;
  const float to_head = fmax(0.0f, 1.0f - u / END_REACH), to_tail = fmax(0.0f, 1.0f - (1.0f - u) / END_REACH);
  const float at_head = to_head * to_head * (3.0f - 2.0f * to_head),
              at_tail = to_tail * to_tail * (3.0f - 2.0f * to_tail);
  __global const float* restrict head = moves + patch->column_begin;
  __global const float* restrict tail = head + 3 * column_count;
  for (int j = get_local_id(0); j < patch->width; j += get_local_size(0)) {
    along[texel + j] += at_head * head[j] + at_tail * tail[j];
    around[texel + j] += at_head * head[column_count + j] + at_tail * tail[column_count + j];
    out[texel + j] += at_head * head[2 * column_count + j] + at_tail * tail[2 * column_count + j];
  }
}

// Texels between those of two textures of one layout, at the same place. At shares of 0 and 1 they are those of the one
// texture bit by bit, the sign of zeros included. NDRange: one work-group per row of the texture, of any size.
static float mixed(const float first, const float second, const float share) {
  const float between = (1.0f - share) * first + share * second;
  return share == 0.0f ? first : share == 1.0f ? second : between;
}

__kernel void mix_texels(const int height, const int width, const float share, __global const float* restrict first,
                         __global const float* restrict second, __global float* restrict texels) {
  const int row = get_group_id(0);
  if (row >= height) return;
  const int count = height * width;
  __global const float* restrict first_along = first;
  __global const float* restrict first_around = first_along + count;
  __global const float* restrict first_out = first_around + count;
  __global const float* restrict second_along = second;
  __global const float* restrict second_around = second_along + count;
  __global const float* restrict second_out = second_around + count;
  __global float* restrict along = texels;
  __global float* restrict around = along + count;
  __global float* restrict out = around + count;
  const int begin = row * width, end = begin + width, step = get_local_size(0);
  for (int i = begin + (int)get_local_id(0); i < end; i += step) {
    along[i] = mixed(first_along[i], second_along[i], share);
    around[i] = mixed(first_around[i], second_around[i], share);
    out[i] = mixed(first_out[i], second_out[i], share);
  }
}
