// SPDX-License-Identifier: MIT
#pragma once
#include <span>
#include <vector>

#include "skeletex/device/context.h"
#include "skeletex/geometry/triangle_tree.h"
#include "skeletex/reconstruct/prepared_model.h"

namespace skeletex {

/// A point of a mesh: a triangle and the weights of its corners, which add up to 1.
struct SurfacePoint {
  int triangle = -1;
  Eigen::Vector3f weights = Eigen::Vector3f::Zero();
};

/// The point of a triangle that is nearest to p.
SurfacePoint nearest_in_triangle(const TriangleMesh& mesh, int triangle, const Vec3& p);

/// Per texel of a model the point of the mesh that it stands for: the nearest one. Where the mesh looks the other way
/// there than the texels around (a thin part, of which the other side is as near), the nearest one that looks the same
/// way, if it is about as near.
/// \param tree  of the mesh    \return of texels between rectangles none (triangle -1)
std::vector<SurfacePoint> surface_points(ClContext& context, const PreparedModel& model, const TriangleMesh& mesh,
                                         const TriangleTree& tree);

}  // namespace skeletex
