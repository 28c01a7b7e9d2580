// SPDX-License-Identifier: MIT
// From texels to surface points in a pose (paper 3.4, 3.6.1, appendix A): kernel displace of reconstruct.cl with a roll
// about the bone, the posed separation planes' slopes and the posed bones.
//
// Rows and launches as in reconstruct.cl: a table of lattice rows, four ints each (patch, row, number of its first
// vertex, unused), one work-group per row, work-items take columns in turn, plain scalars and selects so that the loop
// over columns becomes vector instructions on a CPU.
// In:   rows, bind_columns: tables of the bind pose; columns as four planes: cosine, sine, slope_head, slope_tail.
//       patches, posed_rows, columns: tables of the pose; columns as four planes: roll_head, roll_tail, slope_head,
//       slope_tail.
//       texels: planes along, around, out.
// Out:  points: planes x, y, z, relative to the origin of the posed patch records.
#include "capsule.h"
#include "planes.h"
#include "pose_math.h"
#include "reconstruct_structs.h"
#include "skeletex_structs.h"

// Rows whose capsule is the bone's own. The texel's length is its distance from the bone; see displace for the rest.
__kernel void displace_posed(const DisplaceParameters p, __global const int* restrict lattice_rows,
                             __global const RowRecord* restrict rows, __global const float* restrict bind_columns,
                             __global const PatchRecord* restrict patches, __global const float* restrict columns,
                             __global const float* restrict texels, __global float* restrict points) {
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
  const float eased = EASED(axial), ahead = axial - eased;
  const float foot = axial * patch->length, foot_to_tail = patch->length - foot;
  PLANES(global const float, cosines, sines, bind_head_slopes, bind_columns + patch->column_begin, p.column_count);
  __global const float* restrict bind_tail_slopes = bind_head_slopes + p.column_count;
  PLANES(global const float, head_rolls, tail_rolls, head_slopes, columns + patch->column_begin, p.column_count);
  __global const float* restrict tail_slopes = head_slopes + p.column_count;

  const int step = get_local_size(0);
  for (int j = get_local_id(0); j < width; j += step) {
    const float a = along[texel + j], c = around[texel + j], w = out[texel + j];
    const float roll = head_rolls[j] + eased * (tail_rolls[j] - head_rolls[j]);
    float roll_sine, roll_cosine;
    SIN_COS(roll, roll_sine, roll_cosine);
    const float cosine = cosines[j] * roll_cosine - sines[j] * roll_sine;
    const float sine = sines[j] * roll_cosine + cosines[j] * roll_sine;

    const float slope = head_slopes[j] + eased * (tail_slopes[j] - head_slopes[j]) +
                        ahead * (bind_tail_slopes[j] - bind_head_slopes[j]);
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

// Any rows. The bind pose's point is restored first. Near seams the capsule extends past the bone's ends, in the bind
// pose and in this one alike (PosedRowRecord), and its radius is the bind point's distance from the extended bone. With
// is_distance_kept = 0 the point keeps its distance from the foot instead.
__kernel void displace_posed_from_bind(const DisplaceParameters p, __global const int* restrict lattice_rows,
                                       __global const RowRecord* restrict rows,
                                       __global const float* restrict bind_columns,
                                       __global const PatchRecord* restrict patches,
                                       __global const PosedRowRecord* restrict posed_rows,
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
  const float eased = EASED(axial), ahead = axial - eased;
  __global const PosedRowRecord* restrict posed_row = posed_rows + patch->row_begin + row;
  const float bind_length = posed_row->bind_length;
  const float bind_foot = axial * bind_length, bind_foot_to_tail = bind_length - bind_foot;
  const float lowest = -posed_row->bind_extension_head, highest = bind_length + posed_row->bind_extension_tail;
  const float foot = axial * patch->length;
  const float foot_to_lower = foot + posed_row->extension_head,
              foot_to_upper = patch->length + posed_row->extension_tail - foot;
  PLANES(global const float, cosines, sines, bind_head_slopes, bind_columns + patch->column_begin, p.column_count);
  __global const float* restrict bind_tail_slopes = bind_head_slopes + p.column_count;
  PLANES(global const float, head_rolls, tail_rolls, head_slopes, columns + patch->column_begin, p.column_count);
  __global const float* restrict tail_slopes = head_slopes + p.column_count;

  const int step = get_local_size(0);
  for (int j = get_local_id(0); j < width; j += step) {
    const float a = along[texel + j], c = around[texel + j], w = out[texel + j];
    const float c2 = c * c;
    const float e2 = a * a + c2 + w * w;
    const float e2_inverse = e2 > 0.0f ? 1.0f / e2 : 0.0f;

    // The bind point: bind_m times the texel from the bind foot.
    const float bind_slope = bind_head_slopes[j] + axial * (bind_tail_slopes[j] - bind_head_slopes[j]);
    const float bind_f_o = cap_cos * bind_slope + cap_sin;
    const float bind_f_inverse = 1.0f / sqrt(cap_cos * cap_cos + bind_f_o * bind_f_o);
    const float bind_q_s = (w * cap_cos - a * bind_f_o) * bind_f_inverse;
    const float bind_q_o = (w * bind_f_o + a * cap_cos) * bind_f_inverse;
    const float bind_across2 = bind_q_s * bind_q_s + c2;
    const float bind_m =
        leave_capsule_of_radius(bind_q_o, bind_across2 * e2_inverse, e2_inverse, bind_foot, bind_foot_to_tail, 1.0f);

    // The radius, squared, in units of e^2.
    const float bind_z = bind_foot + bind_m * bind_q_o;
    const float past = fmax(0.0f, fmax(lowest - bind_z, bind_z - highest));
    const float g = (bind_m * bind_m * bind_across2 + past * past) * e2_inverse;

    const float slope = head_slopes[j] + eased * (tail_slopes[j] - head_slopes[j]) +
                        ahead * (bind_tail_slopes[j] - bind_head_slopes[j]);
    const float f_o = cap_cos * slope + cap_sin;
    const float f_inverse = 1.0f / sqrt(cap_cos * cap_cos + f_o * f_o);
    const float q_s = (w * cap_cos - a * f_o) * f_inverse;
    const float q_o = (w * f_o + a * cap_cos) * f_inverse;
    const float m_capsule =
        leave_capsule_of_radius(q_o, (q_s * q_s + c2) * e2_inverse, e2_inverse, foot_to_lower, foot_to_upper, g);
    const float m_any = p.is_distance_kept ? m_capsule : bind_m;
    const float m = e2 > 0.0f ? m_any : 0.0f;

    const float roll = head_rolls[j] + eased * (tail_rolls[j] - head_rolls[j]);
    float roll_sine, roll_cosine;
    SIN_COS(roll, roll_sine, roll_cosine);
    const float cosine = cosines[j] * roll_cosine - sines[j] * roll_sine;
    const float sine = sines[j] * roll_cosine + cosines[j] * roll_sine;
    const float p_s = m * (q_s * cosine - c * sine);
    const float p_b = m * (q_s * sine + c * cosine);
    const float p_o = foot + m * q_o;
    x[vertex + j] = head_x + p_s * s_x + p_b * b_x + p_o * o_x;
    y[vertex + j] = head_y + p_s * s_y + p_b * b_y + p_o * o_y;
    z[vertex + j] = head_z + p_s * s_z + p_b * b_z + p_o * o_z;
  }
}
