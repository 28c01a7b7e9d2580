// SPDX-License-Identifier: MIT
// Smooth posing: the weights of bones, and bind points moved by blended dual quaternions.
//
// One work-group per block of at most SKIN_BLOCK vertices of a patch (SkinBlock). Work-items take vertices in turn, ROW_ITEMS apart, so
// that neighbours touch neighbouring vertices; on a CPU groups of one, where the inner loop becomes vector instructions. Every
// work-item reads and writes only its own vertices, so no barriers are needed.
#include "skeletex_structs.h"
#include "skin_weight.h"

// The weights of the bones that the walk from each block's own bone leads to (see WeightWalks), those that are 0 included:
// those of step k of block b from (b * slots + k) * SKIN_BLOCK on, k = 0 the own bone. A step to a bone that an earlier step leads to has none.
//   first_block  the number of the block that the first group works on
//   x, y, z      points in the bind pose, relative to the model's origin
__kernel void bone_weights(const int block_count, const int first_block, const int slots, __global const SkinBlock* restrict blocks,
                           __global const int* restrict first_steps, __global const WeightStep* restrict steps, __global const float* restrict x,
                           __global const float* restrict y, __global const float* restrict z, __global float* restrict weights) {
  const int group = get_group_id(0);
  if (group >= block_count) return;
  __global const SkinBlock* restrict block = blocks + first_block + group;
  const int vertex = block->first_vertex, count = block->vertex_count;
  const int first_step = first_steps[block->bone], step_count = first_steps[block->bone + 1] - first_step;
  __global float* restrict own = weights + (size_t)group * slots * SKIN_BLOCK;
  const int item = get_local_id(0);

  for (int i = item; i < count; i += ROW_ITEMS) own[i] = 0.0f;
  for (int k = 0; k < step_count; ++k) {
    __global const WeightStep* restrict step = steps + first_step + k;
    const float normal_x = step->normal[0], normal_y = step->normal[1], normal_z = step->normal[2];
    const float joint_x = step->joint[0], joint_y = step->joint[1], joint_z = step->joint[2];
    const float reach = step->reach, girth_inverse = step->girth_inverse;
    __global const float* restrict before = own + (step->before + 1) * SKIN_BLOCK;
    __global float* restrict here = own + (k + 1) * SKIN_BLOCK;
    for (int i = item; i < count; i += ROW_ITEMS) {
      const float from_x = x[vertex + i] - joint_x, from_y = y[vertex + i] - joint_y, from_z = z[vertex + i] - joint_z;
      const float height = from_x * normal_x + from_y * normal_y + from_z * normal_z;
      const float excess = fmax(0.0f, sqrt(from_x * from_x + from_y * from_y + from_z * from_z) - reach) * girth_inverse;
      here[i] = before[i] + SKIN_CROSSING(height, excess);
    }
  }
  // Potentials to weights, with sum 1. A bone that several ways lead to takes the nearest.
  for (int i = item; i < count; i += ROW_ITEMS) {
    float lowest = 0.0f;
    for (int k = 0; k < step_count; ++k) {
      const int same = steps[first_step + k].same;
      const float potential = own[(k + 1) * SKIN_BLOCK + i];
      lowest = fmin(lowest, potential);
      if (same >= 0) {
        const int at = (same + 1) * SKIN_BLOCK + i;
        own[at] = fmin(own[at], potential);
        own[(k + 1) * SKIN_BLOCK + i] = INFINITY;
      }
    }
    float sum = 0.0f;
    for (int k = 0; k <= step_count; ++k) {
      const float weight = fmax(0.0f, exp(lowest - own[k * SKIN_BLOCK + i]) - SKIN_CUT);
      own[k * SKIN_BLOCK + i] = weight;
      sum += weight;
    }
    for (int k = 0; k <= step_count; ++k) own[k * SKIN_BLOCK + i] /= sum;
  }
}

// Bind points moved by the blend of their bones' motions (Kavan et al. 2008).
//   block_bones, weights          as SkinBlock says
//   motions                       per bone
//   bind_x, bind_y, bind_z        points in the bind pose, relative to the model's origin
//   x, y, z                       points in the pose, relative to the pose's origin
//   is_stretched                  0 where no bone changes its length
//   sums                          11 * SKIN_BLOCK floats
__kernel void skin(const int block_count, const int is_stretched, __global const SkinBlock* restrict blocks, __global const int* restrict block_bones,
                   __global const float* restrict weights, __global const BoneMotionRecord* restrict motions, __global const float* restrict bind_x,
                   __global const float* restrict bind_y, __global const float* restrict bind_z, __global float* restrict x, __global float* restrict y,
                   __global float* restrict z, __local float* restrict sums) {
  const int group = get_group_id(0);
  if (group >= block_count) return;
  __global const SkinBlock* restrict block = blocks + group;
  const int vertex = block->first_vertex, count = block->vertex_count, bone_count = block->bone_count;
  __global const float* restrict block_weights = weights + block->first_weight;
  const int item = get_local_id(0);

  for (int k = 0; k < bone_count; ++k) {
    __global const BoneMotionRecord* restrict motion = motions + block_bones[block->first_bone + k];
    __global const float* restrict w = block_weights + k * SKIN_BLOCK;
    // Components one after the other, so that each loop is a plain multiply-add over the block.
    for (int c = 0; c < 8; ++c) {
      const float value = c < 4 ? motion->real[c] : motion->dual[c - 4];
      __local float* restrict sum = sums + c * SKIN_BLOCK;
      if (k == 0)
        for (int i = item; i < count; i += ROW_ITEMS) sum[i] = w[i] * value;
      else
        for (int i = item; i < count; i += ROW_ITEMS) sum[i] += w[i] * value;
    }
    if (is_stretched) {
      const float head_x = motion->head[0], head_y = motion->head[1], head_z = motion->head[2];
      const float axis_x = motion->axis[0], axis_y = motion->axis[1], axis_z = motion->axis[2];
      const float stretch_x = motion->stretch[0], stretch_y = motion->stretch[1], stretch_z = motion->stretch[2];
      __local float* restrict sum = sums + 8 * SKIN_BLOCK;
      for (int i = item; i < count; i += ROW_ITEMS) {
        const float along = (bind_x[vertex + i] - head_x) * axis_x + (bind_y[vertex + i] - head_y) * axis_y + (bind_z[vertex + i] - head_z) * axis_z;
        const float share = w[i] * clamp(along, 0.0f, 1.0f);
        sum[i] = (k == 0 ? 0.0f : sum[i]) + share * stretch_x;
        sum[SKIN_BLOCK + i] = (k == 0 ? 0.0f : sum[SKIN_BLOCK + i]) + share * stretch_y;
        sum[2 * SKIN_BLOCK + i] = (k == 0 ? 0.0f : sum[2 * SKIN_BLOCK + i]) + share * stretch_z;
      }
    }
  }

  for (int i = item; i < count; i += ROW_ITEMS) {
    const float w = sums[i], a = sums[SKIN_BLOCK + i], b = sums[2 * SKIN_BLOCK + i], c = sums[3 * SKIN_BLOCK + i];
    const float dual_w = sums[4 * SKIN_BLOCK + i], dual_a = sums[5 * SKIN_BLOCK + i];
    const float dual_b = sums[6 * SKIN_BLOCK + i], dual_c = sums[7 * SKIN_BLOCK + i];
    // 2 / |q|^2 in place of dividing both parts by |q|.
    const float scale = 2.0f / (w * w + a * a + b * b + c * c);
    const float p_x = bind_x[vertex + i], p_y = bind_y[vertex + i], p_z = bind_z[vertex + i];
    // p + 2 v x (v x p + w p), and the translation 2 (w d - dual_w v + v x d).
    const float t_x = b * p_z - c * p_y + w * p_x + dual_a, t_y = c * p_x - a * p_z + w * p_y + dual_b, t_z = a * p_y - b * p_x + w * p_z + dual_c;
    x[vertex + i] = p_x + scale * (b * t_z - c * t_y + w * dual_a - dual_w * a);
    y[vertex + i] = p_y + scale * (c * t_x - a * t_z + w * dual_b - dual_w * b);
    z[vertex + i] = p_z + scale * (a * t_y - b * t_x + w * dual_c - dual_w * c);
  }
  if (is_stretched)
    for (int i = item; i < count; i += ROW_ITEMS) {
      x[vertex + i] += sums[8 * SKIN_BLOCK + i];
      y[vertex + i] += sums[9 * SKIN_BLOCK + i];
      z[vertex + i] += sums[10 * SKIN_BLOCK + i];
    }
}
