// SPDX-License-Identifier: MIT
// Points moved in space so that the flat triangles between them are nearer to the mesh: Gauss-Newton on distances.
//   read_samples             maps -> per quad of the lattice FIT_SAMPLES points of the mesh, and its normals there
//   choose_fitted_diagonals  points -> the decoder's diagonal of every quad
//   match_samples            samples -> their nearest points of the lattice
//   match_lattice            the middle of every triangle of the lattice -> its nearest point of the mesh
//   assemble                 both -> per texel its row of the linear system
//   relax_moves              one sweep of the solver over the texels of a colour
//   move_points              points a step nearer
// The quad of a texel lies to the right of it and above it; its corners are numbered 0 (the texel), 1 (right), 2 (right
// above), 3 (above). Its triangles are 0 1 2 and 0 2 3 with the first diagonal, 0 1 3 and 1 2 3 with the second.
// A residual is a distance along a normal, linear in the three corners of one triangle: r + n . sum of weight x move.
// So a texel is coupled to the eight around it by symmetric 3 x 3 blocks w n n^T. Rows 0 and height-1 stay. Planes have
// the texture's size; several of them lie behind each other in one buffer. Only the system's rows hold what belongs to
// a texel side by side: a sweep reads every fourth of them or so. Sums are taken per texel over what lies around it, in
// a fixed order: nothing depends on the order of work-items.
#include "fit_structs.h"
#include "map_triangle.h"
#include "mesh_walk.h"
#include "patch_texels.h"
#include "quad_corners.h"
#include "quad_diagonal.h"
#include "skeletex_structs.h"

#define LARGEST_STEP 0.25f  // cells
#define LARGEST_MOVE 1.0f   // cells, of all steps together, off the lattice
#define LARGEST_SLIDE 0.5f  // distances to the nearer neighbours, of all steps together, along the lattice

// A texel, where it lies in its patch, and that; no patch between rectangles.
typedef struct TexelPlace {
  int texel, column, row;
  global const PatchRecord* patch;
} TexelPlace;

// NDRange (texture width, texture height) of all kernels: the texel of a work-item; -1 beyond the texture.
TexelPlace texel_of_item(FitParameters p, global const int* texel_patches, global const PatchRecord* patches) {
  const int column = (int)get_global_id(0), line = (int)get_global_id(1);
  TexelPlace place = {-1, column, line, 0};
  if (column >= p.texture_width || line >= p.texture_height) return place;
  place.texel = line * p.texture_width + column;
  if (texel_patches[place.texel] < 0) return place;
  place.patch = patches + texel_patches[place.texel];
  place.column -= place.patch->x, place.row -= place.patch->y;
  return place;
}

// Whether a texel has a quad.
int has_quad(TexelPlace place) { return place.patch != 0 && place.row <= place.patch->height - 2; }

// A sample has a fixed place in its quad; where that is in the map follows from the reading positions of the quad's
// corners, and from there a walk leads to the triangle that covers it.
// in       offsets: of reading positions, two planes; numbers: FIT_COVERING
// out      samples: FIT_SAMPLES x SAMPLE_PLANES planes; numbers: FIT_TRIANGLES
kernel void read_samples(const FitParameters p, global const int* restrict texel_patches,
                         global const PatchRecord* restrict patches, global const int* restrict triangles,
                         global const float* restrict values, global const float* restrict offsets,
                         global const float* restrict points, global int* restrict numbers,
                         global float* restrict samples) {
  const TexelPlace place = texel_of_item(p, texel_patches, patches);
  const int texel = place.texel, row = place.row, inner = place.column, size = p.texture_width * p.texture_height;
  if (texel < 0) return;
  global int* sample_triangles = numbers + FIT_TRIANGLES * size;
  for (int i = 0; i < SAMPLE_PLANES * FIT_SAMPLES; ++i) samples[i * size + texel] = 0.0f;
  for (int i = 0; i < FIT_SAMPLES; ++i) sample_triangles[i * size + texel] = NO_TRIANGLE;
  if (!has_quad(place)) return;
  const Maps maps = maps_of(p.maps, triangles, values);
  const Planes from = planes_of(points, size);
  global const float *offset_x = offsets, *offset_y = offsets + size;
  global const PatchRecord* patch = place.patch;
  int at[4];
  corners_of_quad(patch, p.texture_width, inner, row, at);
  int t = numbers[FIT_COVERING * size + (row == 0 ? at[3] : texel)];
  if (t == NO_TRIANGLE) return;
  const Point normal = cross_of(minus(point_at(from, at[2]), point_at(from, at[0])),
                                minus(point_at(from, at[3]), point_at(from, at[1])));
  const float share = 0.5f * sqrt(product(normal, normal)) / (float)FIT_SAMPLES;
  for (int i = 0; i < FIT_SAMPLES; ++i) {
    const float s = sample_s(i), q = sample_t(i);
    const float dx = s + (1.0f - q) * ((1.0f - s) * offset_x[at[0]] + s * offset_x[at[1]]) +
                     q * ((1.0f - s) * offset_x[at[3]] + s * offset_x[at[2]]);
    const float dy = q + (1.0f - q) * ((1.0f - s) * offset_y[at[0]] + s * offset_y[at[1]]) +
                     q * ((1.0f - s) * offset_y[at[3]] + s * offset_y[at[2]]);
    const int rows_up = clamp((int)floor(dy), -row, patch->height - 2 - row);
    CornerWeights w = {0.0f, 0.0f};
    for (int steps = 0; steps < 1000; ++steps) {
      const MapTriangle m = load_triangle(maps, t);
      const float u = row_offset(m, maps, patch->row_begin + row + rows_up, clamp(dy - (float)rows_up, 0.0f, 1.0f));
      w = weights_at(m, u, turned_offset(m, inner, dx, patch->width));
      const float w0 = 1.0f - w.w1 - w.w2;
      const float least = fmin(w0, fmin(w.w1, w.w2));
      if (!(least < -1e-6f)) break;
      const int next = maps.across[(least == w0 ? 0 : least == w.w1 ? 1 : 2) * maps.triangle_count + t];
      if (next < 0) break;
      t = next;
    }
    float w1 = fmax(0.0f, w.w1), w2 = fmax(0.0f, w.w2);
    const float sum = w1 + w2;
    if (sum > 1.0f) w1 /= sum, w2 /= sum;
    const Point a = point_at(maps.vertices, maps.corners[t]);
    const Point b = point_at(maps.vertices, maps.corners[maps.triangle_count + t]);
    const Point c = point_at(maps.vertices, maps.corners[2 * maps.triangle_count + t]);
    const Point n = cross_of(minus(b, a), minus(c, a));
    const float length2 = product(n, n);
    const float inverse = length2 > 0.0f ? rsqrt(length2) : 0.0f;
    const int plane = SAMPLE_PLANES * i * size + texel;
    samples[plane] = a.x + w1 * (b.x - a.x) + w2 * (c.x - a.x);
    samples[plane + size] = a.y + w1 * (b.y - a.y) + w2 * (c.y - a.y);
    samples[plane + 2 * size] = a.z + w1 * (b.z - a.z) + w2 * (c.z - a.z);
    samples[plane + 3 * size] = n.x * inverse;
    samples[plane + 4 * size] = n.y * inverse;
    samples[plane + 5 * size] = n.z * inverse;
    samples[plane + 6 * size] = share;
    sample_triangles[i * size + texel] = t;
  }
}

// The decoder's choice; next to seams and poles, where it makes strips, the shorter diagonal.
// out  numbers: FIT_DIAGONALS
kernel void choose_fitted_diagonals(const FitParameters p, global const int* restrict texel_patches,
                                    global const PatchRecord* restrict patches, global const float* restrict points,
                                    global int* restrict numbers) {
  const TexelPlace place = texel_of_item(p, texel_patches, patches);
  const int texel = place.texel, row = place.row, inner = place.column, size = p.texture_width * p.texture_height;
  if (texel < 0) return;
  global int* diagonals = numbers + FIT_DIAGONALS * size;
  diagonals[texel] = 0;
  if (!has_quad(place)) return;
  const Planes from = planes_of(points, size);
  global const PatchRecord* patch = place.patch;
  int at[4];
  corners_of_quad(patch, p.texture_width, inner, row, at);
  if (row == 0 || row == patch->height - 2) {
    const Point first = minus(point_at(from, at[2]), point_at(from, at[0])),
                second = minus(point_at(from, at[3]), point_at(from, at[1]));
    diagonals[texel] = product(second, second) < product(first, first);
    return;
  }
  const int has_before = row > 1, has_after = row + 2 < patch->height - 1;
  int around[4][4];
  for (int i = 0; i < 4; ++i) {
    const int beside = inner + i - 1;
    const int base = texel_at(patch, p.texture_width, beside >= patch->width ? beside - patch->width : beside, row);
    around[0][i] = base - (has_before ? p.texture_width : 0);
    around[1][i] = base;
    around[2][i] = base + p.texture_width;
    around[3][i] = base + (has_after ? 2 : 1) * p.texture_width;
  }
  diagonals[texel] = takes_second_if_smoother(around, has_before, has_after, from);
}

// The point of a quad that is nearest to p: its triangle and weights. Returns the squared distance.
float nearest_of_quad(Point p, const int at[4], int is_second, Planes points, int* triangle, float w[3]) {
  float best = INFINITY;
  for (int t = 0; t < 2; ++t) {
    float own[3];
    const float distance2 = nearest_of_triangle(p, point_at(points, at[corner_of(is_second, t, 0)]),
                                                point_at(points, at[corner_of(is_second, t, 1)]),
                                                point_at(points, at[corner_of(is_second, t, 2)]), own);
    if (distance2 < best) {
      best = distance2;
      *triangle = t;
      w[0] = own[0], w[1] = own[1], w[2] = own[2];
    }
  }
  return best;
}

// Every sample's nearest point of its own quad, or of those beside it where that lies on a side.
// out  numbers: FIT_MATCHES; -1: none, else (1 + quads to the right) + 4 (1 + quads up) + 16 triangle
//      matched: weights and residuals along the normal; FIT_COSTS: distance x area, summed over the samples of the
//      quad; FIT_AREAS: the sum of their areas
kernel void match_samples(const FitParameters p, global const int* restrict texel_patches,
                          global const PatchRecord* restrict patches, global const float* restrict samples,
                          global const float* restrict points, global int* restrict numbers,
                          global float* restrict matched) {
  const TexelPlace place = texel_of_item(p, texel_patches, patches);
  const int texel = place.texel, row = place.row, inner = place.column, size = p.texture_width * p.texture_height;
  if (texel < 0) return;
  global const int* diagonals = numbers + FIT_DIAGONALS * size;
  global int* matches = numbers + FIT_MATCHES * size;
  matched[FIT_COSTS * size + texel] = 0.0f, matched[FIT_AREAS * size + texel] = 0.0f;
  for (int i = 0; i < FIT_SAMPLES; ++i) matches[i * size + texel] = -1;
  if (!has_quad(place)) return;
  const Planes from = planes_of(points, size);
  global const PatchRecord* patch = place.patch;
  float cost = 0.0f, area = 0.0f;
  for (int i = 0; i < FIT_SAMPLES; ++i) {
    const int plane = SAMPLE_PLANES * i * size + texel;
    const Point n = {samples[plane + 3 * size], samples[plane + 4 * size], samples[plane + 5 * size]};
    if (n.x == 0.0f && n.y == 0.0f && n.z == 0.0f) continue;
    const Point sample = {samples[plane], samples[plane + size], samples[plane + 2 * size]};
    int at[4], triangle = 0, right = 0, up = 0;
    float w[3];
    corners_of_quad(patch, p.texture_width, inner, row, at);
    int is_second = diagonals[texel];
    float best = nearest_of_quad(sample, at, is_second, from, &triangle, w);
    // The sides that the nearest point lies on.
    int is_left = 1, is_right = 1, is_below = 1, is_above = 1;
    for (int k = 0; k < 3; ++k) {
      const int c = corner_of(is_second, triangle, k);
      if (w[k] == 0.0f) continue;
      if (corner_right(c))
        is_left = 0;
      else
        is_right = 0;
      if (corner_up(c))
        is_below = 0;
      else
        is_above = 0;
    }
    const int side = is_right - is_left, rise = is_above - is_below;
    for (int k = 1; k < 4; ++k) {
      const int dx = k & 1 ? side : 0, dy = k & 2 ? rise : 0;
      if ((k & 1 && side == 0) || (k & 2 && rise == 0) || row + dy < 0 || row + dy > patch->height - 2) continue;
      const int beside = inner + dx < 0               ? inner + dx + patch->width
                         : inner + dx >= patch->width ? inner + dx - patch->width
                                                      : inner + dx;
      int other[4], other_triangle = 0;
      float other_w[3];
      corners_of_quad(patch, p.texture_width, beside, row + dy, other);
      const int other_second = diagonals[other[0]];
      const float distance2 = nearest_of_quad(sample, other, other_second, from, &other_triangle, other_w);
      if (distance2 < best) {
        best = distance2;
        right = dx, up = dy, triangle = other_triangle, is_second = other_second;
        for (int c = 0; c < 4; ++c) at[c] = other[c];
        for (int c = 0; c < 3; ++c) w[c] = other_w[c];
      }
    }
    const Point nearest = weighted(w, point_at(from, at[corner_of(is_second, triangle, 0)]),
                                   point_at(from, at[corner_of(is_second, triangle, 1)]),
                                   point_at(from, at[corner_of(is_second, triangle, 2)]));
    matches[i * size + texel] = (1 + right) + 4 * (1 + up) + 16 * triangle;
    matched[MATCH_PLANES * i * size + texel] = w[1];
    matched[(MATCH_PLANES * i + 1) * size + texel] = w[2];
    matched[(MATCH_PLANES * i + 2) * size + texel] = product(n, minus(nearest, sample));
    cost += samples[plane + 6 * size] * sqrt(best);
    area += samples[plane + 6 * size];
  }
  matched[FIT_COSTS * size + texel] = cost;
  matched[FIT_AREAS * size + texel] = area;
}

// From the middle of each triangle a walk over the mesh, from a triangle that is read near it.
// out  lattice: per triangle LATTICE_PLANES planes; matched: the triangles add to FIT_COSTS and FIT_AREAS
kernel void match_lattice(const FitParameters p, global const int* restrict texel_patches,
                          global const PatchRecord* restrict patches, global const int* restrict triangles,
                          global const float* restrict values, global const int* restrict numbers,
                          global const float* restrict points, global float* restrict lattice,
                          global float* restrict matched) {
  const TexelPlace place = texel_of_item(p, texel_patches, patches);
  const int texel = place.texel, size = p.texture_width * p.texture_height;
  if (texel < 0) return;
  lattice[texel] = 0.0f, lattice[LATTICE_PLANES * size + texel] = 0.0f;
  if (!has_quad(place)) return;
  const Maps maps = maps_of(p.maps, triangles, values);
  const Planes from = planes_of(points, size);
  global const int* sample_triangles = numbers + FIT_TRIANGLES * size;
  int at[4];
  corners_of_quad(place.patch, p.texture_width, place.column, place.row, at);
  const int is_second = numbers[FIT_DIAGONALS * size + texel];
  for (int i = 0; i < 2; ++i) {
    const int t = sample_triangles[(is_second ? (i == 0 ? 0 : 3) : (i == 0 ? 1 : 2)) * size + texel];
    if (t == NO_TRIANGLE) continue;
    const Point a = point_at(from, at[corner_of(is_second, i, 0)]), b = point_at(from, at[corner_of(is_second, i, 1)]),
                c = point_at(from, at[corner_of(is_second, i, 2)]);
    const float third[3] = {1.0f / 3.0f, 1.0f / 3.0f, 1.0f / 3.0f};
    const Point middle = weighted(third, a, b, c);
    const Point own = cross_of(minus(b, a), minus(c, a));
    const float area = 0.5f * sqrt(product(own, own));
    float w[3];
    Point nearest = middle, normal = own;
    int end = t;
    const float best = walk_over_mesh(middle, maps, &end, &nearest, &normal, w);
    // On a side or at a corner the way to the point is the direction; within a triangle that is its normal.
    const Point gap = minus(middle, nearest);
    const float distance = sqrt(best);
    const int is_inside = w[0] > 0.0f && w[1] > 0.0f && w[2] > 0.0f;
    const float length2 = product(normal, normal);
    const float normal_scale = length2 > 0.0f ? rsqrt(length2) : 0.0f;
    const int takes_gap = !is_inside && best > 1e-6f * area;
    const float scale = takes_gap ? 1.0f / distance : normal_scale;
    const Point direction = takes_gap ? gap : normal;
    const int plane = LATTICE_PLANES * i * size + texel;
    lattice[plane] = area;
    lattice[plane + size] = scale * product(direction, gap);
    lattice[plane + 2 * size] = scale * direction.x;
    lattice[plane + 3 * size] = scale * direction.y;
    lattice[plane + 4 * size] = scale * direction.z;
    matched[FIT_COSTS * size + texel] += area * distance;
    matched[FIT_AREAS * size + texel] += area;
  }
}

typedef struct System {
  float own[6], side[3], ahead[4][6];
} System;

// What one residual adds to the row of a texel. `own` is the texel's number among the triangle's corners, `quad_x`,
// `quad_y` where the quad lies from the texel.
void add_residual(System* s, float weight, float residual, Point n, const float w[3], int is_second, int triangle,
                  int own, int quad_x, int quad_y) {
  const float block[6] = {n.x * n.x, n.x * n.y, n.x * n.z, n.y * n.y, n.y * n.z, n.z * n.z};
  const float pull = weight * w[own];
  for (int i = 0; i < 6; ++i) s->own[i] += pull * w[own] * block[i];
  s->side[0] -= pull * residual * n.x;
  s->side[1] -= pull * residual * n.y;
  s->side[2] -= pull * residual * n.z;
  for (int k = 0; k < 3; ++k) {
    const int c = corner_of(is_second, triangle, k);
    const int dx = quad_x + corner_right(c), dy = quad_y + corner_up(c);
    const int is_ahead = dy == 1 || (dy == 0 && dx == 1);
    if (k == own || !is_ahead) continue;
    const int which = dy == 0 ? 0 : dx + 2;
    for (int i = 0; i < 6; ++i) s->ahead[which][i] += pull * w[k] * block[i];
  }
}

// Texels ahead are those at (right, up) = (1, 0), (-1, 1), (0, 1), (1, 1).
// out  system: SYSTEM_STRIDE floats per texel
kernel void assemble(const FitParameters p, global const int* restrict texel_patches,
                     global const PatchRecord* restrict patches, global const float* restrict samples,
                     global const int* restrict numbers, global const float* restrict matched,
                     global const float* restrict lattice, global float* restrict system) {
  const TexelPlace place = texel_of_item(p, texel_patches, patches);
  const int texel = place.texel, row = place.row, inner = place.column, size = p.texture_width * p.texture_height;
  if (texel < 0) return;
  const int texture_width = p.texture_width;
  const float least_residual = p.least_residual;
  global const int *diagonals = numbers + FIT_DIAGONALS * size, *matches = numbers + FIT_MATCHES * size;
  global const PatchRecord* patch = place.patch;
  System s;
  for (int i = 0; i < 6; ++i) s.own[i] = 0.0f;
  for (int i = 0; i < 3; ++i) s.side[i] = 0.0f;
  for (int k = 0; k < 4; ++k)
    for (int i = 0; i < 6; ++i) s.ahead[k][i] = 0.0f;
  if (has_quad(place) && row >= 1) {
    for (int qy = -2; qy <= 1; ++qy) {
      if (row + qy < 0 || row + qy > patch->height - 2) continue;
      for (int qx = -2; qx <= 1; ++qx) {
        const int quad = texel_at(patch, texture_width, inner + qx, row + qy);
        for (int i = 0; i < FIT_SAMPLES; ++i) {
          const int match = matches[i * size + quad];
          if (match < 0) continue;
          const int tx = qx + (match & 3) - 1, ty = qy + ((match >> 2) & 3) - 1, triangle = match >> 4;
          if (tx < -1 || tx > 0 || ty < -1 || ty > 0) continue;
          const int is_second = diagonals[texel_at(patch, texture_width, inner + tx, row + ty)];
          const float w1 = matched[MATCH_PLANES * i * size + quad], w2 = matched[(MATCH_PLANES * i + 1) * size + quad];
          const float w[3] = {1.0f - w1 - w2, w1, w2};
          const int corner = ty == 0 ? -tx : tx == 0 ? 3 : 2;
          for (int k = 0; k < 3; ++k) {
            if (corner_of(is_second, triangle, k) != corner) continue;
            const int plane = SAMPLE_PLANES * i * size + quad;
            const Point n = {samples[plane + 3 * size], samples[plane + 4 * size], samples[plane + 5 * size]};
            const float residual = matched[(MATCH_PLANES * i + 2) * size + quad];
            add_residual(&s, samples[plane + 6 * size] / (fabs(residual) + least_residual), residual, n, w, is_second,
                         triangle, k, tx, ty);
          }
        }
      }
    }
    const float third[3] = {1.0f / 3.0f, 1.0f / 3.0f, 1.0f / 3.0f};
    for (int ty = -1; ty <= 0; ++ty)
      for (int tx = -1; tx <= 0; ++tx) {
        const int quad = texel_at(patch, texture_width, inner + tx, row + ty);
        const int is_second = diagonals[quad], corner = ty == 0 ? -tx : tx == 0 ? 3 : 2;
        for (int triangle = 0; triangle < 2; ++triangle) {
          const int plane = LATTICE_PLANES * triangle * size + quad;
          const float area = lattice[plane];
          if (area == 0.0f) continue;
          for (int k = 0; k < 3; ++k) {
            if (corner_of(is_second, triangle, k) != corner) continue;
            const float residual = lattice[plane + size];
            const Point n = {lattice[plane + 2 * size], lattice[plane + 3 * size], lattice[plane + 4 * size]};
            add_residual(&s, area / (fabs(residual) + least_residual), residual, n, third, is_second, triangle, k, tx,
                         ty);
          }
        }
      }
  }
  global float* restrict row_of_texel = system + (size_t)SYSTEM_STRIDE * texel;
  for (int i = 0; i < 6; ++i) row_of_texel[i] = s.own[i];
  for (int i = 0; i < 3; ++i) row_of_texel[6 + i] = s.side[i];
  for (int k = 0; k < 4; ++k)
    for (int i = 0; i < 6; ++i) row_of_texel[9 + 6 * k + i] = s.ahead[k][i];
}

// side -= block x move
void subtract_block(float side[3], global const float* restrict b, Point move) {
  side[0] -= b[0] * move.x + b[1] * move.y + b[2] * move.z;
  side[1] -= b[1] * move.x + b[3] * move.y + b[4] * move.z;
  side[2] -= b[2] * move.x + b[4] * move.y + b[5] * move.z;
}

float mean_entry(global const float* restrict own) { return (own[0] + own[3] + own[5]) / 3.0f; }

// Every texel of a colour takes the move that solves its own row, the others standing: block Gauss-Seidel. To its row
// come damping, and springs between its move and those of its four neighbours.
kernel void relax_moves(const FitParameters p, global const int* restrict texel_patches,
                        global const PatchRecord* restrict patches, global const float* restrict system,
                        global float* restrict moves) {
  const TexelPlace place = texel_of_item(p, texel_patches, patches);
  const int texel = place.texel, row = place.row, inner = place.column, size = p.texture_width * p.texture_height;
  if (texel < 0 || !has_quad(place) || row < 1 || colour_of(inner, row, place.patch->width) != p.colour) return;
  const Planes others = planes_of(moves, size);
  global const float* restrict own = system + (size_t)SYSTEM_STRIDE * texel;
  const float entry = mean_entry(own);
  if (!(entry > 0.0f)) return;
  float h[6], side[3];
  for (int i = 0; i < 6; ++i) h[i] = own[i];
  for (int i = 0; i < 3; ++i) side[i] = own[6 + i];
  float added = p.damping * entry;
  for (int dy = -1; dy <= 1; ++dy)
    for (int dx = -1; dx <= 1; ++dx) {
      if (dx == 0 && dy == 0) continue;
      const int other = texel_at(place.patch, p.texture_width, inner + dx, row + dy);
      const Point move = point_at(others, other);
      const int is_ahead = dy == 1 || (dy == 0 && dx == 1);
      const int which = dy == 0 ? 0 : is_ahead ? dx + 2 : 2 - dx;
      global const float* restrict beside = system + (size_t)SYSTEM_STRIDE * other;
      subtract_block(side, (is_ahead ? own : beside) + 9 + 6 * which, move);
      if (dx != 0 && dy != 0) continue;
      const float spring = 0.5f * p.springs * (entry + mean_entry(beside));
      added += spring;
      side[0] += spring * move.x, side[1] += spring * move.y, side[2] += spring * move.z;
    }
  h[0] += added, h[3] += added, h[5] += added;
  const float c00 = h[3] * h[5] - h[4] * h[4], c01 = h[2] * h[4] - h[1] * h[5], c02 = h[1] * h[4] - h[2] * h[3];
  const float c11 = h[0] * h[5] - h[2] * h[2], c12 = h[1] * h[2] - h[0] * h[4], c22 = h[0] * h[3] - h[1] * h[1];
  const float determinant = h[0] * c00 + h[1] * c01 + h[2] * c02;
  if (!(determinant > 0.0f)) return;
  const Point move = {(c00 * side[0] + c01 * side[1] + c02 * side[2]) / determinant,
                      (c01 * side[0] + c11 * side[1] + c12 * side[2]) / determinant,
                      (c02 * side[0] + c12 * side[1] + c22 * side[2]) / determinant};
  set_point(mutable_planes_of(moves, size), texel, move);
}

// Steps and moves are limited to parts of a cell: the root of the mean area of the four quads around, at the start.
kernel void move_points(const FitParameters p, global const int* restrict texel_patches,
                        global const PatchRecord* restrict patches, global const float* restrict starts,
                        global const float* restrict points, global const float* restrict moves,
                        global float* restrict moved) {
  const TexelPlace place = texel_of_item(p, texel_patches, patches);
  const int texel = place.texel, row = place.row, inner = place.column, size = p.texture_width * p.texture_height;
  if (texel < 0) return;
  const int texture_width = p.texture_width;
  const Planes begin = planes_of(starts, size);
  const Point from = point_at(planes_of(points, size), texel);
  set_point(mutable_planes_of(moved, size), texel, from);
  if (!has_quad(place) || row < 1) return;
  global const PatchRecord* patch = place.patch;
  const Point move = point_at(planes_of(moves, size), texel);
  const float step2 = product(move, move);
  if (!(step2 > 0.0f && step2 < INFINITY)) return;
  float area = 0.0f;
  for (int k = 0; k < 4; ++k) {
    int at[4];
    const int beside = k & 1 ? (inner > 0 ? inner - 1 : patch->width - 1) : inner;
    corners_of_quad(patch, texture_width, beside, row - (k >> 1), at);
    const Point n = cross_of(minus(point_at(begin, at[2]), point_at(begin, at[0])),
                             minus(point_at(begin, at[3]), point_at(begin, at[1])));
    area += 0.125f * sqrt(product(n, n));
  }
  const float cell = sqrt(area);
  const float kept = p.share * fmin(1.0f, LARGEST_STEP * cell / sqrt(step2));
  const Point start = point_at(begin, texel);
  const Point total = {from.x - start.x + kept * move.x, from.y - start.y + kept * move.y,
                       from.z - start.z + kept * move.z};
  // Off the lattice a cell at most, along it less than what would bring neighbours together.
  const int left = texel_at(patch, texture_width, inner - 1, row),
            right = texel_at(patch, texture_width, inner + 1, row);
  const Point around = minus(point_at(begin, right), point_at(begin, left));
  const Point along = minus(point_at(begin, texel + texture_width), point_at(begin, texel - texture_width));
  const Point normal = cross_of(along, around);
  const float normal2 = product(normal, normal);
  const float off = normal2 > 0.0f ? product(total, normal) / normal2 : 0.0f;
  const Point slide = {total.x - off * normal.x, total.y - off * normal.y, total.z - off * normal.z};
  const float slid = sqrt(product(slide, slide)),
              most = 0.5f * LARGEST_SLIDE * sqrt(fmin(product(around, around), product(along, along)));
  const float share = slid > most ? most / slid : 1.0f;
  const float height = fabs(off) * sqrt(normal2);
  const float rise = height > LARGEST_MOVE * cell ? off * LARGEST_MOVE * cell / height : off;
  const Point end = {start.x + rise * normal.x + share * slide.x, start.y + rise * normal.y + share * slide.y,
                     start.z + rise * normal.z + share * slide.z};
  set_point(mutable_planes_of(moved, size), texel, end);
}
