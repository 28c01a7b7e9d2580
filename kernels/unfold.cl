// SPDX-License-Identifier: MIT
// Where the map turns sharply, a lattice that is even in the map folds in space although the map does not. Passes of
//   find_folds   marks the texels around quads that look against the surface
//   relax_folds  marked texels read nearer to their neighbours' mean, or go back to their own places
// Reading positions are offsets from the texel's own place in cells, two planes over the texture, x around, y along. Rows 0 and
// height-1 stay. A texel changes its own offset alone, and looks at its neighbours' points, which change between the passes: nothing
// depends on the order of work-items.
#include "skeletex_structs.h"
#include "map_triangle.h"
#include "patch_texels.h"

#define LEAST_COSINE 0.1f      // between a triangle and the surface
#define LEAST_AGREEMENT 0.8f   // squared length of the mean of the normals around; less is an edge of the surface, no fold of the lattice
#define FURTHEST 1.0f          // cells from a texel's own place, along each axis
#define LARGEST_STEP 0.4f      // cells
#define MARGIN 0.3f            // cells that the rows next to a seam or pole keep from it

float3 point_at(global const float* restrict x, global const float* restrict y, global const float* restrict z, int i) { return (float3)(x[i], y[i], z[i]); }

int is_turned(float3 a, float3 b, float3 c, float3 direction) {
  const float3 n = cross(b - a, c - a);
  return dot(n, direction) < LEAST_COSINE * sqrt(dot(n, n) * dot(direction, direction));
}

// NDRange (texture width, texture height): the quad to the right of and above a texel. It is folded when for both diagonals a
// triangle looks against the surface, whose normal is the mean of those of the triangles that the texels' places lie in. The 16
// texels around a folded quad are marked. Quads without a texel that `can_move` are not looked at.
kernel void find_folds(const int texture_width, const int texture_height, const int triangle_count, global const int* restrict texel_patches,
                       global const PatchRecord* restrict patches, global const int* restrict texel_triangles, global const int* restrict corners,
                       global const float* restrict vertex_x, global const float* restrict vertex_y, global const float* restrict vertex_z,
                       global const float* restrict x, global const float* restrict y, global const float* restrict z, global const int* restrict can_move,
                       global int* restrict is_marked, global int* restrict fold_count) {
  const int across = (int)get_global_id(0), line = (int)get_global_id(1);
  if (across >= texture_width || line >= texture_height) return;
  const int texel = line * texture_width + across;
  const int patch = texel_patches[texel];
  if (patch < 0) return;
  global const PatchRecord* p = patches + patch;
  const int column = across - p->x, row = line - p->y;
  if (row > p->height - 2) return;
  const int at[4] = {texel, texel_at(p, texture_width, column + 1, row), texel_at(p, texture_width, column + 1, row + 1), texel + texture_width};
  if (!(can_move[at[0]] | can_move[at[1]] | can_move[at[2]] | can_move[at[3]])) return;
  float3 normal = (float3)(0.0f), q[4];
  float normals = 0.0f;
  for (int i = 0; i < 4; ++i) {
    q[i] = point_at(x, y, z, at[i]);
    const int t = texel_triangles[at[i]], at_row = row + (i >= 2);
    if (t == NO_TRIANGLE || at_row == 0 || at_row == p->height - 1) continue;
    const float3 a = point_at(vertex_x, vertex_y, vertex_z, corners[t]);
    const float3 n = cross(point_at(vertex_x, vertex_y, vertex_z, corners[triangle_count + t]) - a,
                           point_at(vertex_x, vertex_y, vertex_z, corners[2 * triangle_count + t]) - a);
    const float length2 = dot(n, n);
    if (length2 > 0.0f) normal += n / sqrt(length2), normals += 1.0f;
  }
  if (normals == 0.0f || dot(normal, normal) < LEAST_AGREEMENT * normals * normals) return;
  if (!is_turned(q[0], q[1], q[2], normal) && !is_turned(q[0], q[2], q[3], normal)) return;
  if (!is_turned(q[0], q[1], q[3], normal) && !is_turned(q[1], q[2], q[3], normal)) return;
  atomic_inc(fold_count);
  for (int i = -1; i <= 2; ++i)
    for (int j = -1; j <= 2; ++j)
      if (row + i >= 1 && row + i <= p->height - 2) is_marked[texel_at(p, texture_width, column + j, row + i)] = 1;
}

// NDRange (texture width, texture height). Marked texels move towards the mean of their four neighbours, by the least-squares step in
// the lattice's own directions; with `is_back` they return to their places. What is to be read again gets the triangle of its place in
// `walkers`, all else none. Marks are taken off.
kernel void relax_folds(const int texture_width, const int texture_height, const int is_back, global const int* restrict texel_patches,
                        global const PatchRecord* restrict patches, global const int* restrict texel_triangles, global const float* restrict x,
                        global const float* restrict y, global const float* restrict z, global int* restrict is_marked, global int* restrict can_move,
                        global float* restrict offset_x, global float* restrict offset_y, global int* restrict walkers,
                        global int* restrict back_count) {
  const int across = (int)get_global_id(0), line = (int)get_global_id(1);
  if (across >= texture_width || line >= texture_height) return;
  const int texel = line * texture_width + across;
  const int triangle = texel_triangles[texel];
  const int is_moving = is_marked[texel] && triangle != NO_TRIANGLE;
  is_marked[texel] = 0;
  can_move[texel] = is_moving;
  walkers[texel] = is_moving ? triangle : NO_TRIANGLE;
  if (!is_moving) return;
  global const PatchRecord* p = patches + texel_patches[texel];
  const int column = across - p->x, row = line - p->y;
  if (is_back) {
    if (offset_x[texel] != 0.0f || offset_y[texel] != 0.0f) atomic_inc(back_count);
    offset_x[texel] = 0.0f, offset_y[texel] = 0.0f;
    return;
  }
  const float3 left = point_at(x, y, z, texel_at(p, texture_width, column - 1, row)), right = point_at(x, y, z, texel_at(p, texture_width, column + 1, row));
  const float3 below = point_at(x, y, z, texel - texture_width), above = point_at(x, y, z, texel + texture_width);
  const float3 wanted = 0.25f * (left + right + below + above) - point_at(x, y, z, texel);
  const float3 dx = 0.5f * (right - left), dy = 0.5f * (above - below);
  const float damping = 0.01f * (dot(dx, dx) + dot(dy, dy));
  const float xx = dot(dx, dx) + damping, yy = dot(dy, dy) + damping, xy = dot(dx, dy), wx = dot(dx, wanted), wy = dot(dy, wanted);
  const float determinant = xx * yy - xy * xy;
  if (!(determinant > 0.0f)) return;
  const float step_x = clamp((wx * yy - wy * xy) / determinant, -LARGEST_STEP, LARGEST_STEP);
  const float step_y = clamp((wy * xx - wx * xy) / determinant, -LARGEST_STEP, LARGEST_STEP);
  offset_x[texel] = clamp(offset_x[texel] + step_x, -FURTHEST, FURTHEST);
  const float place = (float)row + clamp(offset_y[texel] + step_y, -FURTHEST, FURTHEST);
  offset_y[texel] = clamp(place, MARGIN, (float)(p->height - 1) - MARGIN) - (float)row;
}
