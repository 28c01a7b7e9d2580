// SPDX-License-Identifier: MIT
// Where the map turns sharply, a lattice that is even in the map folds in space although the map does not. Passes of
//   find_folds   marks the texels around quads that look against the surface
//   relax_folds  marked texels read nearer to their neighbours' mean, or go back to their own places
// Reading positions are offsets from the texel's own place in cells, two planes over the texture, x around, y along.
// Rows 0 and height-1 stay. A texel changes its own offset alone, and looks at its neighbours' points, which change
// between the passes: nothing depends on the order of work-items. Folds are few: each pass lists what the next one has
// to look at, in any order, once each.
#include "map_triangle.h"
#include "patch_texels.h"
#include "skeletex_structs.h"

#define LEAST_SURFACE_COSINE 0.1f  // between a triangle and the surface
#define LEAST_AGREEMENT \
  0.8f  // squared length of the mean of the normals around; less is an edge of the surface, no fold of the lattice
#define CLEAR_COSINE \
  0.9f  // between a quad's triangles and the surface at its first texel: then the others need no look
#define FURTHEST_UNFOLDED 1.0f  // cells from a texel's own place, along each axis
#define LARGEST_FOLD_STEP 0.4f  // cells
#define FOLD_MARGIN 0.3f        // cells that the rows next to a seam or pole keep from it

float3 vector_at(Planes points, int i) { return (float3)(points.x[i], points.y[i], points.z[i]); }

// Whether a triangle looks further from a direction than a cosine says.
int is_off(float3 a, float3 b, float3 c, float3 direction, float least_cosine) {
  const float3 n = cross(b - a, c - a);
  return dot(n, direction) < least_cosine * sqrt(dot(n, n) * dot(direction, direction));
}
int is_turned_from(float3 a, float3 b, float3 c, float3 direction) {
  return is_off(a, b, c, direction, LEAST_SURFACE_COSINE);
}

float3 normal_of_map(Maps maps, int t) {
  const float3 a = vector_at(maps.vertices, maps.corners[t]);
  return cross(vector_at(maps.vertices, maps.corners[maps.triangle_count + t]) - a,
               vector_at(maps.vertices, maps.corners[2 * maps.triangle_count + t]) - a);
}

// The planes of lists: quads, whether each is listed, texels that are marked, whether each is.
typedef struct FoldLists {
  global int *quads, *is_listed, *marked, *is_marked;
} FoldLists;

FoldLists lists_of(global int* lists, int count) {
  const FoldLists planes = {lists, lists + count, lists + 2 * count, lists + 3 * count};
  return planes;
}

// Appends what is not on the list. `is_listed` has a flag for all that can be.
void append_once(global int* list, volatile global int* count, volatile global int* is_listed, int what) {
  if (atomic_xchg(is_listed + what, 1) == 0) list[atomic_inc(count)] = what;
}

// NDRange: quads that are listed. A quad is the one to the right of and above its texel. It is folded when for both
// diagonals a triangle looks against the surface, whose normal is the mean of those of the triangles that the texels'
// places lie in. The 16 texels around a folded quad are listed as marked. Quads are taken off their list. Out: the
// numbers of folded quads and of marked texels (both 0 before).
kernel void find_folds(const MapParameters p, global const int* restrict texel_patches,
                       global const PatchRecord* restrict patches, global const int* restrict texel_triangles,
                       global const int* restrict triangles, global const float* restrict values,
                       global const float* restrict points, global int* counts, global int* lists) {
  const int i = (int)get_global_id(0), texture_width = p.texture_width;
  if (i >= counts[FOLD_QUADS]) return;
  const FoldLists listed = lists_of(lists, p.texel_count);
  const Maps maps = maps_of(p.maps, triangles, values);
  const Planes from = planes_of(points, p.texel_count);
  const int texel = listed.quads[i];
  listed.is_listed[texel] = 0;
  global const PatchRecord* patch = patches + texel_patches[texel];
  const int column = texel % texture_width - patch->x, row = texel / texture_width - patch->y;
  const int at[4] = {texel, texel_at(patch, texture_width, column + 1, row),
                     texel_at(patch, texture_width, column + 1, row + 1), texel + texture_width};
  float3 normal = (float3)(0.0f), q[4];
  for (int k = 0; k < 4; ++k) q[k] = vector_at(from, at[k]);
  if (row > 0 && texel_triangles[texel] != NO_TRIANGLE) {
    // Normals that agree as below are within 48 degrees of their mean.
    const float3 first = normal_of_map(maps, texel_triangles[texel]);
    if (dot(first, first) > 0.0f && !is_off(q[0], q[1], q[2], first, CLEAR_COSINE) &&
        !is_off(q[0], q[2], q[3], first, CLEAR_COSINE))
      return;
  }
  float normals = 0.0f;
  for (int k = 0; k < 4; ++k) {
    const int t = texel_triangles[at[k]], at_row = row + (k >= 2);
    if (t == NO_TRIANGLE || at_row == 0 || at_row == patch->height - 1) continue;
    const float3 n = normal_of_map(maps, t);
    const float length2 = dot(n, n);
    if (length2 > 0.0f) normal += n / sqrt(length2), normals += 1.0f;
  }
  if (normals == 0.0f || dot(normal, normal) < LEAST_AGREEMENT * normals * normals) return;
  if (!is_turned_from(q[0], q[1], q[2], normal) && !is_turned_from(q[0], q[2], q[3], normal)) return;
  if (!is_turned_from(q[0], q[1], q[3], normal) && !is_turned_from(q[1], q[2], q[3], normal)) return;
  atomic_inc(counts + FOLD_FOUND);
  for (int r = -1; r <= 2; ++r)
    for (int c = -1; c <= 2; ++c)
      if (row + r >= 1 && row + r <= patch->height - 2)
        append_once(listed.marked, counts + FOLD_MARKED, listed.is_marked,
                    texel_at(patch, texture_width, column + c, row + r));
}

// NDRange: count, the marked texels. They move towards the mean of their four neighbours, by the least-squares step in
// the lattice's own directions; with `is_back` they return to their places. Marks are taken off, and the quads around
// listed. Out: the numbers of quads that are listed and of texels that were away (both 0 before).
kernel void relax_folds(const MapParameters p, global const int* restrict texel_patches,
                        global const PatchRecord* restrict patches, global const int* restrict texel_triangles,
                        global const float* restrict points, global float* restrict offsets, global int* counts,
                        global int* lists) {
  const int i = (int)get_global_id(0), texture_width = p.texture_width;
  if (i >= p.count) return;
  const FoldLists listed = lists_of(lists, p.texel_count);
  const Planes from = planes_of(points, p.texel_count);
  global float *offset_x = offsets, *offset_y = offsets + p.texel_count;
  const int texel = listed.marked[i];
  listed.is_marked[texel] = 0;
  if (texel_triangles[texel] == NO_TRIANGLE) return;
  global const PatchRecord* patch = patches + texel_patches[texel];
  const int column = texel % texture_width - patch->x, row = texel / texture_width - patch->y;
  for (int r = -1; r <= 0; ++r)
    for (int c = -1; c <= 0; ++c)
      append_once(listed.quads, counts + FOLD_QUADS, listed.is_listed,
                  texel_at(patch, texture_width, column + c, row + r));
  if (p.is_back) {
    if (offset_x[texel] != 0.0f || offset_y[texel] != 0.0f) atomic_inc(counts + FOLD_RETURNED);
    offset_x[texel] = 0.0f, offset_y[texel] = 0.0f;
    return;
  }
  const float3 left = vector_at(from, texel_at(patch, texture_width, column - 1, row)),
               right = vector_at(from, texel_at(patch, texture_width, column + 1, row));
  const float3 below = vector_at(from, texel - texture_width), above = vector_at(from, texel + texture_width);
  const float3 wanted = 0.25f * (left + right + below + above) - vector_at(from, texel);
  const float3 dx = 0.5f * (right - left), dy = 0.5f * (above - below);
  const float damping = 0.01f * (dot(dx, dx) + dot(dy, dy));
  const float xx = dot(dx, dx) + damping, yy = dot(dy, dy) + damping, xy = dot(dx, dy), wx = dot(dx, wanted),
              wy = dot(dy, wanted);
  const float determinant = xx * yy - xy * xy;
  if (!(determinant > 0.0f)) return;
  const float step_x = clamp((wx * yy - wy * xy) / determinant, -LARGEST_FOLD_STEP, LARGEST_FOLD_STEP);
  const float step_y = clamp((wy * xx - wx * xy) / determinant, -LARGEST_FOLD_STEP, LARGEST_FOLD_STEP);
  offset_x[texel] = clamp(offset_x[texel] + step_x, -FURTHEST_UNFOLDED, FURTHEST_UNFOLDED);
  const float place = (float)row + clamp(offset_y[texel] + step_y, -FURTHEST_UNFOLDED, FURTHEST_UNFOLDED);
  offset_y[texel] = clamp(place, FOLD_MARGIN, (float)(patch->height - 1) - FOLD_MARGIN) - (float)row;
}
