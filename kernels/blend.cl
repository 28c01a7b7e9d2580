// SPDX-License-Identifier: MIT
// Texels as weighted sums of the texels of other textures, each read at a place of its own: morphs and transfers (paper
// 5).
//
// in   rows: the rows to do. sources: per source and patch [source * patch_count + patch]
//      source_rows: per source and row to do [source * row_count + k]
//      columns: per source and column of the result. Between head and tail the column that is read, and the rise of the
//      slopes, run along the curve of poses (EASED in pose_math.h), so that a difference at one end does not bend the
//      surface at the other. Differences that vary around the bone, at corners, fade out within END_RANGE of their end.
//      source_slopes: pairs per column of a source: the slopes of the separation planes at head and tail, in the
//      direction of the result's bone. A texel is turned from the slope of its frame in the source, plus the rise, to
//      the slope of the result's frame.
//      result_columns: of the result
//      texels: planes along, around, out of all sources
// out  blended: planes along, around, out of the result's texture
// NDRange: one work-group of any size per row, whose work-items take columns in turn. One work-item does a column of
// the result for all sources, so sums need no barrier and have a fixed order. Reads are linear between the four texels
// around. At a texel's own place the result is exactly weight * texel.
#include "blend_structs.h"
#include "planes.h"
#include "pose_math.h"
#include "skeletex_structs.h"

// The part of a bone, from one of its ends, where corners at that end have an effect.
#define END_RANGE 0.3f

__kernel void blend_texels(const BlendParameters blend, __global const BlendRow* restrict rows,
                           __global const BlendSource* restrict sources,
                           __global const BlendSourceRow* restrict source_rows,
                           __global const BlendColumn* restrict columns, __global const float* restrict source_slopes,
                           __global const ColumnRecord* restrict result_columns, __global const float* restrict texels,
                           __global float* restrict blended) {
  const int k = get_group_id(0);
  if (k >= blend.row_count) return;
  PLANES(global const float, in_along, in_around, in_out, texels, blend.texel_count);
  PLANES(global float, along, around, out, blended, blend.blended_count);
  const int width = rows[k].width, texel = rows[k].texel;
  const float axial = rows[k].axial, eased = EASED(axial);
  const float near_head = fmax(0.0f, 1.0f - axial / END_RANGE),
              near_tail = fmax(0.0f, 1.0f - (1.0f - axial) / END_RANGE);
  const float head_share = (1.0f - eased) * near_head * near_head * (3.0f - 2.0f * near_head),
              even_head_share = 1.0f - eased - head_share;
  const float tail_share = eased * near_tail * near_tail * (3.0f - 2.0f * near_tail),
              even_tail_share = eased - tail_share;
  __global const ColumnRecord* restrict slopes = result_columns + rows[k].column_begin;
  const int first = get_local_id(0), step = get_local_size(0);

  for (int i = 0; i < blend.source_count; ++i) {
    __global const BlendSource* restrict source = sources + i * blend.patch_count + rows[k].patch;
    const float weight = source_rows[i * blend.row_count + k].weight,
                from_row = source_rows[i * blend.row_count + k].row;
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
      // From the frame of slope k to that of `slope`, by the angle between (1, k) and (1, slope), unless it is
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

// Adds the moves of the rows at the ends to all texels, fading out along the bone.
// moves: six planes over the columns of all patches: along, around, out at the head, then at the tail
// NDRange: as above.
__kernel void move_ends(const MoveEndsParameters ends, __global const BlendRow* restrict rows,
                        __global const float* restrict moves, __global float* restrict texels) {
  const int k = get_group_id(0), column_count = ends.column_count;
  if (k >= ends.row_count) return;
  PLANES(global float, along, around, out, texels, ends.texel_count);
  const int texel = rows[k].texel, width = rows[k].width;
  const float u = rows[k].u;
  const float to_head = fmax(0.0f, 1.0f - u / END_RANGE), to_tail = fmax(0.0f, 1.0f - (1.0f - u) / END_RANGE);
  const float at_head = EASED(to_head), at_tail = EASED(to_tail);
  __global const float* restrict head = moves + rows[k].column_begin;
  __global const float* restrict tail = head + 3 * column_count;
  for (int j = get_local_id(0); j < width; j += get_local_size(0)) {
    along[texel + j] += at_head * head[j] + at_tail * tail[j];
    around[texel + j] += at_head * head[column_count + j] + at_tail * tail[column_count + j];
    out[texel + j] += at_head * head[2 * column_count + j] + at_tail * tail[2 * column_count + j];
  }
}

// Linear interpolation. Shares of 0 and 1 give the very bits of the first and the second value.
static float mixed(const float first, const float second, const float share) {
  const float between = (1.0f - share) * first + share * second;
  return share == 0.0f ? first : share == 1.0f ? second : between;
}

// Linear interpolation between the texels of two textures of one layout.
// NDRange: one work-group of any size per row of the texture.
__kernel void mix_texels(const MixParameters mix, __global const float* restrict first,
                         __global const float* restrict second, __global float* restrict texels) {
  const int row = get_group_id(0), count = mix.height * mix.width;
  if (row >= mix.height) return;
  PLANES(global const float, first_along, first_around, first_out, first, count);
  PLANES(global const float, second_along, second_around, second_out, second, count);
  PLANES(global float, along, around, out, texels, count);
  const int begin = row * mix.width, end = begin + mix.width, step = get_local_size(0);
  for (int i = begin + (int)get_local_id(0); i < end; i += step) {
    along[i] = mixed(first_along[i], second_along[i], mix.share);
    around[i] = mixed(first_around[i], second_around[i], mix.share);
    out[i] = mixed(first_out[i], second_out[i], mix.share);
  }
}
