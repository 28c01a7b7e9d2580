// SPDX-License-Identifier: MIT
#pragma once
#include <span>
#include <vector>

#include "skeletex/device/context.h"
#include "skeletex/geometry/mesh.h"
#include "skeletex/geometry/triangle_tree.h"

namespace skeletex {

/// The triangles of a mesh on the device, for nearest points. Of the tree it keeps what it needs.
class NearestSearch {
 public:
  /// \param tree  of the mesh
  NearestSearch(ClContext& context, const TriangleMesh& mesh, const TriangleTree& tree);
  /// Places along the curve -> triangles.
  const std::vector<int>& order() const { return order_; }

  /// Per point the nearest triangle, found in single precision. Points that follow each other in space are found
  /// fastest.
  /// \param distances  when given, those of the device: float32's resolution of the mesh's extent; world units
  /// \param enough     a triangle so near need not be the nearest: faster where only what is further matters; world
  ///                   units
  void find(std::span<const Vec3> points, std::span<int> triangles, std::span<float> distances = {}, float enough = 0);

 private:
  ClContext& context_;
  Vec3 origin_;
  double scale_;
  int top_level_;
  std::vector<int> order_;
  ClBuffer<float> boxes_, blocks_, nearest_squared_;
  ClBuffer<int> level_begin_, nearest_;
  std::vector<float> points_;  ///< planes x, y, z
};

}  // namespace skeletex
