// SPDX-License-Identifier: MIT
// Which diagonal a quad takes. Vertices come as a table at[row][column] of the 4 x 4 around a quad, whose own corners
// are at[1][1] to at[2][2]. Where the lattice has no row before or after (next to a seam or a pole) the table repeats
// the quad's own. The first diagonal goes from at[1][1] to at[2][2], the second from at[1][2] to at[2][1].
#include "planes.h"

// The nearer diagonal: the one with the smaller d l^2, where l is its length and d the distance, along the quad's
// normal, of its midpoint from where a cubic through the 4 x 4 vertices has the surface. (Against the shorter diagonal:
// mean error -6 %, maximum up to -20 %.) Beyond the first and last row the lattice goes on straight. Where rounding
// blurs d the shorter one is taken, and of two as good the first.
__attribute__((always_inline)) int takes_second_if_nearer(const int at[4][4], int has_before, int has_after,
                                                          Planes points) {
  global const float *x = points.x, *y = points.y, *z = points.z;
  const float w_rows[4] = {
      has_before ? -0.0625f : 0.0f, 0.5625f - (has_before ? 0.0f : 0.125f) + (has_after ? 0.0f : 0.0625f),
      0.5625f - (has_after ? 0.0f : 0.125f) + (has_before ? 0.0f : 0.0625f), has_after ? -0.0625f : 0.0f};
  const int v00 = at[1][1], v01 = at[1][2], v10 = at[2][1], v11 = at[2][2];
  const float fx = x[v11] - x[v00], fy = y[v11] - y[v00], fz = z[v11] - z[v00];
  const float gx = x[v10] - x[v01], gy = y[v10] - y[v01], gz = z[v10] - z[v01];
  const float first2 = fx * fx + fy * fy + fz * fz;
  const float second2 = gx * gx + gy * gy + gz * gz;
  const float nx = fy * gz - fz * gy, ny = fz * gx - fx * gz, nz = fx * gy - fy * gx;
  const float n_inverse = 1.0f / sqrt(fmax(nx * nx + ny * ny + nz * nz, 1e-37f));
  float cx = 0.0f, cy = 0.0f, cz = 0.0f;
#pragma unroll
  for (int i = 0; i < 4; ++i) {
    const float w = i == 0 || i == 3 ? -0.0625f : 0.5625f;
    const int b = at[0][i], v = at[1][i], u = at[2][i], a = at[3][i];
    cx += w * (w_rows[0] * x[b] + w_rows[1] * x[v] + w_rows[2] * x[u] + w_rows[3] * x[a]);
    cy += w * (w_rows[0] * y[b] + w_rows[1] * y[v] + w_rows[2] * y[u] + w_rows[3] * y[a]);
    cz += w * (w_rows[0] * z[b] + w_rows[1] * z[v] + w_rows[2] * z[u] + w_rows[3] * z[a]);
  }
  const float first = fabs((0.5f * (x[v00] + x[v11]) - cx) * nx + (0.5f * (y[v00] + y[v11]) - cy) * ny +
                           (0.5f * (z[v00] + z[v11]) - cz) * nz);
  const float second = fabs((0.5f * (x[v01] + x[v10]) - cx) * nx + (0.5f * (y[v01] + y[v10]) - cy) * ny +
                            (0.5f * (z[v01] + z[v10]) - cz) * nz);
  const float blur = 3e-7f * (fabs(cx) + fabs(cy) + fabs(cz)) + 1e-4f * sqrt(first2);
  return (second * n_inverse + blur) * second2 < (first * n_inverse + 0.9f * blur) * first2;
}

// Unit normals of triangles, as three numbers.
typedef struct Normal {
  float x, y, z;
} Normal;

__attribute__((always_inline)) Normal normal_of(Planes points, int a, int b, int c) {
  global const float *x = points.x, *y = points.y, *z = points.z;
  const float ux = x[b] - x[a], uy = y[b] - y[a], uz = z[b] - z[a];
  const float vx = x[c] - x[a], vy = y[c] - y[a], vz = z[c] - z[a];
  const float nx = uy * vz - uz * vy, ny = uz * vx - ux * vz, nz = ux * vy - uy * vx;
  const float inverse = 1.0f / sqrt(fmax(nx * nx + ny * ny + nz * nz, 1e-37f));
  const Normal n = {nx * inverse, ny * inverse, nz * inverse};
  return n;
}

// The turn from one normal to another as the length of their difference: 2 sin(angle / 2), precise for small angles.
// Its square.
__attribute__((always_inline)) float turn2_between(Normal a, Normal b) {
  const float dx = a.x - b.x, dy = a.y - b.y, dz = a.z - b.z;
  return dx * dx + dy * dy + dz * dz;
}

__attribute__((always_inline)) float least_turn(Normal own, Normal first, Normal second) {
  return sqrt(fmin(turn2_between(own, first), turn2_between(own, second)));
}

// The smoother diagonal, for lattices whose texels sit on edges of the surface: the one whose triangles go on more
// smoothly into the quads around, that is, the smaller sum over the four sides of the turn between the quad's triangle
// there and the better of the two that the neighbour can have. A diagonal whose two triangles face apart comes last. So
// an edge that runs through texels is an edge of the mesh as well. Sides next to a seam or a pole do not count. Where
// neither is much smoother (less than CLEARLY of the other's turns), as where the lattice sits on nothing, it is the
// nearer one.
#define CLEARLY 0.8f

// Of the triangles that a quad can have: of the first diagonal the one at its first row and the other, then of the
// second diagonal.
typedef struct QuadNormals {
  Normal a, b, c, d;
} QuadNormals;

__attribute__((always_inline)) QuadNormals normals_of_quad(int v00, int v01, int v10, int v11, Planes points) {
  const QuadNormals q = {normal_of(points, v00, v01, v11), normal_of(points, v00, v11, v10),
                         normal_of(points, v00, v01, v10), normal_of(points, v01, v11, v10)};
  return q;
}

// 1 for the second, 0 for the first, -1 where neither is much smoother. Of the quads around those triangles that can be
// at the side between.
__attribute__((always_inline)) int smoother_of(QuadNormals q, Normal before_b, Normal before_d, Normal after_a,
                                               Normal after_c, Normal right_b, Normal right_c, Normal left_a,
                                               Normal left_d, int has_before, int has_after, int v00, int v11,
                                               Planes points) {
  global const float *x = points.x, *y = points.y, *z = points.z;
  const float w_before = has_before ? 1.0f : 0.0f, w_after = has_after ? 1.0f : 0.0f;
  float first = 0.0f, second = 0.0f;
  first += w_before * least_turn(q.a, before_b, before_d);
  second += w_before * least_turn(q.c, before_b, before_d);
  first += w_after * least_turn(q.b, after_a, after_c);
  second += w_after * least_turn(q.d, after_a, after_c);
  first += least_turn(q.a, right_b, right_c);
  second += least_turn(q.d, right_b, right_c);
  first += least_turn(q.b, left_a, left_d);
  second += least_turn(q.c, left_a, left_d);
  first += q.a.x * q.b.x + q.a.y * q.b.y + q.a.z * q.b.z < 0.0f ? 9.0f : 0.0f;
  second += q.c.x * q.d.x + q.c.y * q.d.y + q.c.z * q.d.z < 0.0f ? 9.0f : 0.0f;
  // Rounding of the points turns normals by about this much; where it could decide, the first diagonal is taken.
  const float fx = x[v11] - x[v00], fy = y[v11] - y[v00], fz = z[v11] - z[v00];
  const float blur =
      1e-6f * (fabs(x[v00]) + fabs(y[v00]) + fabs(z[v00])) * rsqrt(fmax(fx * fx + fy * fy + fz * fz, 1e-37f));
  return second < CLEARLY * first - blur ? 1 : first < CLEARLY * second - blur ? 0 : -1;
}

__attribute__((always_inline)) int smoother_diagonal(const int at[4][4], int has_before, int has_after, Planes points) {
  const int v00 = at[1][1], v01 = at[1][2], v10 = at[2][1], v11 = at[2][2];
  return smoother_of(normals_of_quad(v00, v01, v10, v11, points), normal_of(points, at[0][1], v01, v00),
                     normal_of(points, at[0][2], v01, v00), normal_of(points, v10, v11, at[3][2]),
                     normal_of(points, v10, v11, at[3][1]), normal_of(points, v01, at[2][3], v11),
                     normal_of(points, v01, at[1][3], v11), normal_of(points, at[1][0], v00, v10),
                     normal_of(points, v00, v10, at[2][0]), has_before, has_after, v00, v11, points);
}

__attribute__((always_inline)) int takes_second_if_smoother(const int at[4][4], int has_before, int has_after,
                                                            Planes points) {
  const int smoother = smoother_diagonal(at, has_before, has_after, points),
            nearer = takes_second_if_nearer(at, has_before, has_after, points);
  return smoother < 0 ? nearer : smoother;
}
