// SPDX-License-Identifier: MIT
#version 450
// Bind points moved by the blend of their bones' motions: what kernel skin of kernels/skin.cl does, one group per block of 64 vertices.
// Blocks: six ints each (SkinBlock). Motions: 17 floats each (BoneMotionRecord). Points: three floats per vertex, before
// relative to the bind origin, afterwards to the posed one.
layout(local_size_x = 64) in;
layout(std430, binding = 0) writeonly buffer Positions { float positions[]; };
layout(std430, binding = 1) readonly buffer BindPositions { float bind_positions[]; };
layout(std430, binding = 2) readonly buffer Blocks { int blocks[]; };
layout(std430, binding = 3) readonly buffer BlockBones { int block_bones[]; };
layout(std430, binding = 4) readonly buffer Weights { float weights[]; };
layout(std430, binding = 5) readonly buffer Motions { float motions[]; };
layout(location = 0) uniform int block_count;

vec3 vector_at(int at) { return vec3(motions[at], motions[at + 1], motions[at + 2]); }
vec4 quaternion_at(int at) { return vec4(motions[at + 1], motions[at + 2], motions[at + 3], motions[at]); }

void main() {
  const int number = int(gl_WorkGroupID.x + gl_NumWorkGroups.x * gl_WorkGroupID.y), block = 6 * number;
  const int i = int(gl_LocalInvocationID.x);
  if (number >= block_count || i >= blocks[block + 1]) return;
  const int vertex = 3 * (blocks[block] + i);
  const vec3 p = vec3(bind_positions[vertex], bind_positions[vertex + 1], bind_positions[vertex + 2]);
  vec4 real = vec4(0), dual = vec4(0);
  vec3 stretch = vec3(0);
  for (int k = 0; k < blocks[block + 4]; ++k) {
    const int motion = 17 * block_bones[blocks[block + 3] + k];
    const float weight = weights[blocks[block + 5] + 64 * k + i];
    real += weight * quaternion_at(motion);
    dual += weight * quaternion_at(motion + 4);
    stretch += weight * clamp(dot(p - vector_at(motion + 8), vector_at(motion + 14)), 0.0, 1.0) * vector_at(motion + 11);
  }
  const vec3 t = cross(real.xyz, p) + real.w * p + dual.xyz;
  const vec3 point = p + 2.0 / dot(real, real) * (cross(real.xyz, t) + real.w * dual.xyz - dual.w * real.xyz) + stretch;
  positions[vertex] = point.x;
  positions[vertex + 1] = point.y;
  positions[vertex + 2] = point.z;
}
