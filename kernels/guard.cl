// SPDX-License-Identifier: MIT
// How far a lattice and the mesh are from each other, found from nearby instead of by a tree.
//   find_normals       normals of the mesh's triangles
//   suspect_quads      quads of the lattice -> how far they could be from the mesh, as these differ from the mesh's at their corners
//   measure_triangles  triangles of the lattice -> the mesh, by a walk over it
//   measure_vertices   vertices of the mesh -> the lattice, among the quads around their place in the map
// The last two can only find too large a distance, where the nearest point lies elsewhere. Vertices of the lattice are numbered as in
// core/skeletex/reconstruct/lattice.h; triangles 2 q and 2 q + 1 are those of its quad q.
#include "skeletex_structs.h"
#include "map_triangle.h"
#include "mesh_walk.h"

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

// NDRange (quad_count). A triangle whose corners lie on the mesh leaves it by about half its longest side times the sine of the angle to the mesh
// at its corners: a chord over a crease.
// in   triangles, vertex_texels, texel_triangles: as below
// out  suspicions2: that distance, squared, the larger of both triangles'; infinite where one looks against the mesh at a corner,
//                   0 where nothing is known
kernel void suspect_quads(const int quad_count, const int triangle_count, global const int* restrict triangles, global const int* restrict vertex_texels,
                          global const int* restrict texel_triangles, global const float* restrict normals, global const float* restrict x,
                          global const float* restrict y, global const float* restrict z, global float* restrict suspicions2) {
  const int quad = (int)get_global_id(0);
  if (quad >= quad_count) return;
  float most = 0.0f;
  for (int i = 6 * quad; i < 6 * quad + 6; i += 3) {
    const Point a = point_at(x, y, z, triangles[i]), b = point_at(x, y, z, triangles[i + 1]), c = point_at(x, y, z, triangles[i + 2]);
    const Point ab = minus(b, a), ac = minus(c, a), bc = minus(c, b);
    const Point own = cross_of(ab, ac);
    const float area2 = product(own, own), side2 = fmax(product(ab, ab), fmax(product(ac, ac), product(bc, bc)));
    for (int k = 0; k < 3; ++k) {
      const int t = texel_triangles[vertex_texels[triangles[i + k]]];
      if (t == NO_TRIANGLE) continue;
      const Point n = {normals[t], normals[triangle_count + t], normals[2 * triangle_count + t]};
      const float along = product(own, n);
      const float sine2 = area2 > 0.0f ? fmax(0.0f, 1.0f - along * along / area2) : 1.0f;
      most = fmax(most, along < 0.0f ? INFINITY : 0.25f * side2 * sine2);
    }
  }
  suspicions2[quad] = most;
}

// NDRange (count). Triangles of a list, from the mesh: at their middles, and at the other places too where the middle is further
// than the root of `worth_a_look2`.
// in   triangles: of the lattice; vertex_texels: per vertex of it its texel; texel_triangles: where walks begin
// out  distances2: the furthest of the places, squared, 0 where no walk can begin; is_turned: whether it looks against the mesh
kernel void measure_triangles(const int count, const float worth_a_look2, const int triangle_count, global const int* restrict listed,
                              global const int* restrict triangles, global const int* restrict vertex_texels, global const int* restrict texel_triangles,
                              global const int* restrict corners, global const int* restrict across, global const float* restrict vertex_x,
                              global const float* restrict vertex_y, global const float* restrict vertex_z, global const float* restrict x,
                              global const float* restrict y, global const float* restrict z, global float* restrict distances2,
                              global int* restrict is_turned) {
  const int i = (int)get_global_id(0);
  if (i >= count) return;
  distances2[i] = 0.0f;
  is_turned[i] = 0;
  global const int* restrict lattice_corners = triangles + 3 * listed[i];
  int from = NO_TRIANGLE;
  for (int k = 0; k < 3 && from == NO_TRIANGLE; ++k) from = texel_triangles[vertex_texels[lattice_corners[k]]];
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

// The nearest triangle of the quads up to `reach` columns and rows from one. Rows of quads are those between inner rows.
void nearest_around(Point p, global const PatchRecord* restrict patch, int first_quad, int column, int row, int reach, global const int* restrict triangles,
                    global const float* restrict x, global const float* restrict y, global const float* restrict z, float* best, int* nearest) {
  const int rows = patch->height - 3;
  for (int r = max(0, row - reach); r <= min(rows - 1, row + reach); ++r)
    for (int c = column - reach; c <= column + reach; ++c) {
      const int quad = first_quad + r * patch->width + (c % patch->width + patch->width) % patch->width;
      for (int t = 2 * quad; t < 2 * quad + 2; ++t) {
        float w[3];
        const float distance2 = nearest_of_triangle(p, point_at(x, y, z, triangles[3 * t]), point_at(x, y, z, triangles[3 * t + 1]),
                                                    point_at(x, y, z, triangles[3 * t + 2]), w);
        if (distance2 < *best) *best = distance2, *nearest = t;
      }
    }
}

// NDRange (count). Vertices of the mesh: the nearest triangle of the quads around, further around where that is further than the
// root of `limit2`.
// in   vertices: their numbers; places: where they are in the cells of their patches, x and y; first_quads: per patch
// out  distances2, squared; nearest: triangles of the lattice
kernel void measure_vertices(const int count, const float limit2, global const int* restrict vertices, global const int* restrict vertex_patches,
                             global const float* restrict places, global const PatchRecord* restrict patches, global const int* restrict first_quads,
                             global const int* restrict triangles, global const float* restrict vertex_x, global const float* restrict vertex_y,
                             global const float* restrict vertex_z, global const float* restrict x, global const float* restrict y,
                             global const float* restrict z, global float* restrict distances2, global int* restrict nearest) {
  const int i = (int)get_global_id(0);
  if (i >= count) return;
  const int patch = vertex_patches[i];
  global const PatchRecord* restrict p = patches + patch;
  const int column = (int)floor(places[2 * i]), row = clamp((int)floor(places[2 * i + 1]) - 1, 0, p->height - 4);
  const Point point = point_at(vertex_x, vertex_y, vertex_z, vertices[i]);
  float best = INFINITY;
  int found = 0;
  nearest_around(point, p, first_quads[patch], column, row, 1, triangles, x, y, z, &best, &found);
  if (best > limit2) nearest_around(point, p, first_quads[patch], column, row, 3, triangles, x, y, z, &best, &found);
  distances2[i] = best;
  nearest[i] = found;
}
