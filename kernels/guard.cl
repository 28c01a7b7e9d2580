// SPDX-License-Identifier: MIT
// How far a lattice and the mesh are from each other, found from nearby instead of by a tree.
//   find_normals          normals of the mesh's triangles
//   normals_of_texels     normals of the mesh at texels
//   suspect_quads         quads of the lattice -> how far they could be from the mesh, by its planes at their corners
//   suspect_any_quads     the same before diagonals are chosen
//   suspect_listed_quads  of some
//   measure_triangles     triangles of the lattice -> the mesh, by a walk over it
//   measure_vertices      vertices of the mesh -> the lattice, among the quads around their place in the map
// The last two can only find too large a distance, where the nearest point lies elsewhere. Vertices of the lattice are
// texels; triangles 2 t and 2 t + 1 are those of the quad to the right of and above texel t, by the diagonals that
// lattice.cl chooses.
#include "extremes.h"
#include "map_triangle.h"
#include "mesh_walk.h"
#include "patch_texels.h"
#include "skeletex_structs.h"

#define PLACES 15  // of a triangle, beside its middle
#define NEAR2 \
  0.0025f  // of the square of a triangle's side: a walk from its middle that ends as near has hardly gone astray

// Corners, quarters and middles of the sides, and points between them and the middle.
constant float place_s[PLACES] = {0.0f, 1.0f,  0.0f, 0.25f, 0.5f, 0.75f, 0.0f, 0.0f,
                                  0.0f, 0.75f, 0.5f, 0.25f, 0.6f, 0.2f,  0.2f};
constant float place_t[PLACES] = {0.0f,  0.0f,  1.0f, 0.0f,  0.0f, 0.0f, 0.25f, 0.5f,
                                  0.75f, 0.25f, 0.5f, 0.75f, 0.2f, 0.6f, 0.2f};

// NDRange (triangle_count). out  normals: three planes; 0 of triangles without area
kernel void find_normals(const int triangle_count, global const int* restrict corners,
                         global const float* restrict vertex_x, global const float* restrict vertex_y,
                         global const float* restrict vertex_z, global float* restrict normals) {
  const int t = (int)get_global_id(0);
  if (t >= triangle_count) return;
  const Point a = point_at(vertex_x, vertex_y, vertex_z, corners[t]),
              b = point_at(vertex_x, vertex_y, vertex_z, corners[triangle_count + t]),
              c = point_at(vertex_x, vertex_y, vertex_z, corners[2 * triangle_count + t]);
  const Point n = cross_of(minus(b, a), minus(c, a));
  const float length2 = product(n, n), inverse = length2 > 0.0f ? rsqrt(length2) : 0.0f;
  normals[t] = n.x * inverse, normals[triangle_count + t] = n.y * inverse,
  normals[2 * triangle_count + t] = n.z * inverse;
}

__attribute__((always_inline)) Point either(int is_first, Point p, Point q) {
  const Point r = {is_first ? p.x : q.x, is_first ? p.y : q.y, is_first ? p.z : q.z};
  return r;
}

// NDRange (texel_count). Normals of the mesh at texels, so that quads find them side by side.
// in   texel_triangles: per texel a triangle of the mesh there, or none
// out  texel_normals: three planes; 0 where there is none
kernel void normals_of_texels(const int texel_count, const int triangle_count,
                              global const int* restrict texel_triangles, global const float* restrict normals,
                              global float* restrict texel_normals) {
  const int i = (int)get_global_id(0);
  if (i >= texel_count) return;
  const int is_known = texel_triangles[i] < triangle_count, t = min(texel_triangles[i], triangle_count - 1);
  texel_normals[i] = is_known ? normals[t] : 0.0f;
  texel_normals[texel_count + i] = is_known ? normals[triangle_count + t] : 0.0f;
  texel_normals[2 * texel_count + i] = is_known ? normals[2 * triangle_count + t] : 0.0f;
}

__attribute__((always_inline)) float sum_of_sizes(Point p) { return fabs(p.x) + fabs(p.y) + fabs(p.z); }

// From the plane of the mesh at one end of a side to its other end; as far as that can be where no normal is known.
__attribute__((always_inline)) float rise(Point side, Point normal) {
  return sum_of_sizes(normal) > 0.0f ? fabs(product(side, normal)) : sum_of_sizes(side);
}

// How far a side could be from the mesh, at a crease between its ends: where the mesh's planes at these meet. That is
// no further than half the larger rise and the smaller one, and nothing where the side lies in either plane, as sides
// of triangles at snapped edges do.
__attribute__((always_inline)) float suspicion_of_side(Point side, Point normal, Point other_normal) {
  const float p = rise(side, normal), q = rise(side, other_normal);
  return p * q / greater(p + q, FLT_MIN);
}

__attribute__((always_inline)) int looks_against(Point a, Point b, Point c, Point at_a, Point at_b, Point at_c) {
  const Point own = cross_of(minus(b, a), minus(c, a));
  return lesser(product(own, at_a), lesser(product(own, at_b), product(own, at_c))) < 0.0f;
}

__attribute__((always_inline)) Point normal_at(int texel, int texel_count, global const float* texel_normals) {
  const Point n = {texel_normals[texel], texel_normals[texel_count + texel], texel_normals[2 * texel_count + texel]};
  return n;
}

__attribute__((always_inline)) float suspicion2_of_quad(int texel, int right, int texture_width, int texel_count,
                                                        int is_second, global const float* texel_normals,
                                                        global const float* x, global const float* y,
                                                        global const float* z) {
  const int above = texel + texture_width, beyond = right + texture_width;
  const Point a = point_at(x, y, z, texel), b = point_at(x, y, z, right), c = point_at(x, y, z, beyond),
              d = point_at(x, y, z, above);
  const Point at_a = normal_at(texel, texel_count, texel_normals), at_b = normal_at(right, texel_count, texel_normals);
  const Point at_c = normal_at(beyond, texel_count, texel_normals), at_d = normal_at(above, texel_count, texel_normals);
  // Its sides, and the diagonal, which both triangles share.
  const Point from = either(is_second, b, a), to = either(is_second, d, c), at_from = either(is_second, at_b, at_a),
              at_to = either(is_second, at_d, at_c);
  const float rows = greater(suspicion_of_side(minus(b, a), at_a, at_b), suspicion_of_side(minus(d, c), at_c, at_d));
  const float columns = greater(suspicion_of_side(minus(d, a), at_a, at_d), suspicion_of_side(minus(c, b), at_b, at_c));
  const float most = greater(suspicion_of_side(minus(to, from), at_from, at_to), greater(rows, columns));
  const int is_turned = looks_against(a, b, to, at_a, at_b, at_to) | looks_against(from, c, d, at_from, at_c, at_d);
  return is_turned ? INFINITY : most * most;
}

// The same, compiled once.
__attribute__((noinline)) float suspicion2_at_end(int texel, int right, int texture_width, int texel_count,
                                                  int is_second, global const float* texel_normals,
                                                  global const float* x, global const float* y, global const float* z) {
  return suspicion2_of_quad(texel, right, texture_width, texel_count, is_second, texel_normals, x, y, z);
}

// NDRange: one work-group of ROW_ITEMS per row, as in reconstruct.cl. A triangle whose corners lie on the mesh leaves
// it where it bends between them: a chord over a crease. in   lattice_rows: those that quads begin at; texel_triangles:
// per texel a triangle of the mesh there, of all texels of a patch or of none out  suspicions2: per quad how far it
// could be, squared, the larger of both triangles'; infinite where one looks against the mesh at
//                   a corner. Nothing is written where nothing is known
kernel void suspect_quads(const int row_count, const int texture_width, const int texel_count,
                          global const int* restrict lattice_rows, global const PatchRecord* restrict patches,
                          global const int* restrict diagonals, global const int* restrict texel_triangles,
                          global const float* restrict texel_normals, global const float* restrict x,
                          global const float* restrict y, global const float* restrict z,
                          global float* restrict suspicions2) {
  const int k = get_group_id(0);
  if (k >= row_count) return;
  global const PatchRecord* restrict patch = patches + lattice_rows[4 * k];
  const int width = patch->width;
  const int texel = (patch->y + lattice_rows[4 * k + 1]) * texture_width + patch->x;
  if (texel_triangles[texel] == NO_TRIANGLE) return;
  // Without the last column, which wraps round, the loop becomes vector instructions; see lattice.cl for `one`.
  const int one = min(width, 1);
  for (int j = get_local_id(0); j < width - 1; j += ROW_ITEMS)
    suspicions2[texel + j] = suspicion2_of_quad(texel + j, texel + j + one, texture_width, texel_count,
                                                diagonals[texel + j], texel_normals, x, y, z);
  if (get_local_id(0) == 0)
    suspicions2[texel + width - 1] = suspicion2_at_end(texel + width - 1, texel, texture_width, texel_count,
                                                       diagonals[texel + width - 1], texel_normals, x, y, z);
}

// NDRange (count). Those of some quads, by their texels. 0 where nothing is known.
kernel void suspect_listed_quads(const int count, const int texture_width, const int texel_count,
                                 global const int* restrict listed, global const int* restrict texel_patches,
                                 global const PatchRecord* restrict patches, global const int* restrict diagonals,
                                 global const int* restrict texel_triangles, global const float* restrict texel_normals,
                                 global const float* restrict x, global const float* restrict y,
                                 global const float* restrict z, global float* restrict suspicions2) {
  const int i = (int)get_global_id(0);
  if (i >= count) return;
  const int texel = listed[i], line = texel / texture_width;
  global const PatchRecord* p = patches + texel_patches[texel];
  const int right = texel_at(p, texture_width, texel - line * texture_width - p->x + 1, line - p->y);
  suspicions2[i] = texel_triangles[texel] == NO_TRIANGLE ? 0.0f
                                                         : suspicion2_at_end(texel, right, texture_width, texel_count,
                                                                             diagonals[texel], texel_normals, x, y, z);
}

// As suspicion2_of_quad where the diagonal is not known: the sides from its texel on, and the triangles by either
// diagonal.
__attribute__((always_inline)) float suspicion2_of_any(int texel, int right, int texture_width, int texel_count,
                                                       global const float* texel_normals, global const float* x,
                                                       global const float* y, global const float* z) {
  const int above = texel + texture_width, beyond = right + texture_width;
  const Point a = point_at(x, y, z, texel), b = point_at(x, y, z, right), c = point_at(x, y, z, beyond),
              d = point_at(x, y, z, above);
  const Point at_a = normal_at(texel, texel_count, texel_normals), at_b = normal_at(right, texel_count, texel_normals);
  const Point at_c = normal_at(beyond, texel_count, texel_normals), at_d = normal_at(above, texel_count, texel_normals);
  const float most = greater(suspicion_of_side(minus(b, a), at_a, at_b), suspicion_of_side(minus(d, a), at_a, at_d));
  const int is_turned = looks_against(a, b, c, at_a, at_b, at_c) | looks_against(a, c, d, at_a, at_c, at_d) |
                        looks_against(a, b, d, at_a, at_b, at_d) | looks_against(b, c, d, at_b, at_c, at_d);
  return is_turned ? INFINITY : most * most;
}

// The same, compiled once.
__attribute__((noinline)) float suspicion2_of_any_at_end(int texel, int right, int texture_width, int texel_count,
                                                         global const float* texel_normals, global const float* x,
                                                         global const float* y, global const float* z) {
  return suspicion2_of_any(texel, right, texture_width, texel_count, texel_normals, x, y, z);
}

// NDRange and all else as for suspect_quads, of a lattice whose diagonals are not chosen. A side is that of one of the
// two quads at it.
kernel void suspect_any_quads(const int row_count, const int texture_width, const int texel_count,
                              global const int* restrict lattice_rows, global const PatchRecord* restrict patches,
                              global const int* restrict texel_triangles, global const float* restrict texel_normals,
                              global const float* restrict x, global const float* restrict y,
                              global const float* restrict z, global float* restrict suspicions2) {
  const int k = get_group_id(0);
  if (k >= row_count) return;
  global const PatchRecord* restrict patch = patches + lattice_rows[4 * k];
  const int width = patch->width;
  const int texel = (patch->y + lattice_rows[4 * k + 1]) * texture_width + patch->x;
  if (texel_triangles[texel] == NO_TRIANGLE) return;
  const int one = min(width, 1);
  for (int j = get_local_id(0); j < width - 1; j += ROW_ITEMS)
    suspicions2[texel + j] =
        suspicion2_of_any(texel + j, texel + j + one, texture_width, texel_count, texel_normals, x, y, z);
  if (get_local_id(0) == 0)
    suspicions2[texel + width - 1] =
        suspicion2_of_any_at_end(texel + width - 1, texel, texture_width, texel_count, texel_normals, x, y, z);
}

// A vertex of the lattice: a texel, or behind these a vertex of its ends.
__attribute__((always_inline)) Point lattice_point(int vertex, int texel_count, global const float* restrict x,
                                                   global const float* restrict y, global const float* restrict z,
                                                   global const float* restrict end_x,
                                                   global const float* restrict end_y,
                                                   global const float* restrict end_z) {
  return vertex < texel_count ? point_at(x, y, z, vertex) : point_at(end_x, end_y, end_z, vertex - texel_count);
}

// NDRange (count). Triangles of a list, from the mesh: at their middles, and where the middle is further than the root
// of `worth_a_look2` at the other places too. in   listed: their corners, three vertices each; texel_triangles: where
// walks begin; middle_enough2, enough2: walks from there end
//      where they are as near as that
// out  distances2: the furthest of the places, squared; what is less than what is enough may be less or more; -1 where
// no walk can begin
//      is_turned: whether it looks against the mesh where its middle's walk ends
kernel void measure_triangles(const int count, const int texel_count, const float middle_enough2,
                              const float worth_a_look2, const float enough2, const int triangle_count,
                              global const int* restrict listed, global const int* restrict texel_triangles,
                              global const int* restrict corners, global const int* restrict across,
                              global const float* restrict vertex_x, global const float* restrict vertex_y,
                              global const float* restrict vertex_z, global const float* restrict x,
                              global const float* restrict y, global const float* restrict z,
                              global const float* restrict end_x, global const float* restrict end_y,
                              global const float* restrict end_z, global float* restrict distances2,
                              global int* restrict is_turned) {
  const int i = (int)get_global_id(0);
  if (i >= count) return;
  distances2[i] = -1.0f;
  is_turned[i] = 0;
  int starts[3];
  Point abc[3];
  for (int k = 0; k < 3; ++k) {
    const int vertex = listed[3 * i + k];
    abc[k] = lattice_point(vertex, texel_count, x, y, z, end_x, end_y, end_z);
    starts[k] = vertex < texel_count ? texel_triangles[vertex] : NO_TRIANGLE;
  }
  const Point ab = minus(abc[1], abc[0]), ac = minus(abc[2], abc[0]);
  const float third[3] = {1.0f / 3.0f, 1.0f / 3.0f, 1.0f / 3.0f};
  const float near2 = NEAR2 * fmax(product(ab, ab), product(ac, ac));
  float w[3];
  Point nearest;
  const Point middle = weighted(third, abc[0], abc[1], abc[2]), own = cross_of(ab, ac);
  // A walk can end where all triangles around are further, as across a thin part: then those from the other corners may
  // know better.
  int at = NO_TRIANGLE;
  float furthest2 = INFINITY;
  for (int k = 0; k < 3; ++k) {
    int t = starts[k];
    if (t == NO_TRIANGLE || (k > 0 && t == starts[k - 1]) || (k == 2 && t == starts[0])) continue;
    Point normal;
    float distance2 = walk_over_mesh(middle, middle_enough2, triangle_count, corners, across, vertex_x, vertex_y,
                                     vertex_z, &t, &nearest, &normal, w);
    if (product(own, normal) < 0.0f)
      distance2 = walk_over_mesh(middle, 0.0f, triangle_count, corners, across, vertex_x, vertex_y, vertex_z, &t,
                                 &nearest, &normal, w);
    if (distance2 < furthest2) furthest2 = distance2, at = t, is_turned[i] = product(own, normal) < 0.0f;
    if (furthest2 <= fmax(middle_enough2, near2) && !is_turned[i]) break;
  }
  if (at == NO_TRIANGLE) return;
  if (furthest2 > worth_a_look2) {
    // No point of a triangle is further from another triangle than the furthest of its corners.
    const Point d = point_at(vertex_x, vertex_y, vertex_z, corners[at]),
                e = point_at(vertex_x, vertex_y, vertex_z, corners[triangle_count + at]),
                f = point_at(vertex_x, vertex_y, vertex_z, corners[2 * triangle_count + at]);
    float most2 = 0.0f;
    for (int k = 0; k < 3 && most2 <= enough2; ++k) most2 = fmax(most2, nearest_of_triangle(abc[k], d, e, f, w));
    for (int k = 0; k < PLACES && most2 > enough2; ++k) {
      const float s = place_s[k], t = place_t[k];
      const Point p = {abc[0].x + s * ab.x + t * ac.x, abc[0].y + s * ab.y + t * ac.y, abc[0].z + s * ab.z + t * ac.z};
      int start = at;
      Point normal;
      furthest2 = fmax(furthest2, walk_over_mesh(p, enough2, triangle_count, corners, across, vertex_x, vertex_y,
                                                 vertex_z, &start, &nearest, &normal, w));
    }
  }
  distances2[i] = furthest2;
}

// The nearest triangle of the quads up to `reach` columns and rows from one.
__attribute__((noinline)) void nearest_around(Point p, global const PatchRecord* restrict patch, int texture_width,
                                              int column, int row, int reach, global const int* restrict diagonals,
                                              global const float* restrict x, global const float* restrict y,
                                              global const float* restrict z, float* best, int* nearest) {
  for (int r = max(1, row - reach); r <= min(patch->height - 3, row + reach); ++r)
    for (int c = column - reach; c <= column + reach; ++c) {
      const int wrapped = (c % patch->width + patch->width) % patch->width;
      const int texel = texel_at(patch, texture_width, wrapped, r),
                right = texel_at(patch, texture_width, wrapped + 1, r);
      const int above = texel + texture_width, beyond = right + texture_width, is_second = diagonals[texel];
      const int corners[2][3] = {{texel, right, is_second ? above : beyond},
                                 {is_second ? right : texel, beyond, above}};
      for (int t = 0; t < 2; ++t) {
        float w[3];
        const float distance2 = nearest_of_triangle(
            p, point_at(x, y, z, corners[t][0]), point_at(x, y, z, corners[t][1]), point_at(x, y, z, corners[t][2]), w);
        if (distance2 < *best) *best = distance2, *nearest = 2 * texel + t;
      }
    }
}

// NDRange (count). Vertices of the mesh: the nearest triangle of their own quad, of the quads around where that is
// further than the root of `limit2`, and further around where these are. in   vertices: their numbers; places: where
// they are in the cells of their patches, x and y out  distances2, squared, and nearest, triangles of the lattice;
// where they are nearer than that there may be nearer ones
kernel void measure_vertices(const int count, const int texture_width, const float limit2,
                             global const int* restrict vertices, global const int* restrict vertex_patches,
                             global const float* restrict places, global const PatchRecord* restrict patches,
                             global const int* restrict diagonals, global const float* restrict vertex_x,
                             global const float* restrict vertex_y, global const float* restrict vertex_z,
                             global const float* restrict x, global const float* restrict y,
                             global const float* restrict z, global float* restrict distances2,
                             global int* restrict nearest) {
  const int i = (int)get_global_id(0);
  if (i >= count) return;
  global const PatchRecord* restrict p = patches + vertex_patches[i];
  const int column = (int)floor(places[2 * i]), row = clamp((int)floor(places[2 * i + 1]), 1, p->height - 3);
  const Point point = point_at(vertex_x, vertex_y, vertex_z, vertices[i]);
  float best = INFINITY;
  int found = 0;
  nearest_around(point, p, texture_width, column, row, 0, diagonals, x, y, z, &best, &found);
  if (best > limit2) {
    best = INFINITY;
    nearest_around(point, p, texture_width, column, row, 1, diagonals, x, y, z, &best, &found);
  }
  if (best > limit2) nearest_around(point, p, texture_width, column, row, 3, diagonals, x, y, z, &best, &found);
  distances2[i] = best;
  nearest[i] = found;
}
