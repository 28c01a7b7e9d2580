// SPDX-License-Identifier: MIT
#pragma once
#include <Eigen/Core>
#include <vector>

#include "skeletex/geometry/mesh.h"

namespace skeletex {

/// The tangent space at a point of a textured surface: unit vectors at right angles.
struct ShadingFrame {
  Vec3 tangent;  ///< where u grows
  Vec3 normal;
  Vec3 bitangent;  ///< where v grows, upwards in the picture
};

/// Unit tangents by the rule of MikkTSpace (Mikkelsen 2008), on which glTF relies: of the triangles at a vertex, the
/// directions in which u grows, projected on to the plane of its normal and weighted by their angles there.
/// \param mesh         one vertex for each pair of normal and texture coordinates (split_vertices)
/// \param normals      unit, per vertex
/// \param coordinates  per vertex; v upwards
/// \return per vertex x, y, z, and the sign of the bitangent: cross(normal, tangent) times the sign
std::vector<Eigen::Vector4d> vertex_tangents(const TriangleMesh& mesh, const std::vector<Vec3>& normals,
                                             const std::vector<Eigen::Vector2f>& coordinates);

/// The frame between vertices, as programs that shade interpolate it.
/// \param normal   interpolated between the vertices of a triangle, of any length; so is the tangent
ShadingFrame tangent_frame(const Vec3& normal, const Eigen::Vector4d& tangent);

}  // namespace skeletex
