// SPDX-License-Identifier: MIT
#include "skeletex/geometry/mesh.h"

#include <fmt/format.h>

#include <Eigen/Geometry>

namespace skeletex {

std::string text_of(const Vec3& p) { return fmt::format("({:.6g}, {:.6g}, {:.6g})", p.x(), p.y(), p.z()); }

BoundingBox bounding_box(const TriangleMesh& mesh) {
  if (mesh.positions.empty()) return {};
  BoundingBox box{mesh.positions.front(), mesh.positions.front()};
  for (const Vec3& p : mesh.positions) {
    box.lower = box.lower.cwiseMin(p);
    box.upper = box.upper.cwiseMax(p);
  }
  return box;
}

Vec3 area_vector(const TriangleMesh& mesh, const Triangle& t) {
  const Vec3& a = mesh.positions[t[0]];
  return 0.5 * (mesh.positions[t[1]] - a).cross(mesh.positions[t[2]] - a);
}

double surface_area(const TriangleMesh& mesh) {
  double area = 0;
  for (const Triangle& t : mesh.triangles) area += area_vector(mesh, t).norm();
  return area;
}

double signed_volume(const TriangleMesh& mesh) {
  const Vec3 origin = bounding_box(mesh).centre();
  double volume = 0;
  for (const Triangle& t : mesh.triangles) volume += (mesh.positions[t[0]] - origin).dot(area_vector(mesh, t)) / 3;
  return volume;
}

}  // namespace skeletex
