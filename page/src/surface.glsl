// From texels to surface points (kernels/reconstruct.cl), moved by the bones near by (kernels/skin.cl). One vertex of
// the page's lattice per gl_VertexID; transform feedback takes point and normal.
// Tables are one texture of four floats per entry. Bones take 6 entries: head and length; axis and 0; s; b; rectangle;
// first row, first column, share of what a transfer moves, first step of the walk. Rows: axial parameter, cosine and sine of the
// latitude, 0. Columns: cosine, sine, slope at the head, slope at the tail. Steps take 3: normal and 1 / girth; joint
// and radius of the seams; bone, step before, same. Motions take 2: real and dual part.
// Places of vertices: bone, row, column, and the number of a seam's point or -1. Rings: begin and end in the second half
// of the same texture, whose entries are two vertices each.
uniform sampler2D tables, texels, transfer_moves;
uniform isampler2D places, rings;
uniform int rows_at, columns_at, seams_at, steps_at, motions_at;
uniform int inner_count;
uniform bool is_posed;
out vec3 point;
out vec3 normal;

vec4 table(int i) { return texelFetch(tables, ivec2(i & 1023, i >> 10), 0); }
ivec4 place_of(int vertex) { return texelFetch(places, ivec2(vertex & 1023, vertex >> 10), 0); }
ivec4 ring(int i) { return texelFetch(rings, ivec2(i & 1023, i >> 10), 0); }

vec3 texel_at(ivec2 at, float transferred) {
  vec3 texel = texelFetch(texels, at, 0).xyz;
  if (transferred > 0.0) texel += transferred * texelFetch(transfer_moves, at, 0).xyz;
  return texel;
}

vec3 displaced(int bone, int row, int column) {
  vec4 head = table(6 * bone), rectangle = table(6 * bone + 4), more = table(6 * bone + 5);
  vec3 texel = texel_at(ivec2(rectangle.xy) + ivec2(column, row), more.z);
  vec4 at_row = table(rows_at + int(more.x) + row), at_column = table(columns_at + int(more.y) + column);
  float axial = at_row.x, foot = axial * head.w;
  float f_s = at_row.y, f_o = at_row.y * mix(at_column.z, at_column.w, axial) + at_row.z;
  float f_inverse = 1.0 / sqrt(f_s * f_s + f_o * f_o);
  float q_s = (texel.z * f_s - texel.x * f_o) * f_inverse, q_o = (texel.z * f_o + texel.x * f_s) * f_inverse;
  float across2 = q_s * q_s + texel.y * texel.y, e2 = across2 + q_o * q_o;
  float e2_inverse = e2 > 0.0 ? 1.0 / e2 : 0.0;
  float m = e2 > 0.0 ? leave_capsule_of_own_length(q_o, across2 * e2_inverse, e2_inverse, foot, head.w - foot) : 0.0;
  return head.xyz + m * (q_s * at_column.x - texel.y * at_column.y) * table(6 * bone + 2).xyz +
         m * (q_s * at_column.y + texel.y * at_column.x) * table(6 * bone + 3).xyz +
         (foot + m * q_o) * table(6 * bone + 1).xyz;
}

vec3 bind_point(ivec4 place) {
  return place.w >= 0 ? table(seams_at + place.w).xyz : displaced(place.x, place.y, place.z);
}

// Inner vertices: across the central differences, of which the one around is against the order of u and v outside.
vec3 inner_normal(ivec4 place) {
  int width = int(table(6 * place.x + 4).z);
  vec3 around = displaced(place.x, place.y, place.z + 1 < width ? place.z + 1 : 0) -
                displaced(place.x, place.y, place.z > 0 ? place.z - 1 : width - 1);
  vec3 along = displaced(place.x, place.y + 1, place.z) - displaced(place.x, place.y - 1, place.z);
  return cross(around, along);
}

// Others: the mean of the triangles around, by their angles.
vec3 ring_normal(int vertex, vec3 here) {
  ivec4 range = ring(vertex - inner_count);
  vec3 sum = vec3(0.0);
  for (int i = range.x; i < range.y; ++i) {
    ivec4 corners = ring(i);
    vec3 a = bind_point(place_of(corners.x)) - here, b = bind_point(place_of(corners.y)) - here;
    vec3 area = cross(a, b);
    float twice_area = length(area);
    if (twice_area > 0.0) sum += atan(twice_area, dot(a, b)) / twice_area * area;
  }
  return sum;
}

// Moves a bind point and its normal by the blend of bones that the walk from its own bone weighs.
void move_by_bones(int bone, inout vec3 p, inout vec3 n) {
  int begin = int(table(6 * bone + 5).w);
  int count = int(table(6 * bone + 1).w);
  float potentials[MOST_STEPS + 1];
  potentials[0] = 0.0;
  float lowest = 0.0;
  for (int k = 0; k < count; ++k) {
    int at = steps_at + 3 * (begin + k);
    vec4 normal_of = table(at), joint = table(at + 1), more = table(at + 2);
    vec3 from = p - joint.xyz;
    float height = dot(from, normal_of.xyz), excess = max(0.0, length(from) - joint.w) * normal_of.w;
    potentials[k + 1] = potentials[int(more.y) + 1] + SKIN_CROSSING(height, excess);
    lowest = min(lowest, potentials[k + 1]);
  }
  for (int k = 0; k < count; ++k) {
    int same = int(table(steps_at + 3 * (begin + k) + 2).z);
    if (same < 0) continue;
    potentials[same + 1] = min(potentials[same + 1], potentials[k + 1]);
    potentials[k + 1] = 1e30;
  }
  vec4 real = vec4(0.0), dual = vec4(0.0);
  for (int k = 0; k <= count; ++k) {
    float weight = exp(lowest - potentials[k]) - SKIN_CUT;
    if (weight <= 0.0) continue;
    int moving = k == 0 ? bone : int(table(steps_at + 3 * (begin + k - 1) + 2).x);
    real += weight * table(motions_at + 2 * moving);
    dual += weight * table(motions_at + 2 * moving + 1);
  }
  float inverse2 = 1.0 / dot(real, real);
  vec3 t = cross(real.xyz, p) + real.w * p + dual.xyz;
  p += 2.0 * inverse2 * (cross(real.xyz, t) + real.w * dual.xyz - dual.w * real.xyz);
  n += 2.0 * inverse2 * cross(real.xyz, cross(real.xyz, n) + real.w * n);
}

void main() {
  ivec4 place = place_of(gl_VertexID);
  point = bind_point(place);
  normal = gl_VertexID < inner_count ? inner_normal(place) : ring_normal(gl_VertexID, point);
  float size = length(normal);
  normal = size > 0.0 ? normal / size : vec3(0.0);
  if (is_posed) move_by_bones(place.x, point, normal);
  gl_Position = vec4(0.0, 0.0, 0.0, 1.0);
}
