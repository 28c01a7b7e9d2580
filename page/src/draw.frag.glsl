uniform int mode;  // shaded, segments, checker, error, normals
uniform sampler2D bone_colours, error_colours;
uniform sampler2D bone_cells;  // per bone: cells around
uniform vec3 clay, clay_dark;
uniform int lit_bone;  // under the cursor; -1: none
in vec3 seen_normal, seen_point, own_normal;
in vec3 checker;
in float distance_to_mesh;
flat in int bone;
out vec4 colour;

vec3 to_linear(vec3 c) { return mix(c / 12.92, pow((c + 0.055) / 1.055, vec3(2.4)), step(0.04045, c)); }
vec3 to_srgb(vec3 c) { return mix(12.92 * c, 1.055 * pow(c, vec3(1.0 / 2.4)) - 0.055, step(0.0031308, c)); }

float is_dark_cell() {
  float around = fwidth(checker.y) <= fwidth(checker.z) + 1e-6 ? checker.y : checker.z;
  vec2 at = vec2(checker.x, around * texelFetch(bone_cells, ivec2(bone, 0), 0).x);
  vec2 width = max(fwidth(at), 1e-5);
  // A box filter over the pixel, so that far cells turn grey instead of into moire.
  vec2 i = 2.0 * (abs(fract((at - 0.5 * width) * 0.5) - 0.5) - abs(fract((at + 0.5 * width) * 0.5) - 0.5)) / width;
  return 0.5 - 0.5 * i.x * i.y;
}

void main() {
  vec3 n = normalize(seen_normal);
  vec3 to_eye = normalize(-seen_point);
  // A triangle that lies upside down in the surface has the surface's normals.
  if (!gl_FrontFacing && dot(n, to_eye) < 0.0) n = -n;
  vec3 albedo = clay;
  float lighting = 1.0;
  if (mode == 1) albedo = to_linear(texelFetch(bone_colours, ivec2(bone, 0), 0).rgb);
  if (mode == 2) albedo = mix(clay, clay_dark, is_dark_cell());
  if (mode == 3) {
    albedo = to_linear(texture(error_colours, vec2(clamp(distance_to_mesh, 0.004, 0.996), 0.5)).rgb);
    lighting = 0.45;
  }
  if (mode == 4) {
    albedo = to_linear(0.5 + 0.5 * normalize(own_normal));
    lighting = 0.0;
  }
  if (bone == lit_bone && mode < 2) albedo = mix(albedo, vec3(1.0, 0.62, 0.25), 0.16);
  float key = max(0.0, dot(n, normalize(vec3(-0.45, 0.7, 0.55)))), fill = max(0.0, dot(n, normalize(vec3(0.8, 0.1, 0.5))));
  float sky = 0.5 + 0.5 * n.y, rim = pow(1.0 - max(0.0, dot(n, to_eye)), 3.0);
  vec3 light = 0.30 * mix(vec3(0.55, 0.52, 0.50), vec3(1.0, 1.02, 1.06), sky) + 0.78 * key * vec3(1.0, 0.98, 0.95) +
               0.20 * fill * vec3(0.85, 0.92, 1.0) + 0.10 * rim;
  colour = vec4(to_srgb(min(albedo * mix(vec3(1.0), light, lighting), 1.0)), 1.0);
}
