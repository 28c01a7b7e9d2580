// SPDX-License-Identifier: MIT
#version 450
// Vertex normals: the mean of the triangles around, weighted by their angles there, so that neither the triangulation
// nor a seam between rectangles shows. Caps do not count at the vertex in their flat corner: hardly an area, so no direction, but half a turn of
// angle. incident[begin[i] .. begin[i + 1]) are the triangles at vertex i.
layout(local_size_x = 64) in;
layout(std430, binding = 0) readonly buffer Positions { float positions[]; };
layout(std430, binding = 1) readonly buffer Indices { int indices[]; };
layout(std430, binding = 2) readonly buffer Begin { int begin[]; };
layout(std430, binding = 3) readonly buffer Incident { int incident[]; };
layout(std430, binding = 4) writeonly buffer Normals { float normals[]; };
layout(location = 0) uniform int vertex_count;

const float CAP_SLOPE = 0.03;  // of 178 degrees

vec3 position_of(int vertex) { return vec3(positions[3 * vertex], positions[3 * vertex + 1], positions[3 * vertex + 2]); }

void main() {
  const int i = int(gl_GlobalInvocationID.y * gl_NumWorkGroups.x * 64u + gl_GlobalInvocationID.x);
  if (i >= vertex_count) return;
  const vec3 p = position_of(i);
  vec3 sum = vec3(0.0);
  for (int k = begin[i]; k < begin[i + 1]; ++k) {
    const int t = 3 * incident[k];
    const int c = indices[t] == i ? 0 : indices[t + 1] == i ? 1 : 2;
    const vec3 to_next = position_of(indices[t + (c + 1) % 3]) - p, to_last = position_of(indices[t + (c + 2) % 3]) - p;
    const vec3 area = cross(to_next, to_last);
    const float twice_area = length(area), along = dot(to_next, to_last);
    if (twice_area > max(0.0, -CAP_SLOPE * along)) sum += atan(twice_area, along) / twice_area * area;
  }
  const float norm = length(sum);
  const vec3 normal = norm > 0.0 ? sum / norm : vec3(0.0);
  normals[3 * i] = normal.x;
  normals[3 * i + 1] = normal.y;
  normals[3 * i + 2] = normal.z;
}
