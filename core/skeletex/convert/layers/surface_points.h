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
  TriangleIndex triangle;
  Eigen::Vector3f weights = Eigen::Vector3f::Zero();
};

/// The point of a triangle that is nearest to p.
SurfacePoint nearest_in_triangle(const TriangleMesh& mesh, TriangleIndex triangle, const Vec3& p);
/// The weights of a point of a triangle.
SurfacePoint point_in_triangle(const TriangleMesh& mesh, TriangleIndex triangle, const Vec3& point);

/// Points to look for on a mesh, and what their surroundings are like.
struct Probe {
  Vec3 point = Vec3::Zero();
  Vec3 outward = Vec3::Zero();  ///< where its surface looks; zero: anywhere
  double reach = 0;             ///< how far away it may be found where it has to look that way, world units
};
/// The points of the mesh nearest to others. Where the mesh looks the other way there (a thin part, of which the other
/// side is as near), the nearest one within reach that looks the same way.
/// \param tree  of the mesh
std::vector<SurfacePoint> find_surface_points(ClContext& context, const TriangleMesh& mesh, const TriangleTree& tree,
                                              std::span<const Probe> probes);
/// The points of the file's mesh nearest to those of the closed mesh in its place, on the side that faces the same way.
/// \param original  in the frame of `mesh`
/// \param points  of `mesh`; their triangles may be -1
/// \return of `original`, one for each; triangle -1 as there
/// \throw DeviceError
std::vector<SurfacePoint> points_on_original(ClContext& context, const TriangleMesh& original, const TriangleMesh& mesh,
                                             std::span<const SurfacePoint> points);
/// The points of a mesh nearest to the texels of a model; to those between rectangles none (triangle -1).
std::vector<SurfacePoint> surface_points(ClContext& context, const PreparedModel& model, const TriangleMesh& mesh,
                                         const TriangleTree& tree);

}  // namespace skeletex
