// SPDX-License-Identifier: MIT
#include "skeletex/reconstruct/texture/vertex_tangents.h"

#include <Eigen/Geometry>
#include <cmath>

#include "skeletex/math/portable.h"

namespace skeletex {
namespace {

/// The part of a vector in the plane of a unit normal, made a unit vector; zero where nothing is left.
Vec3 in_plane(const Vec3& vector, const Vec3& normal) {
  const Vec3 part = vector - vector.dot(normal) * normal;
  const double length = part.norm();
  return length > 0 ? Vec3(part / length) : Vec3(Vec3::Zero());
}

Vec3 any_tangent(const Vec3& normal) {
  return normal == Vec3::Zero() ? Vec3(Vec3::UnitX()) : Vec3(normal.unitOrthogonal());
}

double angle_between(const Vec3& a, const Vec3& b) { return portable::atan2(a.cross(b).norm(), a.dot(b)); }

}  // namespace

std::vector<Eigen::Vector4d> vertex_tangents(const TriangleMesh& mesh, const std::vector<Vec3>& normals,
                                             const std::vector<Eigen::Vector2f>& coordinates) {
  std::vector<Vec3> sums(mesh.positions.size(), Vec3::Zero());
  std::vector<double> areas(mesh.positions.size(), 0);  // in texture coordinates, with their sign
  for (const Triangle& t : mesh.triangles) {
    const Eigen::Vector2d a = (coordinates[t[1]] - coordinates[t[0]]).cast<double>(),
                          b = (coordinates[t[2]] - coordinates[t[0]]).cast<double>();
    const double area = a.x() * b.y() - a.y() * b.x();
    if (area == 0) continue;
    const Vec3 direction = (b.y() * (mesh.positions[t[1]] - mesh.positions[t[0]]) -
                            a.y() * (mesh.positions[t[2]] - mesh.positions[t[0]])) /
                           area;
    for (int k = 0; k < 3; ++k) {
      const int v = t[k];
      const Vec3 next = in_plane(mesh.positions[t[(k + 1) % 3]] - mesh.positions[v], normals[v]),
                 last = in_plane(mesh.positions[t[(k + 2) % 3]] - mesh.positions[v], normals[v]);
      sums[v] += angle_between(next, last) * in_plane(direction, normals[v]);
      areas[v] += area;
    }
  }
  std::vector<Eigen::Vector4d> tangents(mesh.positions.size());
  for (std::size_t v = 0; v < tangents.size(); ++v) {
    Vec3 tangent = in_plane(sums[v], normals[v]);
    if (tangent == Vec3::Zero()) tangent = any_tangent(normals[v]);
    tangents[v] << tangent, areas[v] < 0 ? -1 : 1;
  }
  return tangents;
}

ShadingFrame tangent_frame(const Vec3& normal, const Eigen::Vector4d& tangent) {
  ShadingFrame frame;
  const double length = normal.norm();
  frame.normal = length > 0 ? Vec3(normal / length) : Vec3(Vec3::UnitZ());
  frame.tangent = in_plane(tangent.head<3>(), frame.normal);
  if (frame.tangent == Vec3::Zero()) frame.tangent = any_tangent(frame.normal);
  frame.bitangent = (tangent.w() < 0 ? -1 : 1) * frame.normal.cross(frame.tangent);
  return frame;
}

}  // namespace skeletex
