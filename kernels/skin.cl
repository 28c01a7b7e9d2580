// SPDX-License-Identifier: MIT
// Smooth posing: the weights of bones, and bind points moved by blended dual quaternions.
//
// One work-group per block of at most SKIN_BLOCK vertices of a patch (SkinBlock). Work-items take vertices in turn,
// ROW_ITEMS apart, so that neighbours touch neighbouring vertices; on a CPU groups of one, where the inner loop becomes
// vector instructions. Every work-item reads and writes only its own vertices, so no barriers are needed.
#include "planes.h"
#include "reconstruct_structs.h"
#include "skeletex_structs.h"
#include "skin_weight.h"

// The weights of the bones that the walk from each block's own bone leads to (see WeightWalks), those that are 0
// included: those of step k of block b from (b * slots + k) * SKIN_BLOCK on, k = 0 the own bone. A step to a bone that
// an earlier step leads to has none.
//   points   planes x, y, z in the bind pose, relative to the model's origin
__kernel void bone_weights(const BlockParameters p, __global const SkinBlock* restrict blocks,
                           __global const int* restrict first_steps, __global const WeightStep* restrict steps,
                           __global const float* restrict points, __global float* restrict weights) {
  const int group = get_group_id(0);
  if (group >= p.block_count) return;
  PLANES(global const float, x, y, z, points, p.point_count);
  __global const SkinBlock* restrict block = blocks + p.first_block + group;
  const int vertex = block->first_vertex, count = block->vertex_count;
  const int first_step = first_steps[block->bone], step_count = first_steps[block->bone + 1] - first_step;
  __global float* restrict own = weights + (size_t)group * p.slots * SKIN_BLOCK;
  const int item = get_local_id(0);

  for (int i = item; i < count; i += ROW_ITEMS) own[i] = 0.0f;
  for (int k = 0; k < step_count; ++k) {
    __global const WeightStep* restrict step = steps + first_step + k;
    const float normal_x = step->normal[0], normal_y = step->normal[1], normal_z = step->normal[2];
    const float joint_x = step->joint[0], joint_y = step->joint[1], joint_z = step->joint[2];
    const float seam_radius = step->seam_radius, girth_inverse = step->girth_inverse;
    __global const float* restrict before = own + (step->before + 1) * SKIN_BLOCK;
    __global float* restrict here = own + (k + 1) * SKIN_BLOCK;
    for (int i = item; i < count; i += ROW_ITEMS) {
      const float from_x = x[vertex + i] - joint_x, from_y = y[vertex + i] - joint_y, from_z = z[vertex + i] - joint_z;
      const float height = from_x * normal_x + from_y * normal_y + from_z * normal_z;
      const float excess =
          fmax(0.0f, sqrt(from_x * from_x + from_y * from_y + from_z * from_z) - seam_radius) * girth_inverse;
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

// Moves one vertex, or sixteen side by side, `i` places into a block. REAL is float or float16.
#define LOAD_1(from) (*(from))
#define STORE_1(value, to) *(to) = (value)
#define LOAD_16(from) vload16(0, from)
#define STORE_16(value, to) vstore16(value, 0, to)
#define MOVE_VERTICES(REAL, LOAD, STORE)                                                                           \
  {                                                                                                                \
    const REAL p_x = LOAD(bind_x + vertex + i), p_y = LOAD(bind_y + vertex + i), p_z = LOAD(bind_z + vertex + i);  \
    REAL w = 0.0f, a = 0.0f, b = 0.0f, c = 0.0f, dual_w = 0.0f, dual_a = 0.0f, dual_b = 0.0f, dual_c = 0.0f;       \
    REAL stretch_x = 0.0f, stretch_y = 0.0f, stretch_z = 0.0f;                                                     \
    for (int k = 0; k < bone_count; ++k) {                                                                         \
      __global const BoneMotionRecord* restrict motion = motions + bones[k];                                       \
      const REAL weight = LOAD(block_weights + k * SKIN_BLOCK + i);                                                \
      w += weight * motion->real[0], a += weight * motion->real[1], b += weight * motion->real[2],                 \
          c += weight * motion->real[3];                                                                           \
      dual_w += weight * motion->dual[0], dual_a += weight * motion->dual[1];                                      \
      dual_b += weight * motion->dual[2], dual_c += weight * motion->dual[3];                                      \
      if (is_stretched) {                                                                                          \
        const REAL along = (p_x - motion->head[0]) * motion->axis[0] + (p_y - motion->head[1]) * motion->axis[1] + \
                           (p_z - motion->head[2]) * motion->axis[2];                                              \
        const REAL share = weight * clamp(along, 0.0f, 1.0f);                                                      \
        stretch_x += share * motion->stretch[0], stretch_y += share * motion->stretch[1],                          \
            stretch_z += share * motion->stretch[2];                                                               \
      }                                                                                                            \
    }                                                                                                              \
    /* With the quaternion's vector part v: p + 2 (v x t + w d - dual_w v) / |q|^2, where t = v x p + w p + d. */  \
    const REAL scale = 2.0f / (w * w + a * a + b * b + c * c);                                                     \
    const REAL t_x = b * p_z - c * p_y + w * p_x + dual_a, t_y = c * p_x - a * p_z + w * p_y + dual_b;             \
    const REAL t_z = a * p_y - b * p_x + w * p_z + dual_c;                                                         \
    STORE(p_x + stretch_x + scale * (b * t_z - c * t_y + w * dual_a - dual_w * a), x + vertex + i);                \
    STORE(p_y + stretch_y + scale * (c * t_x - a * t_z + w * dual_b - dual_w * b), y + vertex + i);                \
    STORE(p_z + stretch_z + scale * (a * t_y - b * t_x + w * dual_c - dual_w * c), z + vertex + i);                \
  }

// Bind points moved by the blend of their bones' motions (Kavan et al. 2008).
//   block_bones, weights   as SkinBlock says
//   motions                per bone
//   bind_points            planes x, y, z in the bind pose, relative to the model's origin
//   points                 planes x, y, z in the pose, relative to the pose's origin
__kernel void skin(const BlockParameters p, __global const SkinBlock* restrict blocks,
                   __global const int* restrict block_bones, __global const float* restrict weights,
                   __global const BoneMotionRecord* restrict motions, __global const float* restrict bind_points,
                   __global float* restrict points) {
  const int group = get_group_id(0);
  if (group >= p.block_count) return;
  const int is_stretched = p.is_stretched;
  PLANES(global const float, bind_x, bind_y, bind_z, bind_points, p.point_count);
  PLANES(global float, x, y, z, points, p.point_count);
  __global const SkinBlock* restrict block = blocks + group;
  const int vertex = block->first_vertex, count = block->vertex_count, bone_count = block->bone_count;
  __global const int* restrict bones = block_bones + block->first_bone;
  __global const float* restrict block_weights = weights + block->first_weight;
#if ROW_ITEMS == 1
  // The last sixteen may be among those before: these are made twice, alike.
  if (count >= 16) {
    for (int begin = 0; begin < count; begin += 16) {
      const int i = min(begin, count - 16);
      MOVE_VERTICES(float16, LOAD_16, STORE_16)
    }
    return;
  }
#endif
  for (int i = get_local_id(0); i < count; i += ROW_ITEMS) MOVE_VERTICES(float, LOAD_1, STORE_1)
}
