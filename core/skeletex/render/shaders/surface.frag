// SPDX-License-Identifier: MIT
#version 450
// Albedo (linear; alpha: how much of it light changes) and world normal.
layout(location = 0) in vec3 normal;
layout(location = 1) in vec3 colour;
layout(location = 2) in vec3 corner_weights;
layout(location = 3) in vec2 uv;
layout(location = 4) flat in int picture;
layout(location = 5) in vec3 to_eye;
layout(std430, binding = 6) readonly buffer Pictures { ivec4 pictures[]; };  // first pixel, width, height
layout(std430, binding = 7) readonly buffer Pixels { uint pixels[]; };       // rows from the top, sRGB
layout(location = 2) uniform int paint;
layout(location = 4) uniform float wire_pixels;  // 0: no wires
layout(location = 5) uniform float lighting;     // 1: light shapes colours fully, 0: colours as they are
layout(location = 6) uniform vec3 wire_colour;
layout(location = 0) out vec4 albedo;
layout(location = 1) out vec4 world_normal;

const float MOST_TAPS = 16.0;

vec3 pixel(ivec4 p, ivec2 at) {
  const ivec2 size = p.yz, i = ((at % size) + size) % size;
  const vec3 srgb = unpackUnorm4x8(pixels[p.x + i.y * size.x + i.x]).rgb;
  return mix(srgb / 12.92, pow((srgb + 0.055) / 1.055, vec3(2.4)), step(0.04045, srgb));
}

// The picture between its pixels; it repeats. v runs upwards.
vec3 picture_at(ivec4 p, vec2 at) {
  const vec2 x = vec2(at.x, 1.0 - at.y) * vec2(p.yz) - 0.5, whole = floor(x), share = x - whole;
  const ivec2 i = ivec2(whole);
  return mix(mix(pixel(p, i), pixel(p, i + ivec2(1, 0)), share.x),
             mix(pixel(p, i + ivec2(0, 1)), pixel(p, i + ivec2(1, 1)), share.x), share.y);
}

// Its mean over what the fragment covers.
vec3 picture_over(ivec4 p) {
  const vec2 right = dFdx(uv), up = dFdy(uv), size = vec2(p.yz);
  const ivec2 taps = ivec2(clamp(ceil(vec2(length(right * size), length(up * size))), 1.0, MOST_TAPS));
  vec3 sum = vec3(0.0);
  for (int i = 0; i < taps.x; ++i)
    for (int j = 0; j < taps.y; ++j)
      sum += picture_at(p, uv + ((i + 0.5) / taps.x - 0.5) * right + ((j + 0.5) / taps.y - 0.5) * up);
  return sum / (taps.x * taps.y);
}

void main() {
  // The inside of an open surface is lit as well. A triangle that lies upside down in the surface is lit as what is
  // around it: its normals are the surface's.
  const vec3 n = normalize(gl_FrontFacing || dot(normal, to_eye) >= 0.0 ? normal : -normal);
  vec3 c = colour;
  if (paint == 3) {
    const vec2 width = max(fwidth(uv), vec2(1e-6));
    const vec2 wave = abs(fract(0.5 * uv) - 0.5) * 2.0;  // distance from even lines, in cells
    const vec2 side = clamp((wave - 0.5) / width + 0.5, 0.0, 1.0);
    const float odd = side.x * (1.0 - side.y) + side.y * (1.0 - side.x);
    c = mix(vec3(0.045, 0.19, 0.42), vec3(0.80, 0.78, 0.72), odd);
  } else if (paint == 4) {
    c = pow(0.5 + 0.5 * n, vec3(2.2));
  } else if (picture >= 0) {
    c *= picture_over(pictures[picture]);
  }
  if (wire_pixels > 0.0) {
    const vec3 pixels = corner_weights / max(fwidth(corner_weights), vec3(1e-9));
    const float nearest = min(min(pixels.x, pixels.y), pixels.z);
    c = mix(wire_colour, c, smoothstep(wire_pixels - 0.5, wire_pixels + 0.5, nearest));
  }
  albedo = vec4(c, lighting);
  world_normal = vec4(n, 1.0);
}
