// SPDX-License-Identifier: MIT
#version 450
// The share of a few lights in the irradiance, added up by blending: cosine times what of each its depth map lets through.
#define MAX_LIGHTS 8
layout(binding = 0) uniform sampler2D normals;
layout(binding = 1) uniform sampler2D depths;
layout(binding = 2) uniform sampler2DArray light_depths;
layout(location = 0) uniform mat4 unprojection;  // clip space to world
layout(location = 1) uniform int count;
layout(location = 2) uniform float offset;  // world units, along the normal against self-shadowing
layout(location = 3) uniform int taps;      // (2 taps + 1)^2 depths are compared
layout(location = 4) uniform float spread;  // between them, texels
layout(location = 8) uniform mat4 light_projections[MAX_LIGHTS];  // world to the light's clip space, orthographic
layout(location = 16) uniform vec3 to_lights[MAX_LIGHTS];
layout(location = 24) uniform vec3 intensities[MAX_LIGHTS];
layout(location = 0) out vec4 irradiance;

void main() {
  const ivec2 pixel = ivec2(gl_FragCoord.xy);
  const vec4 normal = texelFetch(normals, pixel, 0);
  if (normal.w == 0.0) discard;
  const vec2 size = vec2(textureSize(depths, 0));
  const vec4 clip = unprojection * vec4(2.0 * gl_FragCoord.xy / size - 1.0, 2.0 * texelFetch(depths, pixel, 0).x - 1.0, 1.0);
  const vec4 world = vec4(clip.xyz / clip.w + offset * normal.xyz, 1.0);
  const vec2 texel = 1.0 / vec2(textureSize(light_depths, 0).xy);
  const float all_taps = float((2 * taps + 1) * (2 * taps + 1));
  vec3 sum = vec3(0.0);
  for (int i = 0; i < count; ++i) {
    const vec3 seen = (light_projections[i] * world).xyz * 0.5 + 0.5;
    float open = 0.0;
    for (int y = -taps; y <= taps; ++y)
      for (int x = -taps; x <= taps; ++x) open += textureLod(light_depths, vec3(seen.xy + spread * vec2(x, y) * texel, i), 0.0).x >= seen.z ? 1.0 : 0.0;
    sum += intensities[i] * (max(0.0, dot(normal.xyz, to_lights[i])) * open / all_taps);
  }
  irradiance = vec4(sum, 1.0);
}
