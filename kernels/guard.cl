// SPDX-License-Identifier: MIT
// How far a lattice and the mesh are from each other, found from nearby instead of by a tree.
//   find_normals       normals of the mesh's triangles
//   suspect_quads      quads of the lattice -> how far they could be from the mesh, as these differ from the mesh's at their corners
//   measure_triangles  triangles of the lattice -> the mesh, by a walk over it
//   measure_vertices   vertices of the mesh -> the lattice, among the quads around their place in the map
// The last two can only find too large a distance, where the nearest point lies elsewhere. Vertices of the lattice are texels; triangles
// 2 t and 2 t + 1 are those of the quad to the right of and above texel t, by the diagonals that lattice.cl chooses.
#include "skeletex_structs.h"
#include "map_triangle.h"
#include "mesh_walk.h"
#include "patch_texels.h"

#define PLACES 15  // of a triangle, beside its middle

// Corners, quarters and middles of the sides, and points between them and the middle.
constant float place_s[PLACES] = {0.0f, 1.0f, 0.0f, 0.25f, 0.5f, 0.75f, 0.0f, 0.0f, 0.0f, 0.75f, 0.5f, 0.25f, 0.6f, 0.2f, 0.2f};
constant float place_t[PLACES] = {0.0f, 0.0f, 1.0f, 0.0f, 0.0f, 0.0f, 0.25f, 0.5f, 0.75f, 0.25f, 0.5f, 0.75f, 0.2f, 0.6f, 0.2f};

// NDRange (triangle_count). out  normals: three planes; 0 of triangles without area
kernel void find_normals(const int triangle_count, global const int* restrict corners, global const float* restrict vertex_x,
                         global const float* restrict vertex_y, global const float* restrict vertex_z, global float* restrict normals) {
  const int t = (int)get_global_id(0);
  if (t >= triangle_count) return;
  const Point a = point_at(vertex_x, vertex_y, vertex_z, corners[t]), b = point_at(vertex_x, vertex_y, vertex_z, corners[triangle_count + t]),
              c = point_at(vertex_x, vertex_y, vertex_z, corners[2 * triangle_count + t]);
  const Point n = cross_of(minus(b, a), minus(c, a));
  const float length2 = product(n, n), inverse = length2 > 0.0f ? rsqrt(length2) : 0.0f;
  normals[t] = n.x * inverse, normals[triangle_count + t] = n.y * inverse, normals[2 * triangle_count + t] = n.z * inverse;
}

__attribute__((always_inline)) Point either(int is_first, Point p, Point q) {
  const Point r = {is_first ? p.x : q.x, is_first ? p.y : q.y, is_first ? p.z : q.z};
  return r;
}

// The square of how far a triangle could be, at a corner where the mesh has a normal; infinite where it looks against that.
__attribute__((always_inline)) float suspicion2_at(Point own, float area2, float side2, Point normal) {
  const float along = product(own, normal);
  const float sine2 = area2 > 0.0f ? fmax(0.0f, 1.0f - along * along / area2) : 1.0f;
  return along < 0.0f ? INFINITY : 0.25f * side2 * sine2;
}

__attribute__((always_inline)) float suspicion2_of(Point a, Point b, Point c, Point at_a, Point at_b, Point at_c) {
  const Point ab = minus(b, a), ac = minus(c, a), bc = minus(c, b);
  const Point own = cross_of(ab, ac);
  const float area2 = product(own, own), side2 = fmax(product(ab, ab), fmax(product(ac, ac), product(bc, bc)));
  return fmax(suspicion2_at(own, area2, side2, at_a), fmax(suspicion2_at(own, area2, side2, at_b), suspicion2_at(own, area2, side2, at_c)));
}

__attribute__((always_inline)) Point normal_at(int texel, int triangle_count, global const int* texel_triangles, global const float* normals) {
  const int t = min(texel_triangles[texel], triangle_count - 1);
  const Point n = {normals[t], normals[triangle_count + t], normals[2 * triangle_count + t]};
  return n;
}

__attribute__((always_inline)) float suspicion2_of_quad(int texel, int right, int texture_width, int triangle_count, int is_second, global const int* texel_triangles,
                         global const float* normals, global const float* x, global const float* y,
                         global const float* z) {
  const int above = texel + texture_width, beyond = right + texture_width;
  const Point a = point_at(x, y, z, texel), b = point_at(x, y, z, right), c = point_at(x, y, z, beyond), d = point_at(x, y, z, above);
  const Point at_a = normal_at(texel, triangle_count, texel_triangles, normals), at_b = normal_at(right, triangle_count, texel_triangles, normals);
  const Point at_c = normal_at(beyond, triangle_count, texel_triangles, normals), at_d = normal_at(above, triangle_count, texel_triangles, normals);
  return fmax(suspicion2_of(a, b, either(is_second, d, c), at_a, at_b, either(is_second, at_d, at_c)),
              suspicion2_of(either(is_second, b, a), c, d, either(is_second, at_b, at_a), at_c, at_d));
}

// The same, compiled once.
__attribute__((noinline)) float suspicion2_at_end(int texel, int right, int texture_width, int triangle_count, int is_second,
                                                  global const int* texel_triangles, global const float* normals, global const float* x,
                                                  global const float* y, global const float* z) {
  return suspicion2_of_quad(texel, right, texture_width, triangle_count, is_second, texel_triangles, normals, x, y, z);
}

// NDRange: one work-group of ROW_ITEMS per row, as in reconstruct.cl. A triangle whose corners lie on the mesh leaves it by about half its
// longest side times the sine of the angle to the mesh at its corners: a chord over a crease.
// in   lattice_rows: those that quads begin at; texel_triangles: per texel a triangle of the mesh there, of all texels of a patch or of none
// out  suspicions2: per quad that distance, squared, the larger of both triangles'; infinite where one looks against the mesh at a
//                   corner. Nothing is written where nothing is known
kernel void suspect_quads(const int row_count, const int texture_width, const int triangle_count, global const int* restrict lattice_rows,
                          global const PatchRecord* restrict patches, global const int* restrict diagonals, global const int* restrict texel_triangles,
                          global const float* restrict normals, global const float* restrict x, global const float* restrict y,
                          global const float* restrict z, global float* restrict suspicions2) {
  const int k = get_group_id(0);
  if (k >= row_count) return;
  global const PatchRecord* restrict patch = patches + lattice_rows[4 * k];
  const int width = patch->width;
  const int texel = (patch->y + lattice_rows[4 * k + 1]) * texture_width + patch->x;
  if (texel_triangles[texel] == NO_TRIANGLE) return;
  // Without the last column, which wraps round, the loop becomes vector instructions; see lattice.cl for `one`.
  const int one = min(width, 1);
  for (int j = get_local_id(0); j < width - 1; j += ROW_ITEMS)
    suspicions2[texel + j] =
        suspicion2_of_quad(texel + j, texel + j + one, texture_width, triangle_count, diagonals[texel + j], texel_triangles, normals, x, y, z);
  if (get_local_id(0) == 0)
    suspicions2[texel + width - 1] =
        suspicion2_at_end(texel + width - 1, texel, texture_width, triangle_count, diagonals[texel + width - 1], texel_triangles, normals, x, y, z);
}

// NDRange (count). Triangles of a list, from the mesh: at their middles, and at the other places too where the middle is further
// than the root of `worth_a_look2`.
// in   listed: their corners, three texels each; texel_triangles: where walks begin
// out  distances2: the furthest of the places, squared, 0 where no walk can begin; is_turned: whether it looks against the mesh
kernel void measure_triangles(const int count, const float worth_a_look2, const int triangle_count, global const int* restrict listed,
                              global const int* restrict texel_triangles, global const int* restrict corners, global const int* restrict across,
                              global const float* restrict vertex_x, global const float* restrict vertex_y, global const float* restrict vertex_z,
                              global const float* restrict x, global const float* restrict y, global const float* restrict z,
                              global float* restrict distances2, global int* restrict is_turned) {
  const int i = (int)get_global_id(0);
  if (i >= count) return;
  distances2[i] = 0.0f;
  is_turned[i] = 0;
  global const int* restrict lattice_corners = listed + 3 * i;
  int from = NO_TRIANGLE;
  for (int k = 0; k < 3 && from == NO_TRIANGLE; ++k) from = texel_triangles[lattice_corners[k]];
  if (from == NO_TRIANGLE) return;
  const Point a = point_at(x, y, z, lattice_corners[0]), b = point_at(x, y, z, lattice_corners[1]), c = point_at(x, y, z, lattice_corners[2]);
  const Point ab = minus(b, a), ac = minus(c, a);
  const float third[3] = {1.0f / 3.0f, 1.0f / 3.0f, 1.0f / 3.0f};
  float w[3];
  Point nearest, normal;
  float furthest2 = walk_over_mesh(weighted(third, a, b, c), from, triangle_count, corners, across, vertex_x, vertex_y, vertex_z, &nearest, &normal, w);
  is_turned[i] = product(cross_of(ab, ac), normal) < 0.0f;
  if (furthest2 > worth_a_look2) {
    for (int k = 0; k < PLACES; ++k) {
      const float s = place_s[k], t = place_t[k];
      const Point p = {a.x + s * ab.x + t * ac.x, a.y + s * ab.y + t * ac.y, a.z + s * ab.z + t * ac.z};
      furthest2 = fmax(furthest2, walk_over_mesh(p, from, triangle_count, corners, across, vertex_x, vertex_y, vertex_z, &nearest, &normal, w));
    }
  }
  distances2[i] = furthest2;
}

// The nearest triangle of the quads up to `reach` columns and rows from one.
__attribute__((noinline)) void nearest_around(Point p, global const PatchRecord* restrict patch, int texture_width, int column, int row, int reach,
                    global const int* restrict diagonals, global const float* restrict x, global const float* restrict y, global const float* restrict z,
                    float* best, int* nearest) {
  for (int r = max(1, row - reach); r <= min(patch->height - 3, row + reach); ++r)
    for (int c = column - reach; c <= column + reach; ++c) {
      const int wrapped = (c % patch->width + patch->width) % patch->width;
      const int texel = texel_at(patch, texture_width, wrapped, r), right = texel_at(patch, texture_width, wrapped + 1, r);
      const int above = texel + texture_width, beyond = right + texture_width, is_second = diagonals[texel];
      const int corners[2][3] = {{texel, right, is_second ? above : beyond}, {is_second ? right : texel, beyond, above}};
      for (int t = 0; t < 2; ++t) {
        float w[3];
        const float distance2 =
            nearest_of_triangle(p, point_at(x, y, z, corners[t][0]), point_at(x, y, z, corners[t][1]), point_at(x, y, z, corners[t][2]), w);
        if (distance2 < *best) *best = distance2, *nearest = 2 * texel + t;
      }
    }
}

// NDRange (count). Vertices of the mesh: the nearest triangle of the quads around, further around where that is further than the
// root of `limit2`.
// in   vertices: their numbers; places: where they are in the cells of their patches, x and y
// out  distances2, squared; nearest: triangles of the lattice
kernel void measure_vertices(const int count, const int texture_width, const float limit2, global const int* restrict vertices,
                             global const int* restrict vertex_patches, global const float* restrict places, global const PatchRecord* restrict patches,
                             global const int* restrict diagonals, global const float* restrict vertex_x, global const float* restrict vertex_y,
                             global const float* restrict vertex_z, global const float* restrict x, global const float* restrict y,
                             global const float* restrict z, global float* restrict distances2, global int* restrict nearest) {
  const int i = (int)get_global_id(0);
  if (i >= count) return;
  global const PatchRecord* restrict p = patches + vertex_patches[i];
  const int column = (int)floor(places[2 * i]), row = clamp((int)floor(places[2 * i + 1]), 1, p->height - 3);
  const Point point = point_at(vertex_x, vertex_y, vertex_z, vertices[i]);
  float best = INFINITY;
  int found = 0;
  nearest_around(point, p, texture_width, column, row, 1, diagonals, x, y, z, &best, &found);
  if (best > limit2) nearest_around(point, p, texture_width, column, row, 3, diagonals, x, y, z, &best, &found);
  distances2[i] = best;
  nearest[i] = found;
}
