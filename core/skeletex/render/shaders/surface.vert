// SPDX-License-Identifier: MIT
#version 450
// Three vertices per triangle, fetched by number, so that faces can have colours and corners (u, v) of their own.
layout(std430, binding = 0) readonly buffer Positions { float positions[]; };
layout(std430, binding = 1) readonly buffer Indices { int indices[]; };
layout(std430, binding = 2) readonly buffer Normals { float normals[]; };
layout(std430, binding = 3) readonly buffer Colours { uint colours[]; };
layout(std430, binding = 4) readonly buffer CornerUv { vec2 corner_uv[]; };
layout(std430, binding = 5) readonly buffer TrianglePictures { int triangle_pictures[]; };
layout(location = 0) uniform mat4 view_projection;
layout(location = 1) uniform int is_flat;
layout(location = 2) uniform int paint;  // 0 one colour, 1 per face, 2 per vertex, 3 checker, 4 normals, 5 per corner and pictures
layout(location = 3) uniform vec3 base;
layout(location = 7) uniform vec4 eye;  // w 0: the direction to it, of an orthographic camera
layout(location = 0) out vec3 normal;
layout(location = 1) out vec3 colour;
layout(location = 2) out vec3 corner_weights;
layout(location = 3) out vec2 uv;
layout(location = 4) flat out int picture;
layout(location = 5) out vec3 to_eye;

vec3 position_of(int vertex) { return vec3(positions[3 * vertex], positions[3 * vertex + 1], positions[3 * vertex + 2]); }
vec3 linear_of(uint packed_srgb) {
  const vec3 srgb = unpackUnorm4x8(packed_srgb).rgb;
  return mix(srgb / 12.92, pow((srgb + 0.055) / 1.055, vec3(2.4)), step(0.04045, srgb));
}

void main() {
  const int triangle = gl_VertexID / 3, corner = gl_VertexID % 3;
  const int vertex = indices[gl_VertexID];
  const vec3 p = position_of(vertex);
  gl_Position = view_projection * vec4(p, 1.0);
  to_eye = eye.xyz - eye.w * p;
  if (is_flat != 0) {
    const vec3 a = position_of(indices[3 * triangle]), b = position_of(indices[3 * triangle + 1]), c = position_of(indices[3 * triangle + 2]);
    normal = cross(b - a, c - a);
    normal *= inversesqrt(max(dot(normal, normal), 1e-30));
  } else {
    normal = vec3(normals[3 * vertex], normals[3 * vertex + 1], normals[3 * vertex + 2]);
  }
  colour = paint == 1 ? linear_of(colours[triangle]) : paint == 2 ? linear_of(colours[vertex]) : paint == 5 ? linear_of(colours[gl_VertexID]) : base;
  uv = paint == 3 || paint == 5 ? corner_uv[gl_VertexID] : vec2(0.0);
  picture = paint == 5 ? triangle_pictures[triangle] : -1;
  corner_weights = vec3(corner == 0, corner == 1, corner == 2);
}
