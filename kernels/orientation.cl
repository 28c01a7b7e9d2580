// SPDX-License-Identifier: MIT
// Rotations, per vertex, from a surface to the mean orientation of its sources, and the right-hand side of the surface
// whose edges are so rotated (edit/morph/orientation.h). The head of filter.cl explains vertices, rows, fans and
// fields. A rotation is a unit quaternion: a field of four, w, x, y, z.
#include "surface_math.h"
#include "surface_structs.h"

#define LEAST_SINE 1e-3f       // of the angle between the two directions of a surface
#define LEAST_HALF_TURN 1e-3f  // 1 + cosine of the angle between two normals
// Cosines of half the angles up to which a rotation counts in full (50 degrees) and from which on it does not count
// (100 degrees). Larger rotations come from folds of the map between the surfaces.
#define FULL_COSINE 0.90630779f
#define LAST_COSINE 0.64278761f

void cross_product(const float* restrict e, const float* restrict f, float* restrict n) {
  n[0] = e[1] * f[2] - e[2] * f[1];
  n[1] = e[2] * f[0] - e[0] * f[2];
  n[2] = e[0] * f[1] - e[1] * f[0];
}

float dot_product(const float* restrict e, const float* restrict f) { return e[0] * f[0] + e[1] * f[1] + e[2] * f[2]; }

// product = p q
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

// The directions of a surface along and around its bone, at the vertex in column j of a row.
void directions_at(__global const float* restrict points, const int count, const SurfaceRow row, const int j,
                   float* restrict along, float* restrict around) {
  const int v = row.first + j;
  edge_between(points, count, row.has_before ? v - row.width : v, row.has_after ? v + row.width : v, along);
  edge_between(points, count, row.first + (j > 0 ? j - 1 : row.width - 1), row.first + (j + 1 < row.width ? j + 1 : 0),
               around);
}

// Unit normal of the directions along and around. Returns 0 where they have none.
int unit_normal(const float* restrict along, const float* restrict around, float* restrict n) {
  cross_product(along, around, n);
  const float area2 = dot_product(n, n);
  if (!(area2 > LEAST_SINE * LEAST_SINE * dot_product(along, along) * dot_product(around, around)) || !(area2 > 0.0f))
    return 0;
  const float scale = 1.0f / sqrt(area2);
  for (int i = 0; i < 3; ++i) n[i] *= scale;
  return 1;
}

// The rotation from a surface's directions to those of another one: the smallest that takes normal to normal, then the
// rotation about the normal that fits both unit directions best. The identity where a surface has no normal, or where
// the normals are opposite.
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

// Adds the rotations from a surface to a source, times the source's weights.
// NDRange: rows.
// in          facing: per row, the rotation by which the source is rotated first; weights: per vertex; points, source:
//             fields of three
// in and out  sums: field of four
__kernel void add_rotations(const SurfaceParameters surface, __global const SurfaceRow* restrict rows,
                            __global const float* restrict facing, __global const float* restrict weights,
                            __global const float* restrict points, __global const float* restrict source,
                            __global float* restrict sums) {
  const int k = get_group_id(0);
  if (k >= surface.row_count) return;
  const int here = rows[k].first, width = rows[k].width;
  float first[4];
  for (int i = 0; i < 4; ++i) first[i] = facing[4 * k + i];
  for (int j = get_local_id(0); j < width; j += get_local_size(0)) {
    const float weight = weights[here + j];
    if (weight == 0.0f) continue;
    float along[3], around[3], source_along[3], source_around[3], to_along[3], to_around[3], q[4];
    directions_at(points, surface.count, rows[k], j, along, around);
    directions_at(source, surface.count, rows[k], j, source_along, source_around);
    rotate_vector(first, source_along, to_along);
    rotate_vector(first, source_around, to_around);
    rotation_between(along, around, to_along, to_around, q);
    const float signed_weight = q[0] < 0.0f ? -weight : weight;
    for (int i = 0; i < 4; ++i) sums[i * surface.count + here + j] += signed_weight * q[i];
  }
}

// Unit normals of the inner vertices, 0 where they have none.
// NDRange: rows.
// in   points     out  normals: field of three
__kernel void row_normals(const SurfaceParameters surface, __global const SurfaceRow* restrict rows,
                          __global const float* restrict points, __global float* restrict normals) {
  const int k = get_group_id(0);
  if (k >= surface.row_count) return;
  const int here = rows[k].first, width = rows[k].width;
  for (int j = get_local_id(0); j < width; j += get_local_size(0)) {
    float along[3], around[3], n[3];
    directions_at(points, surface.count, rows[k], j, along, around);
    const int has_normal = unit_normal(along, around, n);
    for (int i = 0; i < 3; ++i) normals[i * surface.count + here + j] = has_normal ? n[i] : 0.0f;
  }
}

// Rotations of the inner vertices from their sums: of unit length, none beyond LAST_COSINE, scaled by their row's
// share. NDRange: rows. in   shares: per row     in and out  rotations
__kernel void settle_rotations(const SurfaceParameters surface, __global const SurfaceRow* restrict rows,
                               __global const float* restrict shares, __global float* restrict rotations) {
  const int k = get_group_id(0);
  if (k >= surface.row_count) return;
  const int here = rows[k].first, end = here + rows[k].width;
  for (int v = here + (int)get_local_id(0); v < end; v += get_local_size(0)) {
    float q[4];
    for (int i = 0; i < 4; ++i) q[i] = rotations[i * surface.count + v];
    const float length = fmax(sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]), 1e-6f);
    const float x = clamp((q[0] / length - LAST_COSINE) / (FULL_COSINE - LAST_COSINE), 0.0f, 1.0f);
    const float share = shares[k] * x * x * (3.0f - 2.0f * x);
    q[0] = 1.0f - share + share * q[0] / length;
    for (int i = 1; i < 4; ++i) q[i] *= share / length;
    const float scale = 1.0f / sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
    for (int i = 0; i < 4; ++i) rotations[i * surface.count + v] = scale * q[i];
  }
}

// The mean rotation of each vertex and its neighbours in the rows. Where a map folds, rotations jump from vertex to
// vertex, which would pull single vertices out of the surface.
// NDRange: rows.
__kernel void smooth_rotations(const SurfaceParameters surface, __global const SurfaceRow* restrict rows,
                               __global const float* restrict rotations, __global float* restrict smoothed) {
  const int k = get_group_id(0);
  if (k >= surface.row_count) return;
  const int here = rows[k].first, width = rows[k].width, has_before = rows[k].has_before, has_after = rows[k].has_after;
  for (int j = get_local_id(0); j < width; j += get_local_size(0)) {
    const int left = j > 0 ? j - 1 : width - 1, right = j + 1 < width ? j + 1 : 0;
    float sum[4] = {0.0f, 0.0f, 0.0f, 0.0f};
    for (int row = -has_before; row <= has_after; ++row)
      for (int i = 0; i < 4; ++i) {
        __global const float* restrict q = rotations + i * surface.count + here + row * width;
        sum[i] += q[left] + q[j] + q[right];
      }
    const float scale = 1.0f / sqrt(sum[0] * sum[0] + sum[1] * sum[1] + sum[2] * sum[2] + sum[3] * sum[3]);
    for (int i = 0; i < 4; ++i) smoothed[i * surface.count + here + j] = scale * sum[i];
  }
}

// Rotates the normals of the inner vertices.
// NDRange: rows.
// in   rotations     in and out  normals
__kernel void rotate_normals(const SurfaceParameters surface, __global const SurfaceRow* restrict rows,
                             __global const float* restrict rotations, __global float* restrict normals) {
  const int k = get_group_id(0);
  if (k >= surface.row_count) return;
  const int here = rows[k].first, end = here + rows[k].width;
  for (int v = here + (int)get_local_id(0); v < end; v += get_local_size(0)) {
    float q[4], n[3], rotated[3];
    for (int i = 0; i < 4; ++i) q[i] = rotations[i * surface.count + v];
    for (int i = 0; i < 3; ++i) n[i] = normals[i * surface.count + v];
    rotate_vector(q, n, rotated);
    for (int i = 0; i < 3; ++i) normals[i * surface.count + v] = rotated[i];
  }
}

// Sets the vertices in no row to the normalized mean of their neighbours in rows.
// NDRange: fans.
// in and out  field: of three or four components
__kernel void mean_at_ends(const SurfaceParameters surface, __global const FanVertex* restrict fan_vertices,
                           __global const int* restrict fans, __global float* restrict field) {
  const int begin = get_group_id(0) * FAN_CHUNK, end = min(begin + FAN_CHUNK, surface.fan_count);
  for (int k = begin + (int)get_local_id(0); k < end; k += get_local_size(0)) {
    const int v = fan_vertices[k].vertex;
    if (v < surface.inner_count) continue;
    float sum[4] = {0.0f, 0.0f, 0.0f, 0.0f};
    for (int i = fan_vertices[k].begin; i < fan_vertices[k + 1].begin; ++i)
      if (fans[2 * i] < surface.inner_count)
        for (int c = 0; c < surface.components; ++c) sum[c] += field[c * surface.count + fans[2 * i]];
    const float length = sqrt(sum[0] * sum[0] + sum[1] * sum[1] + sum[2] * sum[2] + sum[3] * sum[3]);
    for (int c = 0; c < surface.components; ++c) field[c * surface.count + v] = length > 1e-6f ? sum[c] / length : 0.0f;
  }
}

// The height of an edge over the plane that is normal to the mean of the normals at its ends.
// n: that mean, of unit length; 0 where there is none
float height_of(const int count, __global const float* restrict normals, const int v, const int other,
                const float* restrict e, float* restrict n) {
  for (int c = 0; c < 3; ++c) n[c] = normals[c * count + v] + normals[c * count + other];
  const float length = sqrt(dot_product(n, n));
  for (int c = 0; c < 3; ++c) n[c] = length > 0.1f ? n[c] / length : 0.0f;
  return dot_product(n, e);
}

// Adds the slopes of a source's edges in the fans, times the source's weights at their ends.
// NDRange: fans.
// in          weights: per vertex; source; normals: of the source
// in and out  slopes: two per triangle of the fans, height over length
__kernel void add_slopes(const SurfaceParameters surface, __global const FanVertex* restrict fan_vertices,
                         __global const int* restrict fans, __global const float* restrict weights,
                         __global const float* restrict source, __global const float* restrict normals,
                         __global float* restrict slopes) {
  const int begin = get_group_id(0) * FAN_CHUNK, end = min(begin + FAN_CHUNK, surface.fan_count);
  for (int k = begin + (int)get_local_id(0); k < end; k += get_local_size(0)) {
    const int v = fan_vertices[k].vertex;
    for (int i = 2 * fan_vertices[k].begin; i < 2 * fan_vertices[k + 1].begin; ++i) {
      float e[3], n[3];
      edge_between(source, surface.count, fans[i], v, e);
      const float height = height_of(surface.count, normals, v, fans[i], e, n), length = sqrt(dot_product(e, e));
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

// b = time (D - L x), where D is L x with every edge rotated by the mean of the rotations C at its ends:
// D(v) = sum of w (C(v) + C(other)) / 2 (x(v) - x(other)). This kernel does the edges between vertices of rows.
// NDRange: rows.
// in   weights: of the Laplace operator (filter.cl); rotations; points
// out  b: field of three
__kernel void pull_rows(const SurfaceParameters surface, __global const SurfaceRow* restrict rows,
                        __global const float* restrict weights, __global const float* restrict rotations,
                        __global const float* restrict points, __global float* restrict b) {
  const int k = get_group_id(0);
  if (k >= surface.row_count) return;
  const int here = rows[k].first, width = rows[k].width, has_before = rows[k].has_before, has_after = rows[k].has_after;
  for (int j = get_local_id(0); j < width; j += get_local_size(0)) {
    const int v = here + j, left = j > 0 ? j - 1 : width - 1, right = j + 1 < width ? j + 1 : 0;
    float m[9], sum[3] = {0.0f, 0.0f, 0.0f};
    matrix_of(rotations, surface.count, v, m);
    for (int row = -has_before; row <= has_after; ++row)
      for (int column = -1; column <= 1; ++column) {
        if (row == 0 && column == 0) continue;
        const int other = here + row * width + (column < 0 ? left : column > 0 ? right : j);
        // The edge's weight is stored at the vertex whose right or later row it leads to.
        const int is_ahead = row > 0 || (row == 0 && column > 0);
        const int plane = row == 0 ? 0 : 2 + row * column;
        const float w = weights[plane * surface.count + (is_ahead ? v : other)];
        float to[9], e[3];
        matrix_of(rotations, surface.count, other, to);
        edge_between(points, surface.count, other, v, e);
        for (int c = 0; c < 3; ++c)
          for (int i = 0; i < 3; ++i)
            sum[c] += w * (0.5f * (m[3 * c + i] + to[3 * c + i]) - (c == i ? 1.0f : 0.0f)) * e[i];
      }
    for (int c = 0; c < 3; ++c) b[c * surface.count + v] = surface.time * sum[c];
  }
}

// The same for the triangles of the fans. Edges that touch a seam (vertices from `first_seam` on) get the slopes of the
// sources.
// NDRange: fans.
// in   fan_weights; slopes; normals: of the rotated surface     in and out  b
__kernel void pull_fans(const SurfaceParameters surface, __global const FanVertex* restrict fan_vertices,
                        __global const int* restrict fans, __global const float* restrict fan_weights,
                        __global const float* restrict slopes, __global const float* restrict rotations,
                        __global const float* restrict normals, __global const float* restrict points,
                        __global float* restrict b) {
  const int begin = get_group_id(0) * FAN_CHUNK, end = min(begin + FAN_CHUNK, surface.fan_count);
  for (int k = begin + (int)get_local_id(0); k < end; k += get_local_size(0)) {
    const int v = fan_vertices[k].vertex;
    float m[9], sum[3] = {0.0f, 0.0f, 0.0f};
    matrix_of(rotations, surface.count, v, m);
    for (int i = 2 * fan_vertices[k].begin; i < 2 * fan_vertices[k + 1].begin; ++i) {
      const int other = fans[i];
      float to[9], e[3], rotated[3] = {0.0f, 0.0f, 0.0f}, n[3];
      matrix_of(rotations, surface.count, other, to);
      edge_between(points, surface.count, other, v, e);
      for (int c = 0; c < 3; ++c)
        for (int d = 0; d < 3; ++d) rotated[c] += 0.5f * (m[3 * c + d] + to[3 * c + d]) * e[d];
      const float height = height_of(surface.count, normals, v, other, rotated, n);
      const float out = v >= surface.first_seam || other >= surface.first_seam
                            ? height - slopes[i] * sqrt(dot_product(rotated, rotated))
                            : 0.0f;
      for (int c = 0; c < 3; ++c) sum[c] += fan_weights[i] * (rotated[c] - out * n[c] - e[c]);
    }
    for (int c = 0; c < 3; ++c)
      b[c * surface.count + v] = (v < surface.inner_count ? b[c * surface.count + v] : 0.0f) + surface.time * sum[c];
  }
}
