// SPDX-License-Identifier: MIT
// Rays of the separation planes driven parameterization (paper 3.2.1). All rays of one column lie in one half-plane
// that the bone's axis bounds. There the surface is a set of line segments: the sections of the triangles at that
// angle. So casting a ray against triangles becomes casting it against segments in the plane, and as the rays of a
// column fan out without crossing, each point of the plane lies between two neighbouring rows.
//   cast_rays       per column, its list of triangles -> per texel the triangle that its ray meets, and the distance
// Coordinates are those of each bone: x along s, y along b, z along o, from the head, world units. `points` holds nine
// of them per triangle. Lists of triangles are compressed rows: list i is list_triangles[list_begins[i] ..
// list_begins[i+1]), with triangle numbers over all charts, increasing. Both triangles at an edge compute the same
// section point from the same numbers in the same order, and which row a point belongs to depends on the point alone:
// no ray slips between two triangles. Contraction would break that: every kernel is built without.
#include "skeletex_structs.h"
#include "spd_structs.h"

// A segment in the half-plane: x away from the axis (>= 0), z along it.
typedef struct Section {
  float xa, za, xb, zb;
} Section;

// Where the edge from P (y >= 0) to Q (y < 0) crosses the plane.
float edge_ratio(float yp, float yq) { return yp / (yp - yq); }

// The section of a triangle by the half-plane at an angle; false when there is none.
bool slice_triangle(global const float* restrict points, int triangle, float cosine, float sine, Section* section) {
  global const float* p = points + 9 * triangle;
  float x0 = cosine * p[0] + sine * p[1], y0 = cosine * p[1] - sine * p[0], z0 = p[2];
  float x1 = cosine * p[3] + sine * p[4], y1 = cosine * p[4] - sine * p[3], z1 = p[5];
  float x2 = cosine * p[6] + sine * p[7], y2 = cosine * p[7] - sine * p[6], z2 = p[8];
  const bool is_up0 = y0 >= 0.0f, is_up1 = y1 >= 0.0f, is_up2 = y2 >= 0.0f;
  if (is_up0 == is_up1 && is_up1 == is_up2) return false;
  if (x0 < 0.0f && x1 < 0.0f && x2 < 0.0f) return false;
  // Turn the corners so that 0 is alone on its side.
  float t;
  if (is_up0 == is_up2) {
    t = x0, x0 = x1, x1 = t;
    t = y0, y0 = y1, y1 = t;
    t = z0, z0 = z1, z1 = t;
  } else if (is_up0 == is_up1) {
    t = x0, x0 = x2, x2 = t;
    t = y0, y0 = y2, y2 = t;
    t = z0, z0 = z2, z2 = t;
  }
  float xa, za, xb, zb;
  if (y0 >= 0.0f) {
    const float wa = edge_ratio(y0, y1), wb = edge_ratio(y0, y2);
    xa = x0 + wa * (x1 - x0), za = z0 + wa * (z1 - z0);
    xb = x0 + wb * (x2 - x0), zb = z0 + wb * (z2 - z0);
  } else {
    const float wa = edge_ratio(y1, y0), wb = edge_ratio(y2, y0);
    xa = x1 + wa * (x0 - x1), za = z1 + wa * (z0 - z1);
    xb = x2 + wb * (x0 - x2), zb = z2 + wb * (z0 - z2);
  }
  if (xa < 0.0f && xb < 0.0f) return false;
  if (xa < 0.0f) {
    za = zb + xb / (xb - xa) * (za - zb);
    xa = 0.0f;
  } else if (xb < 0.0f) {
    zb = za + xa / (xa - xb) * (zb - za);
    xb = 0.0f;
  }
  section->xa = xa;
  section->za = za;
  section->xb = xb;
  section->zb = zb;
  return true;
}

// How far a point lies from a row's ray on the tail's side, times the length of the ray's direction f.
float side_of_ray(float x, float z, RowRecord row, float length, float slope_head, float slope_tail) {
  const float slope = (1.0f - row.axial) * slope_head + row.axial * slope_tail;
  return row.cap_cos * (z - row.axial * length) - (row.cap_cos * slope + row.cap_sin) * x;
}

// The first row in [begin, end) whose ray passes a point on the tail's side. Points at a seam's ray count as between
// the first and the last row, so that those rays meet the seam.
int row_of_point(float x, float z, int begin, int end, global const RowRecord* restrict rows,
                 global const int* restrict row_guesses, const SpdPatch* patch, float slope_head, float slope_tail) {
  const float length = patch->bone_length;
  if (begin == 0 &&
      side_of_ray(x, z, rows[0], length, slope_head, slope_tail) < patch->head_tolerance * (1.0f + fabs(slope_head)))
    return 0;
  if (end == patch->height && side_of_ray(x, z, rows[end - 1], length, slope_head, slope_tail) >=
                                  -patch->tail_tolerance * (1.0f + fabs(slope_tail)))
    return end;
  // Where the point's mark (see SpdPatch) falls among those of the rows, give or take rounding.
  const float above = z - length;
  const float mark = patch->is_tail_free && above > 0.0f ? 1.0f + above / (x + above)
                     : patch->is_head_free && z < 0.0f
                         ? z / (x - z)
                         : clamp((z - x * slope_head) / (length + x * (slope_tail - slope_head)), 0.0f, 1.0f);
  const int cell = clamp((int)((mark + 1.0f) * patch->guesses_per_mark), 0, patch->guess_count - 2);
  const int low = clamp(row_guesses[cell], begin, end), high = clamp(row_guesses[cell + 1], begin, end);
  const bool is_above_low = low == begin || side_of_ray(x, z, rows[low - 1], length, slope_head, slope_tail) >= 0.0f;
  const bool is_below_high = high == end || side_of_ray(x, z, rows[high], length, slope_head, slope_tail) < 0.0f;
  int first = is_above_low ? low : begin;
  for (int count = (is_below_high ? high : end) - first; count > 0;) {
    const int middle = count / 2;
    const bool is_after = side_of_ray(x, z, rows[first + middle], length, slope_head, slope_tail) >= 0.0f;
    first = is_after ? first + middle + 1 : first;
    count = is_after ? count - middle - 1 : middle;
  }
  return first;
}

// NDRange (columns of all patches, tiles of tile_rows rows): each work-item owns a column's part and goes through its
// list.
kernel void cast_rays(const CastParameters p, global const SpdPatch* restrict patches,
                      global const RowRecord* restrict rows, global const ColumnRecord* restrict columns,
                      global const int* restrict tables, global const int* restrict list_triangles,
                      global const float* restrict points, global int* restrict hit_triangles,
                      global float* restrict hit_distances) {
  const int c = (int)get_global_id(0);
  if (c >= p.column_count) return;
  const SpdPatch patch = patches[tables[c]];
  const int begin = (int)get_global_id(1) * p.tile_rows;
  const int end = min(patch.height, begin + p.tile_rows);
  if (begin >= end) return;
  const ColumnRecord column = columns[c];
  rows += patch.row_begin;
  global const int* row_guesses = tables + p.guesses + patch.guess_begin;
  global const int* list_begins = tables + p.list_begins;
  hit_triangles += patch.texel_begin + (c - patch.column_begin);
  hit_distances += patch.texel_begin + (c - patch.column_begin);
  for (int r = begin; r < end; ++r) {
    hit_triangles[r * patch.width] = -1;
    hit_distances[r * patch.width] = 0.0f;
  }
  for (int i = list_begins[c]; i < list_begins[c + 1]; ++i) {
    Section s;
    if (!slice_triangle(points, list_triangles[i], column.cosine, column.sine, &s)) continue;
    const int ra =
        row_of_point(s.xa, s.za, begin, end, rows, row_guesses, &patch, column.slope_head, column.slope_tail);
    const int rb =
        row_of_point(s.xb, s.zb, begin, end, rows, row_guesses, &patch, column.slope_head, column.slope_tail);
    const int last = max(ra, rb);
    for (int r = min(ra, rb); r < last; ++r) {
      const RowRecord row = rows[r];
      const float foot = row.axial * patch.bone_length;
      const float slope = (1.0f - row.axial) * column.slope_head + row.axial * column.slope_tail;
      const float fx = row.cap_cos, fz = row.cap_cos * slope + row.cap_sin;
      const float side_a = fx * (s.za - foot) - fz * s.xa, side_b = fx * (s.zb - foot) - fz * s.xb;
      // Where the rays of a column have crossed, rows are not ordered any more: such a section is no hit.
      if (side_a * side_b > 0.0f && fmin(fabs(side_a), fabs(side_b)) > patch.tolerance * (fx + fabs(fz))) continue;
      const float w = side_a == side_b ? 0.5f : clamp(side_a / (side_a - side_b), 0.0f, 1.0f);
      const float x = s.xa + w * (s.xb - s.xa), z = s.za + w * (s.zb - s.za) - foot;
      if (!(fx * x + fz * z >= 0.0f)) continue;
      const float t = sqrt(x * x + z * z);
      const int at = r * patch.width;
      const bool is_first = hit_triangles[at] < 0;
      if (is_first || (p.wants_last ? t > hit_distances[at] : t < hit_distances[at])) {
        hit_triangles[at] = list_triangles[i];
        hit_distances[at] = t;
      }
    }
  }
}
