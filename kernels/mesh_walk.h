// SPDX-License-Identifier: MIT
// Nearest points of triangles, and of a mesh near a triangle of it.
#include "map_triangle.h"

Point minus(Point a, Point b) {
  const Point d = {a.x - b.x, a.y - b.y, a.z - b.z};
  return d;
}
float product(Point a, Point b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
Point cross_of(Point a, Point b) {
  const Point n = {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
  return n;
}
Point weighted(const float w[3], Point a, Point b, Point c) {
  const Point p = {w[0] * a.x + w[1] * b.x + w[2] * c.x, w[0] * a.y + w[1] * b.y + w[2] * c.y,
                   w[0] * a.z + w[1] * b.z + w[2] * c.z};
  return p;
}

float ratio_of(float part, float whole) { return whole > 0.0f ? part / whole : 0.0f; }

// The point of a triangle that is nearest to p, as weights of its corners, 0 exactly where it lies on a side. Returns
// the squared distance.
float nearest_of_triangle(Point p, Point a, Point b, Point c, float w[3]) {
  const Point ab = minus(b, a), ac = minus(c, a), ap = minus(p, a), bp = minus(p, b), cp = minus(p, c);
  const float d1 = product(ab, ap), d2 = product(ac, ap), d3 = product(ab, bp), d4 = product(ac, bp),
              d5 = product(ab, cp), d6 = product(ac, cp);
  const float va = d3 * d6 - d5 * d4, vb = d5 * d2 - d1 * d6, vc = d1 * d4 - d3 * d2;
  w[0] = 0.0f, w[1] = 0.0f, w[2] = 0.0f;
  if (d1 <= 0.0f && d2 <= 0.0f) {
    w[0] = 1.0f;
  } else if (d3 >= 0.0f && d4 <= d3) {
    w[1] = 1.0f;
  } else if (d6 >= 0.0f && d5 <= d6) {
    w[2] = 1.0f;
  } else if (vc <= 0.0f && d1 >= 0.0f && d3 <= 0.0f) {
    w[1] = ratio_of(d1, d1 - d3);
    w[0] = 1.0f - w[1];
  } else if (vb <= 0.0f && d2 >= 0.0f && d6 <= 0.0f) {
    w[2] = ratio_of(d2, d2 - d6);
    w[0] = 1.0f - w[2];
  } else if (va <= 0.0f && d4 >= d3 && d5 >= d6) {
    w[2] = ratio_of(d4 - d3, (d4 - d3) + (d5 - d6));
    w[1] = 1.0f - w[2];
  } else {
    const float sum = va + vb + vc;
    w[1] = ratio_of(vb, sum);
    w[2] = ratio_of(vc, sum);
    w[0] = 1.0f - w[1] - w[2];
  }
  const Point gap = minus(p, weighted(w, a, b, c));
  return product(gap, gap);
}

// The same of a triangle of the mesh.
float nearest_of_number(Point p, Maps maps, int t, float w[3]) {
  global const int* corners = maps.corners + t;
  return nearest_of_triangle(p, point_at(maps.vertices, corners[0]),
                             point_at(maps.vertices, corners[maps.triangle_count]),
                             point_at(maps.vertices, corners[2 * maps.triangle_count]), w);
}

// The point of the mesh near p: a walk from a triangle across sides that the nearest point lies on, as long as it comes
// nearer. It does not leave the patch's map. Returns the squared distance.
// in/out  at: the triangle where the walk begins; where it ends
float walk_over_mesh(Point p, Maps maps, int* at, Point* nearest, Point* normal, float w[3]) {
  const int triangle_count = maps.triangle_count;
  global const int* corners = maps.corners;
  int t = *at, last = -1;
  float best = nearest_of_number(p, maps, t, w);
  for (int steps = 1; steps < 40 && best > 0.0f; ++steps) {
    int next = -1;
    float nearer = best, other_w[3], next_w[3] = {0.0f, 0.0f, 0.0f};
    for (int k = 0; k < 3; ++k) {
      if (w[k] != 0.0f) continue;
      const int other = maps.across[k * triangle_count + t];
      if (other < 0 || other == last) continue;
      const float distance2 = nearest_of_number(p, maps, other, other_w);
      if (distance2 < nearer) {
        nearer = distance2, next = other;
        next_w[0] = other_w[0], next_w[1] = other_w[1], next_w[2] = other_w[2];
      }
    }
    // At a corner the way on may lead through any triangle around it.
    int k = w[0] == 1.0f ? 0 : w[1] == 1.0f ? 1 : w[2] == 1.0f ? 2 : -1;
    const int vertex = k < 0 ? -1 : corners[k * triangle_count + t];
    for (int turns = 0, turned = t; turns < 16 && next < 0 && k >= 0; ++turns) {
      turned = maps.across[(k == 2 ? 0 : k + 1) * triangle_count + turned];
      if (turned < 0 || turned == t) break;
      k = corners[turned] == vertex                        ? 0
          : corners[triangle_count + turned] == vertex     ? 1
          : corners[2 * triangle_count + turned] == vertex ? 2
                                                           : -1;
      nearer = nearest_of_number(p, maps, turned, next_w);
      if (nearer < best) next = turned;
    }
    if (next < 0) break;
    last = t, t = next, best = nearer;
    w[0] = next_w[0], w[1] = next_w[1], w[2] = next_w[2];
  }
  const Point d = point_at(maps.vertices, corners[t]), e = point_at(maps.vertices, corners[triangle_count + t]),
              f = point_at(maps.vertices, corners[2 * triangle_count + t]);
  *at = t;
  *nearest = weighted(w, d, e, f);
  *normal = cross_of(minus(e, d), minus(f, d));
  return best;
}
