// SPDX-License-Identifier: MIT
// Points posed by the paper's rule (3.4, 3.6.1) at their own coordinates about their bone.
//
// Blocks, work-groups and work-items as in skin.cl: no work-item reads what another one writes, so no barriers are
// needed.
//   blocks                of inner vertices; their bones and weights are not read
//   patches, ends, arcs   tables of the bind pose or of the pose, by bone
//   coordinates           five planes of point_count floats, of the points in the bind pose:
//     angle, distance, height   cylinder coordinates about their bone: radians in [0, 2 pi), from the axis, and along
//                               the axis from the head
//     slope_head, slope_tail    of the bind pose's separation planes at that angle
#include "capsule.h"
#include "planes.h"
#include "pose_math.h"
#include "reconstruct_structs.h"
#include "skeletex_structs.h"

// What the arcs around a bone's end give to each vertex of a block: the roll, and the two parts of the slope.
//   loop  3 * SKIN_BLOCK floats
__attribute__((always_inline)) void read_arcs(const int item, const int count, const int arc_count,
                                              __global const PosedArcRecord* restrict arcs,
                                              __global const float* restrict angle, __local float* restrict loop) {
  for (int k = 0; k < arc_count; ++k) {
    const float begin = arcs[k].begin, roll = arcs[k].roll, rate = arcs[k].rate;
    const float slope_s = arcs[k].slope_s, slope_b = arcs[k].slope_b;
    for (int i = item; i < count; i += ROW_ITEMS) {
      const int is_here = k == 0 || angle[i] >= begin;
      loop[i] = is_here ? roll + rate * (angle[i] - begin) : loop[i];
      loop[SKIN_BLOCK + i] = is_here ? slope_s : loop[SKIN_BLOCK + i];
      loop[2 * SKIN_BLOCK + i] = is_here ? slope_b : loop[2 * SKIN_BLOCK + i];
    }
  }
}

// The coordinates of points in the bind pose.
//   points   planes x, y, z, relative to the origin of the patch records
//   loops    6 * SKIN_BLOCK floats
__kernel void bone_coordinates(const BlockParameters p, __global const SkinBlock* restrict blocks,
                               __global const PatchRecord* restrict patches,
                               __global const PosedEndsRecord* restrict ends,
                               __global const PosedArcRecord* restrict arcs, __global const float* restrict points,
                               __global float* restrict coordinates, __local float* restrict loops) {
  const int group = get_group_id(0);
  if (group >= p.block_count) return;
  PLANES(global const float, x, y, z, points, p.point_count);
  PLANES(global float, angle, distance, height, coordinates, p.point_count);
  __global float* restrict slope_head = height + p.point_count;
  __global float* restrict slope_tail = slope_head + p.point_count;
  const int vertex = blocks[group].first_vertex, count = blocks[group].vertex_count, bone = blocks[group].bone;
  __global const PatchRecord* restrict patch = patches + bone;
  __local float* restrict tail = loops + 3 * SKIN_BLOCK;
  const int item = get_local_id(0);

  for (int i = vertex + item; i < vertex + count; i += ROW_ITEMS) {
    const float p_x = x[i] - patch->head[0], p_y = y[i] - patch->head[1], p_z = z[i] - patch->head[2];
    const float p_s = p_x * patch->s[0] + p_y * patch->s[1] + p_z * patch->s[2];
    const float p_b = p_x * patch->b[0] + p_y * patch->b[1] + p_z * patch->b[2];
    const float turned = atan2(p_b, p_s);
    angle[i] = turned < 0.0f ? turned + 6.2831853f : turned;
    distance[i] = sqrt(p_s * p_s + p_b * p_b);
    height[i] = p_x * patch->axis[0] + p_y * patch->axis[1] + p_z * patch->axis[2];
  }
  read_arcs(item, count, ends[bone].arc_count[0], arcs + ends[bone].first_arc[0], angle + vertex, loops);
  read_arcs(item, count, ends[bone].arc_count[1], arcs + ends[bone].first_arc[1], angle + vertex, tail);
  for (int i = item; i < count; i += ROW_ITEMS) {
    float sine, cosine;
    SIN_COS(angle[vertex + i], sine, cosine);
    slope_head[vertex + i] = loops[SKIN_BLOCK + i] * cosine + loops[2 * SKIN_BLOCK + i] * sine;
    slope_tail[vertex + i] = tail[SKIN_BLOCK + i] * cosine + tail[2 * SKIN_BLOCK + i] * sine;
  }
}

// Points with these coordinates in a pose. They are moved as SPD's texels are: their axial parameter is that of the
// foot from which SPD's ray leads to the point in the bind pose, the ray turns with the frame there, and the point's
// distance from the bone is restored.
//   bind_patches   for their lengths
//   points         planes x, y, z, relative to the origin of the posed patch records
//   loops          6 * SKIN_BLOCK floats
__kernel void pose_by_coordinates(const BlockParameters p, __global const SkinBlock* restrict blocks,
                                  __global const PatchRecord* restrict bind_patches,
                                  __global const PatchRecord* restrict patches,
                                  __global const PosedEndsRecord* restrict ends,
                                  __global const PosedArcRecord* restrict arcs,
                                  __global const float* restrict coordinates, __global float* restrict points,
                                  __local float* restrict loops) {
  const int group = get_group_id(0);
  if (group >= p.block_count) return;
  PLANES(global const float, angle, distance, height, coordinates, p.point_count);
  __global const float* restrict slope_head = height + p.point_count;
  __global const float* restrict slope_tail = slope_head + p.point_count;
  PLANES(global float, x, y, z, points, p.point_count);
  const int vertex = blocks[group].first_vertex, count = blocks[group].vertex_count, bone = blocks[group].bone;
  __global const PatchRecord* restrict patch = patches + bone;
  const float head_x = patch->head[0], head_y = patch->head[1], head_z = patch->head[2];
  const float s_x = patch->s[0], s_y = patch->s[1], s_z = patch->s[2];
  const float b_x = patch->b[0], b_y = patch->b[1], b_z = patch->b[2];
  const float o_x = patch->axis[0], o_y = patch->axis[1], o_z = patch->axis[2];
  const float bind_length = bind_patches[bone].length, length = patch->length;
  const float bind_extension_head = ends[bone].bind_extension[0], bind_extension_tail = ends[bone].bind_extension[1];
  const float extension_head = ends[bone].extension[0], extension_tail = ends[bone].extension[1];
  __local float* restrict tail = loops + 3 * SKIN_BLOCK;
  const int item = get_local_id(0);
  read_arcs(item, count, ends[bone].arc_count[0], arcs + ends[bone].first_arc[0], angle + vertex, loops);
  read_arcs(item, count, ends[bone].arc_count[1], arcs + ends[bone].first_arc[1], angle + vertex, tail);

  for (int i = item; i < count; i += ROW_ITEMS) {
    const int at = vertex + i;
    const float turned = angle[at], across = distance[at], along = height[at];
    const float bind_slope_head = slope_head[at], bind_slope_tail = slope_tail[at];

    // Along the bone from the head's separation plane, and to the tail's. Where the planes have crossed in between, the
    // point is beyond both, and the nearer it is to the head, the smaller its axial parameter still is. Beyond one
    // plane or past a free end it is that end's.
    const float from_head = along - across * bind_slope_head;
    const float to_tail = bind_length + across * bind_slope_tail - along;
    const float before = fmax(0.0f, from_head) + fmax(0.0f, -to_tail);
    const float after = fmax(0.0f, to_tail) + fmax(0.0f, -from_head);
    const float axial = before > 0.0f ? before / (before + after) : 0.0f;
    const float eased = EASED(axial);

    const float roll_head = loops[i], roll_tail = tail[i];
    float sine, cosine;
    SIN_COS(turned + roll_head, sine, cosine);
    const float change_head = loops[SKIN_BLOCK + i] * cosine + loops[2 * SKIN_BLOCK + i] * sine - bind_slope_head;
    SIN_COS(turned + roll_tail, sine, cosine);
    const float change_tail = tail[SKIN_BLOCK + i] * cosine + tail[2 * SKIN_BLOCK + i] * sine - bind_slope_tail;
    const float bind_slope = bind_slope_head + axial * (bind_slope_tail - bind_slope_head);
    const float change = change_head + eased * (change_tail - change_head);
    const float slope = bind_slope + change;

    // The ray from the foot in the plane of the bone and the point, turned from the bind pose's frame to the posed one.
    const float ray = along - axial * bind_length;
    const float turn_cosine = 1.0f + bind_slope * slope;
    const float scale = 1.0f / sqrt((1.0f + bind_slope * bind_slope) * (1.0f + slope * slope));
    const float q_s = (across * turn_cosine - ray * change) * scale;
    const float q_o = (across * change + ray * turn_cosine) * scale;

    // Where it leaves the capsule, in ray lengths. Near seams both capsules extend past the bone's ends (PosedRow).
    const float near_head = fmax(0.0f, 1.0f - axial / POSED_SEAM_SHARE),
                near_tail = fmax(0.0f, 1.0f - (1.0f - axial) / POSED_SEAM_SHARE);
    const float share_head = near_tail * near_tail, share_tail = near_head * near_head;
    const float past = fmax(
        0.0f, fmax(-share_head * bind_extension_head - along, along - bind_length - share_tail * bind_extension_tail));
    const float e2 = across * across + ray * ray;
    const float e2_inverse = e2 > 0.0f ? 1.0f / e2 : 0.0f;
    const float radius2 = (across * across + past * past) * e2_inverse;
    const float foot = axial * length;
    const float m_capsule =
        leave_capsule_of_radius(q_o, q_s * q_s * e2_inverse, e2_inverse, foot + share_head * extension_head,
                                length - foot + share_tail * extension_tail, radius2);
    const float m = p.is_distance_kept ? (e2 > 0.0f ? m_capsule : 0.0f) : 1.0f;

    SIN_COS(turned + roll_head + eased * (roll_tail - roll_head), sine, cosine);
    const float p_s = m * q_s * cosine;
    const float p_b = m * q_s * sine;
    const float p_o = foot + m * q_o;
    x[at] = head_x + p_s * s_x + p_b * b_x + p_o * o_x;
    y[at] = head_y + p_s * s_y + p_b * b_y + p_o * o_y;
    z[at] = head_z + p_s * s_z + p_b * b_z + p_o * o_z;
  }
}
