// SPDX-License-Identifier: MIT
#version 450
// From texels to surface points in a pose (paper 3.4, 3.6): what kernels/pose.cl does, for any row, from a texture.
// Rows of the lattice: four ints each (patch, row, number of its first vertex, unused); patches: 19 words (PatchRecord);
// rows: u, axial parameter, cap_cos, cap_sin (RowRecord); posed_rows: five floats each (PosedRowRecord); columns as four planes, the
// bind pose's cosine, sine, slope_head, slope_tail and the pose's roll_head, roll_tail, slope_head, slope_tail.
// Dispatch: columns / 64 x rows. Out: three floats per vertex, relative to the origin of the posed patches.
layout(local_size_x = 64) in;
layout(binding = 0) uniform sampler2D texels;
layout(std430, binding = 0) writeonly buffer Positions { float positions[]; };
layout(std430, binding = 1) readonly buffer LatticeRows { ivec4 lattice_rows[]; };
layout(std430, binding = 2) readonly buffer Patches { float patches[]; };
layout(std430, binding = 3) readonly buffer Rows { vec4 rows[]; };
layout(std430, binding = 4) readonly buffer PosedRows { float posed_rows[]; };
layout(std430, binding = 5) readonly buffer BindColumns { float bind_columns[]; };
layout(std430, binding = 6) readonly buffer Columns { float columns[]; };
layout(location = 0) uniform int column_count;
layout(location = 1) uniform int is_distance_kept;
#include "capsule.h"

vec3 vector_at(int at) { return vec3(patches[at], patches[at + 1], patches[at + 2]); }

void main() {
  const ivec4 lattice_row = lattice_rows[gl_WorkGroupID.y];
  const int patch_at = 19 * lattice_row.x;
  const int j = int(gl_GlobalInvocationID.x);
  if (j >= floatBitsToInt(patches[patch_at + 15])) return;
  const int row = floatBitsToInt(patches[patch_at + 17]) + lattice_row.y;
  const int column = floatBitsToInt(patches[patch_at + 18]) + j;
  const ivec2 corner = ivec2(floatBitsToInt(patches[patch_at + 13]), floatBitsToInt(patches[patch_at + 14]));
  const vec3 texel = texelFetch(texels, corner + ivec2(j, lattice_row.y), 0).xyz;
  const float a = texel.x, c = texel.y, w = texel.z;
  const float axial = rows[row].y, cap_cos = rows[row].z, cap_sin = rows[row].w;
  const float bind_extension_head = posed_rows[5 * row], bind_extension_tail = posed_rows[5 * row + 1];
  const float extension_head = posed_rows[5 * row + 2], extension_tail = posed_rows[5 * row + 3];
  const float bind_length = posed_rows[5 * row + 4], len = patches[patch_at + 3];
  const float bind_foot = axial * bind_length, foot = axial * len;
  const float e2 = dot(texel, texel);
  const float e2_inverse = e2 > 0.0 ? 1.0 / e2 : 0.0;

  // The bind point, bind_m times the texel from the foot: where the ray leaves the bone's capsule.
  const float bind_slope = mix(bind_columns[2 * column_count + column], bind_columns[3 * column_count + column], axial);
  const float bind_f_o = cap_cos * bind_slope + cap_sin;
  const float bind_f_inverse = inversesqrt(cap_cos * cap_cos + bind_f_o * bind_f_o);
  const float bind_q_s = (w * cap_cos - a * bind_f_o) * bind_f_inverse;
  const float bind_q_o = (w * bind_f_o + a * cap_cos) * bind_f_inverse;
  const float bind_across2 = bind_q_s * bind_q_s + c * c;
  const float bind_m =
      leave_capsule_of_radius(bind_q_o, bind_across2 * e2_inverse, e2_inverse, bind_foot, bind_length - bind_foot, 1.0);

  // Near seams the capsule extends past the bone's ends; its radius, squared, in units of e^2.
  const float bind_z = bind_foot + bind_m * bind_q_o;
  const float past = max(0.0, max(-bind_extension_head - bind_z, bind_z - bind_length - bind_extension_tail));
  const float g = (bind_m * bind_m * bind_across2 + past * past) * e2_inverse;

  const float eased = axial * axial * (3.0 - 2.0 * axial);  // see pose.cl
  const float slope = mix(columns[2 * column_count + column], columns[3 * column_count + column], eased) +
                      (axial - eased) * (bind_columns[3 * column_count + column] - bind_columns[2 * column_count + column]);
  const float f_o = cap_cos * slope + cap_sin;
  const float f_inverse = inversesqrt(cap_cos * cap_cos + f_o * f_o);
  const float q_s = (w * cap_cos - a * f_o) * f_inverse;
  const float q_o = (w * f_o + a * cap_cos) * f_inverse;
  const float m_capsule = leave_capsule_of_radius(q_o, (q_s * q_s + c * c) * e2_inverse, e2_inverse, foot + extension_head,
                                                  len + extension_tail - foot, g);
  const float m = e2 > 0.0 ? (is_distance_kept != 0 ? m_capsule : bind_m) : 0.0;

  const float roll = mix(columns[column], columns[column_count + column], eased);
  const float bind_cosine = bind_columns[column], bind_sine = bind_columns[column_count + column];
  const float cosine = bind_cosine * cos(roll) - bind_sine * sin(roll), sine = bind_sine * cos(roll) + bind_cosine * sin(roll);
  const vec3 point = vector_at(patch_at) + m * (q_s * cosine - c * sine) * vector_at(patch_at + 7) +
                     m * (q_s * sine + c * cosine) * vector_at(patch_at + 10) + (foot + m * q_o) * vector_at(patch_at + 4);
  const int vertex = 3 * (lattice_row.z + j);
  positions[vertex] = point.x;
  positions[vertex + 1] = point.y;
  positions[vertex + 2] = point.z;
}
