// SPDX-License-Identifier: MIT
#include <Eigen/Geometry>
#include <cmath>

#include "skeletex/geometry/half_edge_table.h"
#include "skeletex/geometry/mesh.h"
#include "skeletex/math/portable.h"

namespace skeletex {
namespace {

/// A triangle's share of the normal at one of its corners: its unit normal times its angle there. Caps do not count at
/// the vertex in their flat corner: hardly an area, so no direction, but half a turn of angle.
Vec3 corner_share(const TriangleMesh& mesh, const Triangle& t, int corner) {
  constexpr double kCapSlope = 0.03;  // of 178 degrees
  const Vec3& p = mesh.positions[t[corner]];
  const Vec3 to_next = mesh.positions[t[(corner + 1) % 3]] - p, to_last = mesh.positions[t[(corner + 2) % 3]] - p;
  const Vec3 area = to_next.cross(to_last);
  const double twice_area = area.norm(), along = to_next.dot(to_last);
  if (!(twice_area > std::max(0.0, -kCapSlope * along))) return Vec3::Zero();
  return portable::atan2(twice_area, along) / twice_area * area;
}

Vec3 unit_or_zero(const Vec3& v) {
  const double length = v.norm();
  return length > 0 ? Vec3(v / length) : Vec3(Vec3::Zero());
}

}  // namespace

std::vector<Vec3> vertex_normals(const TriangleMesh& mesh) {
  std::vector<Vec3> normals(mesh.positions.size(), Vec3::Zero());
  for (const Triangle& t : mesh.triangles)
    for (int k = 0; k < 3; ++k) normals[t[k]] += corner_share(mesh, t, k);
  for (Vec3& normal : normals) normal = unit_or_zero(normal);
  return normals;
}

CornerValues<Vec3> creased_normals(const TriangleMesh& mesh, double crease_angle) {
  const HalfEdgeTable edges = link_half_edges(mesh.triangles, static_cast<int>(mesh.positions.size()));
  std::vector<Vec3> faces;
  for (const Triangle& t : mesh.triangles) faces.push_back(unit_or_zero(area_vector(mesh, t)));
  const double least_cosine = portable::cos(crease_angle);
  // Half-edge h leaves the corner h % 3 of triangle h / 3; to its left is the edge that the corner's triangle shares
  // with the next one around the vertex.
  const auto turn = [&](int h) {
    const int next = edges.turn_left(h);
    return next >= 0 && faces[h / 3].dot(faces[next / 3]) >= least_cosine ? next : -1;
  };
  CornerValues<Vec3> normals;
  normals.corners.assign(mesh.triangles.size(), Triangle{-1, -1, -1});
  for (int h = 0; h < static_cast<int>(3 * mesh.triangles.size()); ++h) {
    if (normals.corners[h / 3][h % 3] >= 0) continue;
    int first = h;  // the fan's first corner, after a crease or anywhere around a smooth vertex
    for (int before = edges.turn_right(first); before >= 0 && before != h && turn(before) == first;
         before = edges.turn_right(first))
      first = before;
    Vec3 sum = Vec3::Zero();
    const int value = static_cast<int>(normals.values.size());
    for (int at = first; at >= 0 && normals.corners[at / 3][at % 3] < 0; at = turn(at)) {
      normals.corners[at / 3][at % 3] = value;
      sum += corner_share(mesh, mesh.triangles[at / 3], at % 3);
    }
    normals.values.push_back(unit_or_zero(sum));
  }
  return normals;
}

}  // namespace skeletex
