// SPDX-License-Identifier: MIT
#pragma once
#include <vector>

#include "skeletex/device/context.h"
#include "skeletex/model/mesh_attributes.h"
#include "skeletex/reconstruct/prepared_model.h"

namespace skeletex {

/// What the vectors of a picture refer to.
enum class DisplacementSpace {
  kObject,   ///< the axes of the mesh
  kTangent,  ///< the tangent frame of the mesh (vertex_tangents): tangent, normal, bitangent. Turns with a posed mesh.
};

/// A picture of vectors from the surface of a coarse mesh to a detailed one.
struct DisplacementPicture {
  int width = 0, height = 0;
  std::vector<Eigen::Vector3f> values;        ///< user's units; rows from the top
  CornerValues<Eigen::Vector2f> coordinates;  ///< where the corners of the coarse mesh read it
  /// Of the corners of the coarse mesh, whose normals are vertex_normals. None for kObject.
  CornerValues<Eigen::Vector4d> tangents;
};

/// What moves the points of a coarse mesh, subdivided without smoothing, on to the surface of a detailed model. Read at
/// a point's texture coordinates, between pixels linearly, and added to the point.
/// \param detail  a pixel per texel
/// \param base    the same model at a smaller size: its mesh in the bind pose is what is moved
/// \throw InputError when the picture would be too large; DeviceError
DisplacementPicture bake_displacement(ClContext& context, const PreparedModel& detail, const PreparedModel& base,
                                      DisplacementSpace space = DisplacementSpace::kObject);

}  // namespace skeletex
