// SPDX-License-Identifier: MIT
// The smooth rule for a quad's diagonal. Of its diagonals the one is taken whose triangles go on more smoothly into the
// quads around: the smaller sum over the four sides of the turn between the quad's triangle there and the better of the two
// that the neighbour can have. A diagonal whose two triangles face apart comes last. So an edge of the surface that runs
// through texels is an edge of the mesh as well. Sides next to a seam or a pole do not count.

// The corners of a quad, v<row><column>, and those around that share a side with it: a row before and after, the columns
// to the left and right.
typedef struct QuadRing {
  int v00, v01, v10, v11, before0, before1, after0, after1, left0, left1, right0, right1;
} QuadRing;

// Unit normals of triangles, as three numbers.
typedef struct Normal {
  float x, y, z;
} Normal;

Normal normal_of(__global const float* restrict x, __global const float* restrict y, __global const float* restrict z, int a, int b, int c) {
  const float ux = x[b] - x[a], uy = y[b] - y[a], uz = z[b] - z[a];
  const float vx = x[c] - x[a], vy = y[c] - y[a], vz = z[c] - z[a];
  const float nx = uy * vz - uz * vy, ny = uz * vx - ux * vz, nz = ux * vy - uy * vx;
  const float inverse = 1.0f / sqrt(fmax(nx * nx + ny * ny + nz * nz, 1e-37f));
  const Normal n = {nx * inverse, ny * inverse, nz * inverse};
  return n;
}

// The turn from one normal to another as the length of their difference: 2 sin(angle / 2), precise for small angles.
float turn_between(Normal a, Normal b) {
  const float dx = a.x - b.x, dy = a.y - b.y, dz = a.z - b.z;
  return sqrt(dx * dx + dy * dy + dz * dz);
}

float least_turn(Normal own, Normal first, Normal second) { return fmin(turn_between(own, first), turn_between(own, second)); }

// Whether the diagonal from (row, column + 1) to (row + 1, column) is taken; of two as good it is the other one.
int takes_second_smoothly(QuadRing q, int has_before, int has_after, __global const float* restrict x, __global const float* restrict y,
                          __global const float* restrict z) {
  const float w_before = has_before ? 1.0f : 0.0f, w_after = has_after ? 1.0f : 0.0f;
  const Normal a = normal_of(x, y, z, q.v00, q.v01, q.v11), b = normal_of(x, y, z, q.v00, q.v11, q.v10);
  const Normal c = normal_of(x, y, z, q.v00, q.v01, q.v10), d = normal_of(x, y, z, q.v01, q.v11, q.v10);
  const float fx = x[q.v11] - x[q.v00], fy = y[q.v11] - y[q.v00], fz = z[q.v11] - z[q.v00];
  float first = 0.0f, second = 0.0f;
  {
    const Normal m = normal_of(x, y, z, q.before0, q.v01, q.v00), n = normal_of(x, y, z, q.before1, q.v01, q.v00);
    first += w_before * least_turn(a, m, n);
    second += w_before * least_turn(c, m, n);
  }
  {
    const Normal m = normal_of(x, y, z, q.v10, q.v11, q.after1), n = normal_of(x, y, z, q.v10, q.v11, q.after0);
    first += w_after * least_turn(b, m, n);
    second += w_after * least_turn(d, m, n);
  }
  {
    const Normal m = normal_of(x, y, z, q.v01, q.right1, q.v11), n = normal_of(x, y, z, q.v01, q.right0, q.v11);
    first += least_turn(a, m, n);
    second += least_turn(d, m, n);
  }
  {
    const Normal m = normal_of(x, y, z, q.left0, q.v00, q.v10), n = normal_of(x, y, z, q.v00, q.v10, q.left1);
    first += least_turn(b, m, n);
    second += least_turn(c, m, n);
  }
  first += a.x * b.x + a.y * b.y + a.z * b.z < 0.0f ? 9.0f : 0.0f;
  second += c.x * d.x + c.y * d.y + c.z * d.z < 0.0f ? 9.0f : 0.0f;
  // Rounding of the points turns normals by about this much; where it could decide, the first diagonal is taken.
  const float blur = 1e-6f * (fabs(x[q.v00]) + fabs(y[q.v00]) + fabs(z[q.v00])) * rsqrt(fmax(fx * fx + fy * fy + fz * fz, 1e-37f));
  return second < first - blur;
}
