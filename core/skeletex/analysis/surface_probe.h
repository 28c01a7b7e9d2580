// SPDX-License-Identifier: MIT
#pragma once
#include <span>
#include <vector>

#include "skeletex/geometry/mesh.h"
#include "skeletex/geometry/triangle_tree.h"

namespace skeletex {

/// Where a segment goes through a surface.
struct Crossing {
  double share = 0;  ///< of the way from its begin (0) to its end (1)
  Vec3 point = Vec3::Zero();
  bool is_leaving = false;  ///< from inside to outside
};

struct NearestPoint {
  double distance = 0;
  Vec3 point = Vec3::Zero();
  Vec3 normal = Vec3::Zero();  ///< outward, unit; zero at a triangle without area
};

/// Questions to a surface about points and segments. The mesh must outlive the probe; it need not be closed.
/// Cost: that of a tree of the mesh once, and then for a closed surface little more than that of the triangles near by.
class SurfaceProbe {
 public:
  /// \pre the mesh has triangles
  explicit SurfaceProbe(const TriangleMesh& mesh)
      : mesh_(mesh), diagonal_(bounding_box(mesh).diagonal()), tree_(build_triangle_tree(mesh)) {}

  double diagonal() const { return diagonal_; }
  /// How often the surface winds around each point: a whole number for a closed surface, found by rays; something in
  /// between near the holes of an open one, by solid angles.
  std::vector<double> winding_numbers(std::span<const Vec3> points, bool is_closed) const;
  NearestPoint nearest(const Vec3& point) const;
  /// All crossings from begin to end, in that order.
  std::vector<Crossing> crossings(const Vec3& begin, const Vec3& end) const;
  /// A point well inside the body: halfway through it, along `inward` from a point of the surface.
  Vec3 middle_of_body(const Vec3& surface_point, const Vec3& inward) const;

 private:
  const TriangleMesh& mesh_;
  double diagonal_;
  TriangleTree tree_;
};

}  // namespace skeletex
