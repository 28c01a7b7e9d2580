// SPDX-License-Identifier: MIT
#include "skeletex/geometry/mesh.h"

#include <fmt/format.h>

#include <Eigen/Geometry>

#include "skeletex/model/error.h"

namespace skeletex {

UnitFrame unit_frame(const TriangleMesh& mesh) {
  const BoundingBox box = bounding_box(mesh);
  const double diagonal = box.diagonal();
  if (!(diagonal >= kSmallestScale && diagonal <= kLargestScale))
    throw InputError(fmt::format("the mesh's bounding box has a diagonal of {:.3g}; give a mesh of {:g} to {:g}",
                                 diagonal, kSmallestScale, kLargestScale));
  return {box.centre(), diagonal};
}

TriangleMesh in_unit_frame(TriangleMesh mesh, const UnitFrame& frame) {
  for (Vec3& p : mesh.positions) p = frame.rounded_from_user(p);
  return mesh;
}

TriangleMesh in_frame(TriangleMesh mesh, const UnitFrame& frame) {
  for (Vec3& p : mesh.positions) p = frame.from_user(p);
  return mesh;
}

TriangleMesh in_user_units(TriangleMesh mesh, const UnitFrame& frame) {
  if (frame.is_identity()) return mesh;
  for (Vec3& p : mesh.positions) p = frame.to_user(p);
  return mesh;
}

std::string text_of(const Vec3& p) {
  const int digits = p.cwiseAbs().maxCoeff() >= 1000 ? 10 : 6;  // far from the origin the first digits are all the same
  return fmt::format("({:.{}g}, {:.{}g}, {:.{}g})", p.x(), digits, p.y(), digits, p.z(), digits);
}

BoundingBox bounding_box(std::span<const Vec3> points) {
  if (points.empty()) return {};
  BoundingBox box{points.front(), points.front()};
  for (const Vec3& p : points) {
    box.lower = box.lower.cwiseMin(p);
    box.upper = box.upper.cwiseMax(p);
  }
  return box;
}

BoundingBox bounding_box(const TriangleMesh& mesh) { return bounding_box(mesh.positions); }

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
