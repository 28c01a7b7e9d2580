// SPDX-License-Identifier: MIT
#pragma once
#include <utility>

#include "skeletex/geometry/mesh.h"
#include "skeletex/geometry/triangle_tree.h"

namespace skeletex {

/// A closed mesh and its tree, for questions about single points. Both must outlive it.
struct Surface {
  const TriangleMesh& mesh;
  const TriangleTree& tree;
  double diagonal;
  UnitFrame frame{};  ///< of the mesh

  Surface(const TriangleMesh& mesh_, const TriangleTree& tree_)
      : mesh(mesh_), tree(tree_), diagonal(bounding_box(mesh_).diagonal()) {}
  /// Distance to the surface: for a point inside, the radius of the largest ball around it.
  double radius(const Vec3& point) const { return find_nearest_triangle(mesh, tree, point).distance; }
  /// Whether the surface is nearer to a point than a distance. Faster than the radius, the smaller the distance.
  bool is_near(const Vec3& point, double distance) const {
    return find_nearest_triangle(mesh, tree, point, distance).triangle >= 0;
  }
  /// Whether the way from one point straight to another meets the surface.
  bool is_between(const Vec3& from, const Vec3& to) const {
    return find_first_hit(mesh, tree, from, to - from, 1) <= 1;
  }
};

/// A mesh of the user with its tree in its unit frame, where tolerances hold at every scale.
struct UnitMesh {
  UnitFrame frame;
  TriangleMesh mesh;
  TriangleTree tree;

  UnitMesh(const TriangleMesh& user, TriangleTree user_tree)
      : frame(unit_frame(user)), mesh(in_unit_frame(user, frame)), tree(std::move(user_tree)) {
    tree.origin = Vec3::Zero();  // what a tree holds is in this frame already
    tree.scale = 1;
  }
};

}  // namespace skeletex
