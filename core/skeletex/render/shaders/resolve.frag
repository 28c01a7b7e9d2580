// SPDX-License-Identifier: MIT
#version 450
// The picture: samples x samples pixels averaged in linear light. Out: premultiplied linear colour and coverage.
layout(binding = 0) uniform sampler2D albedos;
layout(binding = 1) uniform sampler2D normals;
layout(binding = 2) uniform sampler2D irradiances;
layout(location = 0) uniform int samples;
layout(location = 1) uniform vec3 ambient;
layout(location = 0) out vec4 colour;

void main() {
  const ivec2 first = samples * ivec2(gl_FragCoord.xy);
  vec4 sum = vec4(0.0);
  for (int y = 0; y < samples; ++y)
    for (int x = 0; x < samples; ++x) {
      const ivec2 pixel = first + ivec2(x, y);
      if (texelFetch(normals, pixel, 0).w == 0.0) continue;
      const vec4 albedo = texelFetch(albedos, pixel, 0);
      const vec3 light = mix(vec3(1.0), ambient + texelFetch(irradiances, pixel, 0).rgb, albedo.a);
      sum += vec4(albedo.rgb * light, 1.0);
    }
  colour = sum / float(samples * samples);
}
