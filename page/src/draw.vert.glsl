in vec3 position;
in vec3 normal;
in vec2 cell;  // of the checker: along, and around as a share of the patch's width
in float patch_of;
in float error;
uniform mat4 modelViewMatrix, projectionMatrix;
uniform mat3 normalMatrix;
out vec3 seen_normal, seen_point, own_normal;
out vec3 checker;  // along, and around counted from two places, so that one of them has no jump
out float distance_to_mesh;
flat out int bone;

void main() {
  vec4 seen = modelViewMatrix * vec4(position, 1.0);
  seen_point = seen.xyz;
  seen_normal = normalMatrix * normal;
  own_normal = normal;
  checker = vec3(cell.x, fract(cell.y), fract(cell.y + 0.5) - 0.5);
  distance_to_mesh = error;
  bone = int(patch_of + 0.5);  // the last corner's: an inner vertex
  gl_Position = projectionMatrix * seen;
}
