// SPDX-License-Identifier: MIT
// Filters on the surface: the Laplace operator, normals, noise. diffusion.cl solves equations with that operator.
//
// Vertices are those of the model's lattice (reconstruct/lattice.h). Their neighbours are found in two ways.
//   Inside a patch, by arithmetic. The table of rows has all inner rows of all patches (SurfaceRow). Columns wrap.
//   A kernel with "NDRange: rows" runs one work-group of any size per row, whose work-items take columns in turn.
//   At the ends of patches, by a table. The table of fan vertices (FanVertex) lists the vertices of the first and last
//   inner rows, the poles, the samples of seams and the corners. The table of fans has two ints for each triangle at
//   such a vertex that is not part of a quad between inner rows: the triangle's other two corners, counter-clockwise.
//   The triangles on both sides of a seam are in one fan. A kernel with "NDRange: fans" runs one work-group per
//   FAN_CHUNK vertices. It adds to what kernels over rows have written.
// Both diagonals of a quad count half each, so that the choice between them does not matter.
//
// A field has one plane of `count` floats per component, plane behind plane. Positions are a field of three, relative
// to the model's origin, in diagonals.
#include "surface_math.h"
#include "surface_structs.h"

// A triangle whose double area is below this share of half the sum of its squared edges counts as if it had that
// area: weights stay finite and equal at all three corners, and the operator stays positive.
#define LEAST_AREA 1.2e-4f

// Adds half the cotangent weights of the triangle (0, e, f) to the edges from 0 to e and to f, and its area to *area.
void add_triangle(const float ex, const float ey, const float ez, const float fx, const float fy, const float fz,
                  float* to_e, float* to_f, float* area) {
  const float nx = ey * fz - ez * fy, ny = ez * fx - ex * fz, nz = ex * fy - ey * fx;
  const float ee = ex * ex + ey * ey + ez * ez, ff = fx * fx + fy * fy + fz * fz, ef = ex * fx + ey * fy + ez * fz;
  const float twice = sqrt(nx * nx + ny * ny + nz * nz);
  const float scale = 0.25f / fmax(twice, fmax(LEAST_AREA * (ee + ff - ef), 1e-30f));
  *to_e += scale * (ff - ef);
  *to_f += scale * (ee - ef);
  *area += 0.5f * twice;
}

// Corner a of the quad a, b, c, d, given as b - a, c - a, d - a: both triangulations, half each.
// weights: of the edges to b, c, d
void weigh_corner(const float* restrict b, const float* restrict c, const float* restrict d, float* restrict weights,
                  float* restrict area) {
  add_triangle(b[0], b[1], b[2], c[0], c[1], c[2], weights, weights + 1, area);
  add_triangle(c[0], c[1], c[2], d[0], d[1], d[2], weights + 1, weights + 2, area);
  add_triangle(b[0], b[1], b[2], d[0], d[1], d[2], weights, weights + 2, area);
}

// The edges from the vertex in column j of a row to the eight around it, counter-clockwise from its right. Edges to
// rows that are no inner rows are those to the row itself.
void edges_around(__global const float* restrict points, const int count, const SurfaceRow row, const int j,
                  float e[8][3]) {
  const int here = row.first, v = here + j;
  const int before = row.has_before ? here - row.width : here, after = row.has_after ? here + row.width : here;
  const int left = j > 0 ? j - 1 : row.width - 1, right = j + 1 < row.width ? j + 1 : 0;
  edge_between(points, count, v, here + right, e[0]);
  edge_between(points, count, v, after + right, e[1]);
  edge_between(points, count, v, after + j, e[2]);
  edge_between(points, count, v, after + left, e[3]);
  edge_between(points, count, v, here + left, e[4]);
  edge_between(points, count, v, before + left, e[5]);
  edge_between(points, count, v, before + j, e[6]);
  edge_between(points, count, v, before + right, e[7]);
}

// Weights of four edges of a vertex in a row, one plane of `count` each: to its right, (0, +1), and to the next row, at
// (+1, -1), (+1, 0) and (+1, +1). Its other four edges are edges of its neighbours.
// NDRange: rows.
// in   points
// out  weights: four planes; mass: the vertex's share of the area; stiffness: the sum of its eight weights
__kernel void weigh_rows(const SurfaceParameters surface, __global const SurfaceRow* restrict rows,
                         __global const float* restrict points, __global float* restrict weights,
                         __global float* restrict mass, __global float* restrict stiffness) {
  const int k = get_group_id(0), count = surface.count;
  if (k >= surface.row_count) return;
  const SurfaceRow row = rows[k];
  const float has_before = row.has_before, has_after = row.has_after;
  for (int j = get_local_id(0); j < row.width; j += get_local_size(0)) {
    const int v = row.first + j;
    float e[8][3];
    edges_around(points, count, row, j, e);
    float w[4][3] = {{0.0f, 0.0f, 0.0f}, {0.0f, 0.0f, 0.0f}, {0.0f, 0.0f, 0.0f}, {0.0f, 0.0f, 0.0f}};
    float area_after = 0.0f, area_before = 0.0f;
    weigh_corner(e[0], e[1], e[2], w[0], &area_after);
    weigh_corner(e[2], e[3], e[4], w[1], &area_after);
    weigh_corner(e[4], e[5], e[6], w[2], &area_before);
    weigh_corner(e[6], e[7], e[0], w[3], &area_before);
    const float to_right = has_after * w[0][0] + has_before * w[3][2];
    const float to_left = has_after * w[1][2] + has_before * w[2][0];
    const float ahead = has_after * (w[0][2] + w[1][0]), ahead_right = has_after * w[0][1],
                ahead_left = has_after * w[1][1];
    const float behind = has_before * (w[2][2] + w[3][0] + w[2][1] + w[3][1]);
    weights[v] = to_right;
    weights[count + v] = ahead_left;
    weights[2 * count + v] = ahead;
    weights[3 * count + v] = ahead_right;
    mass[v] = (has_after * area_after + has_before * area_before) / 6.0f;
    stiffness[v] = to_right + to_left + ahead + ahead_right + ahead_left + behind;
  }
}

// Whether the edge between two vertices of one row (at least four wide, and wrapping) leads from v to its right.
int is_right(const int v, const int other) { return other == v + 1 || other < v - 1; }

// The same for the triangles of the fans. An edge along a row has all of its weight in `weights`.
// NDRange: fans.
// in          points
// out         fan_weights: two floats per triangle, of the edges to its two corners
// in and out  weights, mass, stiffness
__kernel void weigh_fans(const SurfaceParameters surface, __global const FanVertex* restrict fan_vertices,
                         __global const int* restrict fans, __global const float* restrict points,
                         __global float* restrict weights, __global float* restrict fan_weights,
                         __global float* restrict mass, __global float* restrict stiffness) {
  const int begin = get_group_id(0) * FAN_CHUNK, end = min(begin + FAN_CHUNK, surface.fan_count);
  for (int k = begin + (int)get_local_id(0); k < end; k += get_local_size(0)) {
    const int v = fan_vertices[k].vertex;
    float area = 0.0f, sum = 0.0f;
    for (int i = fan_vertices[k].begin; i < fan_vertices[k + 1].begin; ++i) {
      float e[3], f[3], to[2] = {0.0f, 0.0f};
      edge_between(points, surface.count, v, fans[2 * i], e);
      edge_between(points, surface.count, v, fans[2 * i + 1], f);
      add_triangle(e[0], e[1], e[2], f[0], f[1], f[2], to, to + 1, &area);
      sum += 2.0f * (to[0] + to[1]);
      for (int side = 0; side < 2; ++side) {
        const int other = fans[2 * i + side];
        const int is_in_row = v < surface.inner_count && other < surface.inner_count;
        fan_weights[2 * i + side] = is_in_row ? 0.0f : 2.0f * to[side];
        if (is_in_row && is_right(v, other)) weights[v] += 2.0f * to[side];
      }
    }
    mass[v] = (v < surface.inner_count ? mass[v] : 0.0f) + area / 3.0f;
    stiffness[v] = (v < surface.inner_count ? stiffness[v] : 0.0f) + sum;
  }
}

// The field at the vertices of the coarser lattice (edit/filter/coarsen.h). NDRange: those vertices.
// in   picks: per vertex there, the vertex here at its place; from     out  to
__kernel void pick_vertices(const SurfaceParameters surface, __global const int* restrict picks,
                            __global const float* restrict from, __global float* restrict to) {
  const int v = get_global_id(0);
  if (v >= surface.coarse_count) return;
  for (int c = 0; c < surface.components; ++c) to[c * surface.coarse_count + v] = from[c * surface.count + picks[v]];
}

// sum += share (e x f)
void add_cross(const float* restrict e, const float* restrict f, const float share, float* restrict sum) {
  sum[0] += share * (e[1] * f[2] - e[2] * f[1]);
  sum[1] += share * (e[2] * f[0] - e[0] * f[2]);
  sum[2] += share * (e[0] * f[1] - e[1] * f[0]);
}

void add_corner_vector(const float* restrict b, const float* restrict c, const float* restrict d, const float share,
                       float* restrict sum) {
  add_cross(b, c, share, sum);
  add_cross(c, d, share, sum);
  add_cross(b, d, share, sum);
}

// Each vertex's third of the area vectors around it, outward.
// NDRange: rows.
// in   points     out  vectors: field of three
__kernel void sum_row_vectors(const SurfaceParameters surface, __global const SurfaceRow* restrict rows,
                              __global const float* restrict points, __global float* restrict vectors) {
  const int k = get_group_id(0), count = surface.count;
  if (k >= surface.row_count) return;
  const SurfaceRow row = rows[k];
  const float after_share = row.has_after / 12.0f, before_share = row.has_before / 12.0f;
  for (int j = get_local_id(0); j < row.width; j += get_local_size(0)) {
    float e[8][3], sum[3] = {0.0f, 0.0f, 0.0f};
    edges_around(points, count, row, j, e);
    add_corner_vector(e[0], e[1], e[2], after_share, sum);
    add_corner_vector(e[2], e[3], e[4], after_share, sum);
    add_corner_vector(e[4], e[5], e[6], before_share, sum);
    add_corner_vector(e[6], e[7], e[0], before_share, sum);
    for (int c = 0; c < 3; ++c) vectors[c * count + row.first + j] = sum[c];
  }
}

// The same for the triangles of the fans.
// NDRange: fans.
// in   points     in and out  vectors
__kernel void sum_fan_vectors(const SurfaceParameters surface, __global const FanVertex* restrict fan_vertices,
                              __global const int* restrict fans, __global const float* restrict points,
                              __global float* restrict vectors) {
  const int begin = get_group_id(0) * FAN_CHUNK, end = min(begin + FAN_CHUNK, surface.fan_count);
  for (int k = begin + (int)get_local_id(0); k < end; k += get_local_size(0)) {
    const int v = fan_vertices[k].vertex;
    float sum[3] = {0.0f, 0.0f, 0.0f};
    for (int i = fan_vertices[k].begin; i < fan_vertices[k + 1].begin; ++i) {
      float e[3], f[3];
      edge_between(points, surface.count, v, fans[2 * i], e);
      edge_between(points, surface.count, v, fans[2 * i + 1], f);
      add_cross(e, f, 1.0f / 6.0f, sum);
    }
    for (int c = 0; c < 3; ++c)
      vectors[c * surface.count + v] = (v < surface.inner_count ? vectors[c * surface.count + v] : 0.0f) + sum[c];
  }
}

uint scramble(uint h) {
  h ^= h >> 16;
  h *= 0x7feb352du;
  h ^= h >> 15;
  h *= 0x846ca68bu;
  return h ^ (h >> 16);
}

// The slope at a point of the integer lattice, one of twelve (Perlin 2002), times the way from there.
float slope_times(const int x, const int y, const int z, const uint seed, const float fx, const float fy,
                  const float fz) {
  const uint h = scramble(scramble(scramble(scramble(seed) + (uint)x) + (uint)y) + (uint)z) % 12u;
  const float first = h < 8u ? fx : fy, second = h < 4u ? fy : fz;
  return (h & 1u ? -first : first) + (h & 2u ? -second : second);
}

// Gradient noise, about -1 .. 1, 0 at integer points, with two continuous derivatives.
float gradient_noise(const float x, const float y, const float z, const uint seed) {
  const float bx = floor(x), by = floor(y), bz = floor(z);
  const int ix = (int)bx, iy = (int)by, iz = (int)bz;
  const float fx = x - bx, fy = y - by, fz = z - bz;
  const float sx = fx * fx * fx * (fx * (fx * 6.0f - 15.0f) + 10.0f);
  const float sy = fy * fy * fy * (fy * (fy * 6.0f - 15.0f) + 10.0f);
  const float sz = fz * fz * fz * (fz * (fz * 6.0f - 15.0f) + 10.0f);
  float planes[2];
  for (int k = 0; k < 2; ++k) {
    const float gz = fz - (float)k;
    const float n00 = slope_times(ix, iy, iz + k, seed, fx, fy, gz),
                n10 = slope_times(ix + 1, iy, iz + k, seed, fx - 1.0f, fy, gz);
    const float n01 = slope_times(ix, iy + 1, iz + k, seed, fx, fy - 1.0f, gz),
                n11 = slope_times(ix + 1, iy + 1, iz + k, seed, fx - 1.0f, fy - 1.0f, gz);
    const float low = n00 + sx * (n10 - n00), high = n01 + sx * (n11 - n01);
    planes[k] = low + sy * (high - low);
  }
  return planes[0] + sz * (planes[1] - planes[0]);
}

// Noise at every vertex by its position: octaves, each of half the wavelength and half the height of the one before.
// NDRange: vertices.
// in   points     out  heights: field of one
__kernel void noise_at_points(const NoiseParameters noise, __global const float* restrict points,
                              __global float* restrict heights) {
  const int v = get_global_id(0);
  if (v >= noise.count) return;
  float sum = 0.0f, height = 1.0f, scale = noise.frequency;
  for (int octave = 0; octave < noise.octaves; ++octave) {
    sum += height * gradient_noise(scale * points[v], scale * points[noise.count + v],
                                   scale * points[2 * noise.count + v], noise.seed + (uint)octave);
    height *= 0.5f;
    scale *= 2.0f;
  }
  heights[v] = sum;
}
