// SPDX-License-Identifier: MIT
#version 450
// Albedo (linear; alpha: how much of it light changes) and world normal.
layout(location = 0) in vec3 normal;
layout(location = 1) in vec3 colour;
layout(location = 2) in vec3 corner_weights;
layout(location = 3) in vec2 uv;
layout(location = 2) uniform int paint;
layout(location = 4) uniform float wire_pixels;  // 0: no wires
layout(location = 5) uniform float lighting;     // 1: light shapes colours fully, 0: colours as they are
layout(location = 6) uniform vec3 wire_colour;
layout(location = 0) out vec4 albedo;
layout(location = 1) out vec4 world_normal;

void main() {
  const vec3 n = normalize(gl_FrontFacing ? normal : -normal);
  vec3 c = colour;
  if (paint == 3) {
    const vec2 width = max(fwidth(uv), vec2(1e-6));
    const vec2 wave = abs(fract(0.5 * uv) - 0.5) * 2.0;  // distance from even lines, in cells
    const vec2 side = clamp((wave - 0.5) / width + 0.5, 0.0, 1.0);
    const float odd = side.x * (1.0 - side.y) + side.y * (1.0 - side.x);
    c = mix(vec3(0.045, 0.19, 0.42), vec3(0.80, 0.78, 0.72), odd);
  } else if (paint == 4) {
    c = pow(0.5 + 0.5 * n, vec3(2.2));
  }
  if (wire_pixels > 0.0) {
    const vec3 pixels = corner_weights / max(fwidth(corner_weights), vec3(1e-9));
    const float nearest = min(min(pixels.x, pixels.y), pixels.z);
    c = mix(wire_colour, c, smoothstep(wire_pixels - 0.5, wire_pixels + 0.5, nearest));
  }
  albedo = vec4(c, lighting);
  world_normal = vec4(n, 1.0);
}
