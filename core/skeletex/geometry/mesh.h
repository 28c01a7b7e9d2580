// SPDX-License-Identifier: MIT
#pragma once
#include <Eigen/Core>
#include <array>
#include <string>
#include <vector>

namespace skeletex {

using Vec3 = Eigen::Vector3d;
using Triangle = std::array<int, 3>;

/// An indexed triangle mesh. Triangles are counter-clockwise seen from outside.
struct TriangleMesh {
  std::vector<Vec3> positions;
  std::vector<Triangle> triangles;
};

/// Values at the corners of a mesh's triangles. A vertex may have several: at creases, and where a texture is cut.
template <class T>
struct CornerValues {
  std::vector<T> values;
  std::vector<Triangle> corners;  ///< per triangle the values of its corners; empty: those with its vertices' numbers

  bool empty() const { return values.empty(); }
  const Triangle& of(const TriangleMesh& mesh, std::size_t triangle) const {
    return corners.empty() ? mesh.triangles[triangle] : corners[triangle];
  }
};

struct BoundingBox {
  Vec3 lower = Vec3::Zero();
  Vec3 upper = Vec3::Zero();
  Vec3 centre() const { return 0.5 * (lower + upper); }
  /// Length of the diagonal: the unit in which the project states distances and tolerances ("diag").
  double diagonal() const { return (upper - lower).norm(); }
};

/// A point for messages: "(0.12, 0.4, 0.03)".
std::string text_of(const Vec3& point);
/// Bounding box of all positions; zero for an empty mesh.
BoundingBox bounding_box(const TriangleMesh& mesh);
/// Area vector of a triangle: half the cross product of its edges, along the outward normal.
Vec3 area_vector(const TriangleMesh& mesh, const Triangle& triangle);
/// Per vertex the unit mean of the normals of the triangles around, weighted by their angles there; zero where that has
/// no direction.
std::vector<Vec3> vertex_normals(const TriangleMesh& mesh);
/// The same by corners: triangles that meet in an edge at more than `crease_angle` (radians) do not count for each
/// other.
/// \pre every directed edge occurs at most once
CornerValues<Vec3> creased_normals(const TriangleMesh& mesh, double crease_angle);
double surface_area(const TriangleMesh& mesh);
/// Enclosed volume by the divergence theorem; negative when the mesh is inside out.
/// \pre closed
double signed_volume(const TriangleMesh& mesh);

}  // namespace skeletex
