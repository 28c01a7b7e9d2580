// SPDX-License-Identifier: MIT
// Moves texels from a mesh's own vertices and edges to a regular grid: points slide over the surface.
//   slide_points     one step
//   prefilter_rows   the encoder's prefilter for regular grids
// Both take the table of rows of reconstruct.cl: patch, row, first point. NDRange: one work-group of any size per row.
#include "planes.h"
#include "prefilter.h"
#include "regular_grid_structs.h"
#include "skeletex_structs.h"

#define LARGEST_STEP 0.25f  // cells
#define FURTHEST 2.0f       // cells from the texel's own point, along each axis
#define STEP_SHARE 0.7f     // of the way to the neighbours' mean; with 1 a chequered pattern would oscillate

// The quad that a place lies in: its corners, and the place's shares of the way across it.
typedef struct SurfaceCell {
  int corners[4];  // left and right below, left and right above
  float x, y;
} SurfaceCell;

SurfaceCell cell_at(int first, int width, int height, int column, int row, float dx, float dy) {
  const float x = floor(dx), y = clamp(floor(dy), (float)-row, (float)(height - 2 - row));
  const int left = ((column + (int)x) % width + width) % width, right = left + 1 < width ? left + 1 : 0;
  const int below = first + (row + (int)y) * width, above = below + width;
  const SurfaceCell cell = {{below + left, below + right, above + left, above + right}, dx - x, dy - y};
  return cell;
}

float value_in(SurfaceCell c, global const float* restrict p) {
  const float low = p[c.corners[0]] + c.x * (p[c.corners[1]] - p[c.corners[0]]),
              high = p[c.corners[2]] + c.x * (p[c.corners[3]] - p[c.corners[2]]);
  return low + c.y * (high - low);
}

void slopes_in(SurfaceCell c, global const float* restrict p, float* along_x, float* along_y) {
  const float low = p[c.corners[1]] - p[c.corners[0]], high = p[c.corners[3]] - p[c.corners[2]];
  const float left = p[c.corners[2]] - p[c.corners[0]], right = p[c.corners[3]] - p[c.corners[1]];
  *along_x = low + c.y * (high - low), *along_y = left + c.x * (right - left);
}

// One step of every texel towards the mean of its four neighbours, along the bilinear surface through the points. Rows
// 0 and height - 1 and patches with `is_kept` do not move.
// in   points: planes x, y, z of the lattice's own points
//      offsets: from each texel's own point to its place, in cells: a plane along the columns, a plane along the rows
//      at: planes x, y, z of the points there
// out  next_...: the same after the step
kernel void slide_points(const SlideParameters slide, global const int* restrict lattice_rows,
                         global const PatchRecord* restrict patches, global const int* restrict is_kept,
                         global const float* restrict points, global const float* restrict offsets,
                         global const float* restrict at, global float* restrict next_offsets,
                         global float* restrict next) {
  const int k = get_group_id(0), count = slide.point_count;
  if (k >= slide.row_count) return;
  PLANES(global const float, x, y, z, points, count);
  PLANES(global const float, at_x, at_y, at_z, at, count);
  PLANES(global float, next_x, next_y, next_z, next, count);
  global const PatchRecord* restrict patch = patches + lattice_rows[4 * k];
  const int row = lattice_rows[4 * k + 1], vertex = lattice_rows[4 * k + 2];
  const int width = patch->width, height = patch->height;
  const int stays = row == 0 || row == height - 1 || is_kept[lattice_rows[4 * k]];
  for (int j = get_local_id(0); j < width; j += get_local_size(0)) {
    const int own = vertex + j;
    float dx = offsets[own], dy = offsets[count + own];
    if (!stays) {
      const int left = vertex + (j > 0 ? j - 1 : width - 1), right = vertex + (j + 1 < width ? j + 1 : 0),
                below = own - width, above = own + width;
      const float tx = 0.25f * (at_x[left] + at_x[right] + at_x[below] + at_x[above]) - at_x[own];
      const float ty = 0.25f * (at_y[left] + at_y[right] + at_y[below] + at_y[above]) - at_y[own];
      const float tz = 0.25f * (at_z[left] + at_z[right] + at_z[below] + at_z[above]) - at_z[own];
      const SurfaceCell c = cell_at(vertex - row * width, width, height, j, row, dx, dy);
      float ux, uy, uz, vx, vy, vz;
      slopes_in(c, x, &ux, &vx), slopes_in(c, y, &uy, &vy), slopes_in(c, z, &uz, &vz);
      // Least squares in the tangent plane; the small share of the diagonal keeps cells without an area where they are.
      const float uu = ux * ux + uy * uy + uz * uz, vv = vx * vx + vy * vy + vz * vz, uv = ux * vx + uy * vy + uz * vz;
      const float damping = 1e-3f * (uu + vv), a = uu + damping, d = vv + damping;
      const float ut = ux * tx + uy * ty + uz * tz, vt = vx * tx + vy * ty + vz * tz;
      const float determinant = a * d - uv * uv;
      const float scale = determinant > 0.0f ? STEP_SHARE / determinant : 0.0f;
      dx = clamp(dx + clamp(scale * (d * ut - uv * vt), -LARGEST_STEP, LARGEST_STEP), -FURTHEST, FURTHEST);
      dy = clamp(dy + clamp(scale * (a * vt - uv * ut), -LARGEST_STEP, LARGEST_STEP),
                 fmax(-FURTHEST, 0.5f - (float)row), fmin(FURTHEST, (float)(height - 1 - row) - 0.5f));
    }
    const SurfaceCell c = cell_at(vertex - row * width, width, height, j, row, dx, dy);
    next_offsets[own] = dx, next_offsets[count + own] = dy;
    next_x[own] = value_in(c, x), next_y[own] = value_in(c, y), next_z[own] = value_in(c, z);
  }
}

// The prefilter on inner rows. The table has the rows to do.
// in   at: planes x, y, z    out  points: the same
kernel void prefilter_rows(const SlideParameters slide, global const int* restrict lattice_rows,
                           global const PatchRecord* restrict patches, global const float* restrict at,
                           global float* restrict points) {
  const int k = get_group_id(0), count = slide.point_count;
  if (k >= slide.row_count) return;
  const Planes from = planes_of(at, count);
  PLANES(global float, x, y, z, points, count);
  const int vertex = lattice_rows[4 * k + 2], width = patches[lattice_rows[4 * k]].width;
  for (int j = get_local_id(0); j < width; j += get_local_size(0)) {
    const int own = vertex + j;
    const Point p = prefilter_point(from, own, j > 0 ? own - 1 : own + width - 1, j + 1 < width ? own + 1 : vertex,
                                    own - width, own + width);
    x[own] = p.x, y[own] = p.y, z[own] = p.z;
  }
}
