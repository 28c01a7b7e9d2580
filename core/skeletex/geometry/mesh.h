// SPDX-License-Identifier: MIT
#pragma once
#include <Eigen/Core>
#include <array>
#include <span>
#include <string>
#include <vector>

#include "skeletex/geometry/index.h"

namespace skeletex {

using Vec3 = Eigen::Vector3d;
/// Its vertices: plain numbers, as buffers of devices hold them.
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

/// Coordinates in which a body has a diagonal of 1 and lies around 0, so that single precision holds it: a point of the
/// user is offset + scale * p. The default leaves points as they are.
struct UnitFrame {
  Vec3 offset = Vec3::Zero();
  double scale = 1;
  Vec3 from_user(const Vec3& p) const { return (p - offset) / scale; }
  Vec3 to_user(const Vec3& p) const { return offset + scale * p; }
  /// On a grid of 2^-30, a thousandth of what texels resolve: so one body gives the same numbers at every scale, in
  /// spite of the rounding of its coordinates.
  Vec3 rounded_from_user(const Vec3& p) const { return (from_user(p) * 0x1p30).array().rint() * 0x1p-30; }
  bool is_identity() const { return offset == Vec3::Zero() && scale == 1; }
  friend bool operator==(const UnitFrame&, const UnitFrame&) = default;
};
/// Diagonals of meshes, in the user's units, whose squares and cubes double precision holds with room to spare.
inline constexpr double kSmallestScale = 1e-60, kLargestScale = 1e60;
/// Offset and scale of a mesh: centre and diagonal of its bounding box.
/// \throw InputError when it has no extent, or one beyond kSmallestScale and kLargestScale
UnitFrame unit_frame(const TriangleMesh& mesh);
/// A mesh of the user in its unit frame, rounded (UnitFrame::rounded_from_user).
TriangleMesh in_unit_frame(TriangleMesh mesh, const UnitFrame& frame);
/// A mesh of the user in a frame, and a mesh of a frame in the user's units.
TriangleMesh in_frame(TriangleMesh mesh, const UnitFrame& frame);
TriangleMesh in_user_units(TriangleMesh mesh, const UnitFrame& frame);

/// A point for messages: "(0.12, 0.4, 0.03)".
std::string text_of(const Vec3& point);
/// Bounding box of points, or of all positions of a mesh; zero for none.
BoundingBox bounding_box(std::span<const Vec3> points);
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
