// SPDX-License-Identifier: MIT
// The orientations of an in-between surface: how its surface would have to turn at every vertex to look the way that
// its sources do there (edit/orientation.h). Vertices, rows and fans as in filter.cl, whose head comment explains them.
//
// A field has planes of `count` floats behind each other. A rotation is a unit quaternion, four planes: w, x, y, z.

#define FAN_CHUNK 64
#define LEAST_SINE 1e-3f       // of the angle between the two directions of a surface
#define LEAST_HALF_TURN 1e-3f  // 1 + cosine of the angle between two normals
// Cosines of half the angles where a rotation counts in full, and no more: 50 and 100 degrees. One so large tells of a
// map that folds or smears, not of a surface.
#define FULL_COSINE 0.90630779f
#define LAST_COSINE 0.64278761f

void cross_product(const float* restrict e, const float* restrict f, float* restrict n) {
  n[0] = e[1] * f[2] - e[2] * f[1];
  n[1] = e[2] * f[0] - e[0] * f[2];
  n[2] = e[0] * f[1] - e[1] * f[0];
}

float dot_product(const float* restrict e, const float* restrict f) { return e[0] * f[0] + e[1] * f[1] + e[2] * f[2]; }

// p q
void multiply_rotations(const float* restrict p, const float* restrict q, float* restrict product) {
  product[0] = p[0] * q[0] - p[1] * q[1] - p[2] * q[2] - p[3] * q[3];
  product[1] = p[0] * q[1] + p[1] * q[0] + p[2] * q[3] - p[3] * q[2];
  product[2] = p[0] * q[2] - p[1] * q[3] + p[2] * q[0] + p[3] * q[1];
  product[3] = p[0] * q[3] + p[1] * q[2] - p[2] * q[1] + p[3] * q[0];
}

void rotate_vector(const float* restrict q, const float* restrict v, float* restrict rotated) {
  const float tx = 2.0f * (q[2] * v[2] - q[3] * v[1]), ty = 2.0f * (q[3] * v[0] - q[1] * v[2]),
              tz = 2.0f * (q[1] * v[1] - q[2] * v[0]);
  rotated[0] = v[0] + q[0] * tx + q[2] * tz - q[3] * ty;
  rotated[1] = v[1] + q[0] * ty + q[3] * tx - q[1] * tz;
  rotated[2] = v[2] + q[0] * tz + q[1] * ty - q[2] * tx;
}

void vector_between(__global const float* restrict points, const int count, const int from, const int to,
                    float* restrict e) {
  e[0] = points[to] - points[from];
  e[1] = points[count + to] - points[count + from];
  e[2] = points[2 * count + to] - points[2 * count + from];
}

// Unit normal from the directions along and around. 0 where they have none
int unit_normal(const float* restrict along, const float* restrict around, float* restrict n) {
  cross_product(along, around, n);
  const float area2 = dot_product(n, n);
  if (!(area2 > LEAST_SINE * LEAST_SINE * dot_product(along, along) * dot_product(around, around)) || !(area2 > 0.0f))
    return 0;
  const float scale = 1.0f / sqrt(area2);
  for (int i = 0; i < 3; ++i) n[i] *= scale;
  return 1;
}

// The rotation from a surface's directions to those of another one: the least that takes normal to normal, then about
// the normal the one that fits both directions best, whatever their lengths. None where a surface has no normal or is
// upside down.
void rotation_between(const float* restrict along, const float* restrict around, const float* restrict to_along,
                      const float* restrict to_around, float* restrict q) {
  float n[3], m[3];
  q[0] = 1.0f;
  q[1] = q[2] = q[3] = 0.0f;
  if (!unit_normal(along, around, n) || !unit_normal(to_along, to_around, m)) return;
  const float half_cosine = 1.0f + dot_product(n, m);
  if (half_cosine < LEAST_HALF_TURN) return;
  float tilt[4], axis[3];
  cross_product(n, m, axis);
  const float tilt_scale = 1.0f / sqrt(2.0f * half_cosine);
  tilt[0] = half_cosine * tilt_scale;
  for (int i = 0; i < 3; ++i) tilt[i + 1] = axis[i] * tilt_scale;
  float c = 0.0f, s = 0.0f;
  for (int side = 0; side < 2; ++side) {
    const float* from = side == 0 ? along : around;
    const float* to = side == 0 ? to_along : to_around;
    float tilted[3], normal[3];
    rotate_vector(tilt, from, tilted);
    const float scale = 1.0f / sqrt(dot_product(from, from) * dot_product(to, to));
    cross_product(tilted, to, normal);
    c += scale * dot_product(tilted, to);
    s += scale * dot_product(normal, m);
  }
  const float length = sqrt(c * c + s * s);
  float roll[4] = {1.0f, 0.0f, 0.0f, 0.0f};
  if (length > 1e-6f) {
    roll[0] = sqrt(fmax(0.0f, 0.5f * (1.0f + c / length)));
    const float sine = copysign(sqrt(fmax(0.0f, 0.5f * (1.0f - c / length))), s);
    for (int i = 0; i < 3; ++i) roll[i + 1] = sine * m[i];
  }
  multiply_rotations(roll, tilt, q);
}

// Adds the rotations from a surface to a source's, times the source's weights. NDRange: rows.
// in  facing: per row a rotation, by which the source is to be rotated first; weights: per vertex; points, source:
// fields of three in and out  sums: four planes
__kernel void add_rotations(const int row_count, const int count, __global const int* restrict rows,
                            __global const float* restrict facing, __global const float* restrict weights,
                            __global const float* restrict points, __global const float* restrict source,
                            __global float* restrict sums) {
  const int k = get_group_id(0);
  if (k >= row_count) return;
  const int here = rows[4 * k], width = rows[4 * k + 1];
  const int before = rows[4 * k + 2] ? here - width : here, after = rows[4 * k + 3] ? here + width : here;
  float first[4];
  for (int i = 0; i < 4; ++i) first[i] = facing[4 * k + i];
  for (int j = get_local_id(0); j < width; j += get_local_size(0)) {
    const float weight = weights[here + j];
    if (weight == 0.0f) continue;
    const int left = here + (j > 0 ? j - 1 : width - 1), right = here + (j + 1 < width ? j + 1 : 0);
    float along[3], around[3], source_along[3], source_around[3], to_along[3], to_around[3], q[4];
    vector_between(points, count, before + j, after + j, along);
    vector_between(points, count, left, right, around);
    vector_between(source, count, before + j, after + j, source_along);
    vector_between(source, count, left, right, source_around);
    rotate_vector(first, source_along, to_along);
    rotate_vector(first, source_around, to_around);
    rotation_between(along, around, to_along, to_around, q);
    const float signed_weight = q[0] < 0.0f ? -weight : weight;
    for (int i = 0; i < 4; ++i) sums[i * count + here + j] += signed_weight * q[i];
  }
}

// Unit normals of the inner vertices, 0 where they have none. NDRange: rows. in  points     out  normals: field of
// three
__kernel void row_normals(const int row_count, const int count, __global const int* restrict rows,
                          __global const float* restrict points, __global float* restrict normals) {
  const int k = get_group_id(0);
  if (k >= row_count) return;
  const int here = rows[4 * k], width = rows[4 * k + 1];
  const int before = rows[4 * k + 2] ? here - width : here, after = rows[4 * k + 3] ? here + width : here;
  for (int j = get_local_id(0); j < width; j += get_local_size(0)) {
    float along[3], around[3], n[3];
    vector_between(points, count, before + j, after + j, along);
    vector_between(points, count, here + (j > 0 ? j - 1 : width - 1), here + (j + 1 < width ? j + 1 : 0), around);
    const int has_normal = unit_normal(along, around, n);
    for (int i = 0; i < 3; ++i) normals[i * count + here + j] = has_normal ? n[i] : 0.0f;
  }
}

// Rotations of the inner vertices from their sums: of unit length, none beyond LAST_COSINE, and as much of them as
// their row has. NDRange: rows. in  shares: per row     in and out  rotations
__kernel void settle_rotations(const int row_count, const int count, __global const int* restrict rows,
                               __global const float* restrict shares, __global float* restrict rotations) {
  const int k = get_group_id(0);
  if (k >= row_count) return;
  const int here = rows[4 * k], end = here + rows[4 * k + 1];
  for (int v = here + (int)get_local_id(0); v < end; v += get_local_size(0)) {
    float q[4];
    for (int i = 0; i < 4; ++i) q[i] = rotations[i * count + v];
    const float length = fmax(sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]), 1e-6f);
    const float x = clamp((q[0] / length - LAST_COSINE) / (FULL_COSINE - LAST_COSINE), 0.0f, 1.0f);
    const float share = shares[k] * x * x * (3.0f - 2.0f * x);
    q[0] = 1.0f - share + share * q[0] / length;
    for (int i = 1; i < 4; ++i) q[i] *= share / length;
    const float scale = 1.0f / sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
    for (int i = 0; i < 4; ++i) rotations[i * count + v] = scale * q[i];
  }
}

// The means of the rotations of each vertex and those next to it in the rows: where a map folds they change from vertex
// to vertex, which would tear single ones out of the surface. NDRange: rows.
__kernel void smooth_rotations(const int row_count, const int count, __global const int* restrict rows,
                               __global const float* restrict rotations, __global float* restrict smoothed) {
  const int k = get_group_id(0);
  if (k >= row_count) return;
  const int here = rows[4 * k], width = rows[4 * k + 1], has_before = rows[4 * k + 2], has_after = rows[4 * k + 3];
  for (int j = get_local_id(0); j < width; j += get_local_size(0)) {
    const int left = j > 0 ? j - 1 : width - 1, right = j + 1 < width ? j + 1 : 0;
    float sum[4] = {0.0f, 0.0f, 0.0f, 0.0f};
    for (int row = -has_before; row <= has_after; ++row)
      for (int i = 0; i < 4; ++i) {
        __global const float* restrict q = rotations + i * count + here + row * width;
        sum[i] += q[left] + q[j] + q[right];
      }
    const float scale = 1.0f / sqrt(sum[0] * sum[0] + sum[1] * sum[1] + sum[2] * sum[2] + sum[3] * sum[3]);
    for (int i = 0; i < 4; ++i) smoothed[i * count + here + j] = scale * sum[i];
  }
}

// Rotations the normals of the inner vertices. NDRange: rows. in  rotations     in and out  normals
__kernel void rotate_normals(const int row_count, const int count, __global const int* restrict rows,
                             __global const float* restrict rotations, __global float* restrict normals) {
  const int k = get_group_id(0);
  if (k >= row_count) return;
  const int here = rows[4 * k], end = here + rows[4 * k + 1];
  for (int v = here + (int)get_local_id(0); v < end; v += get_local_size(0)) {
    float q[4], n[3], rotated[3];
    for (int i = 0; i < 4; ++i) q[i] = rotations[i * count + v];
    for (int i = 0; i < 3; ++i) n[i] = normals[i * count + v];
    rotate_vector(q, n, rotated);
    for (int i = 0; i < 3; ++i) normals[i * count + v] = rotated[i];
  }
}

// At the vertices in no row: the mean of their neighbours in rows, of length 1. NDRange: fans.
// in and out  field: of three or four components
__kernel void mean_at_ends(const int fan_count, const int inner_count, const int count, const int components,
                           __global const int* restrict fan_vertices, __global const int* restrict fan_begin,
                           __global const int* restrict fans, __global float* restrict field) {
  const int begin = get_group_id(0) * FAN_CHUNK, end = min(begin + FAN_CHUNK, fan_count);
  for (int k = begin + (int)get_local_id(0); k < end; k += get_local_size(0)) {
    const int v = fan_vertices[k];
    if (v < inner_count) continue;
    float sum[4] = {0.0f, 0.0f, 0.0f, 0.0f};
    for (int i = fan_begin[k]; i < fan_begin[k + 1]; ++i)
      if (fans[2 * i] < inner_count)
        for (int c = 0; c < components; ++c) sum[c] += field[c * count + fans[2 * i]];
    const float length = sqrt(sum[0] * sum[0] + sum[1] * sum[1] + sum[2] * sum[2] + sum[3] * sum[3]);
    for (int c = 0; c < components; ++c) field[c * count + v] = length > 1e-6f ? sum[c] / length : 0.0f;
  }
}

// How much an edge from one vertex to another stands out from the plane that is normal to the mean of their normals: a
// length. n: that mean, of unit length; 0 where there is none
float height_of(const int count, __global const float* restrict normals, const int v, const int other,
                const float* restrict e, float* restrict n) {
  for (int c = 0; c < 3; ++c) n[c] = normals[c * count + v] + normals[c * count + other];
  const float length = sqrt(dot_product(n, n));
  for (int c = 0; c < 3; ++c) n[c] = length > 0.1f ? n[c] / length : 0.0f;
  return dot_product(n, e);
}

// Adds the slopes of a source's edges in the fans, times the source's weights at their ends. NDRange: fans.
// in  weights: per vertex; source; normals: of the source     in and out  slopes: two per triangle of the fans, heights
// over lengths
__kernel void add_slopes(const int fan_count, const int count, __global const int* restrict fan_vertices,
                         __global const int* restrict fan_begin, __global const int* restrict fans,
                         __global const float* restrict weights, __global const float* restrict source,
                         __global const float* restrict normals, __global float* restrict slopes) {
  const int begin = get_group_id(0) * FAN_CHUNK, end = min(begin + FAN_CHUNK, fan_count);
  for (int k = begin + (int)get_local_id(0); k < end; k += get_local_size(0)) {
    const int v = fan_vertices[k];
    for (int i = 2 * fan_begin[k]; i < 2 * fan_begin[k + 1]; ++i) {
      float e[3], n[3];
      vector_between(source, count, fans[i], v, e);
      const float height = height_of(count, normals, v, fans[i], e, n), length = sqrt(dot_product(e, e));
      if (length > 0.0f) slopes[i] += 0.5f * (weights[v] + weights[fans[i]]) * height / length;
    }
  }
}

void matrix_of(__global const float* restrict rotations, const int count, const int v, float* restrict m) {
  const float w = rotations[v], x = rotations[count + v], y = rotations[2 * count + v], z = rotations[3 * count + v];
  m[0] = 1.0f - 2.0f * (y * y + z * z);
  m[1] = 2.0f * (x * y - w * z);
  m[2] = 2.0f * (x * z + w * y);
  m[3] = 2.0f * (x * y + w * z);
  m[4] = 1.0f - 2.0f * (x * x + z * z);
  m[5] = 2.0f * (y * z - w * x);
  m[6] = 2.0f * (x * z - w * y);
  m[7] = 2.0f * (y * z + w * x);
  m[8] = 1.0f - 2.0f * (x * x + y * y);
}

// What has to be added to L x for edges that are rotated by the mean of the rotations C at their ends: b = time (D - L
// x) with D(v) = sum of w (C(v) + C(other)) / 2 (x(v) - x(other)). These are the edges of the rows. NDRange: rows. in
// rotations; points; weights: of the Laplace operator (filter.cl)     out  b: field of three
__kernel void pull_rows(const int row_count, const int count, const float time, __global const int* restrict rows,
                        __global const float* restrict weights, __global const float* restrict rotations,
                        __global const float* restrict points, __global float* restrict b) {
  const int k = get_group_id(0);
  if (k >= row_count) return;
  const int here = rows[4 * k], width = rows[4 * k + 1], has_before = rows[4 * k + 2], has_after = rows[4 * k + 3];
  for (int j = get_local_id(0); j < width; j += get_local_size(0)) {
    const int v = here + j, left = j > 0 ? j - 1 : width - 1, right = j + 1 < width ? j + 1 : 0;
    float m[9], sum[3] = {0.0f, 0.0f, 0.0f};
    matrix_of(rotations, count, v, m);
    for (int row = -has_before; row <= has_after; ++row)
      for (int column = -1; column <= 1; ++column) {
        if (row == 0 && column == 0) continue;
        const int other = here + row * width + (column < 0 ? left : column > 0 ? right : j);
        // The edge's weight is stored at the vertex whose right or later row it leads to.
        const int is_ahead = row > 0 || (row == 0 && column > 0);
        const int plane = row == 0 ? 0 : 2 + row * column;
        const float w = weights[plane * count + (is_ahead ? v : other)];
        float to[9], e[3];
        matrix_of(rotations, count, other, to);
        vector_between(points, count, other, v, e);
        for (int c = 0; c < 3; ++c)
          for (int i = 0; i < 3; ++i)
            sum[c] += w * (0.5f * (m[3 * c + i] + to[3 * c + i]) - (c == i ? 1.0f : 0.0f)) * e[i];
      }
    for (int c = 0; c < 3; ++c) b[c * count + v] = time * sum[c];
  }
}

// The same for the triangles of the fans. Edges that touch a seam, vertices from `first_seam` on, get the slopes of the
// sources' there. NDRange: fans. in  fan_weights; normals: of the rotated surface; slopes     in and out  b
__kernel void pull_fans(const int fan_count, const int inner_count, const int first_seam, const int count,
                        const float time, __global const int* restrict fan_vertices,
                        __global const int* restrict fan_begin, __global const int* restrict fans,
                        __global const float* restrict fan_weights, __global const float* restrict slopes,
                        __global const float* restrict rotations, __global const float* restrict normals,
                        __global const float* restrict points, __global float* restrict b) {
  const int begin = get_group_id(0) * FAN_CHUNK, end = min(begin + FAN_CHUNK, fan_count);
  for (int k = begin + (int)get_local_id(0); k < end; k += get_local_size(0)) {
    const int v = fan_vertices[k];
    float m[9], sum[3] = {0.0f, 0.0f, 0.0f};
    matrix_of(rotations, count, v, m);
    for (int i = 2 * fan_begin[k]; i < 2 * fan_begin[k + 1]; ++i) {
      const int other = fans[i];
      float to[9], e[3], rotated[3] = {0.0f, 0.0f, 0.0f}, n[3];
      matrix_of(rotations, count, other, to);
      vector_between(points, count, other, v, e);
      for (int c = 0; c < 3; ++c)
        for (int d = 0; d < 3; ++d) rotated[c] += 0.5f * (m[3 * c + d] + to[3 * c + d]) * e[d];
      const float height = height_of(count, normals, v, other, rotated, n);
      const float out =
          v >= first_seam || other >= first_seam ? height - slopes[i] * sqrt(dot_product(rotated, rotated)) : 0.0f;
      for (int c = 0; c < 3; ++c) sum[c] += fan_weights[i] * (rotated[c] - out * n[c] - e[c]);
    }
    for (int c = 0; c < 3; ++c) b[c * count + v] = (v < inner_count ? b[c * count + v] : 0.0f) + time * sum[c];
  }
}
