// SPDX-License-Identifier: MIT
#pragma once
#include <span>

#include "skeletex/device/context.h"
#include "skeletex/geometry/mesh.h"
#include "skeletex/reconstruct/prepared_model.h"

namespace skeletex {

/// The model whose bind pose has its vertices at the given places: positions become texels, poles and seam samples
/// again (the inverse of lattice_positions). Shading normals turn with the surface. What has not moved stays bit by bit
/// as it is.
///
/// A seam lies in its separation planes, and a corner lies on the ray where separation planes meet. The model stores a
/// seam vertex as its angle about the bone and its distance from it. So a vertex that lies in its separation plane
/// comes back at its place (slide_to_separation moves it there); any other comes back at the point of the plane with
/// that angle and distance. Row 0 and the last row of a patch follow the seams and poles.
/// \param positions  of all
/// vertices of the model's lattice (lattice.h), world units
/// \throw InputError when their number differs or one is not
/// finite; DeviceError
SkeletexModel store_positions(ClContext& context, const PreparedModel& model, std::span<const Vec3> positions);

/// Moves seam vertices along the surface into their separation planes, and corners onto their rays. Each takes the
/// shortest way in its tangent plane, so that the surface keeps its place and only the seam slides over it. Where the
/// angle between surface and separation plane is below some 18 degrees, that way would be long; there it turns towards
/// the nearest point of the separation plane.
/// \param normals  of the surface at all vertices, unit
void slide_to_separation(const PreparedModel& model, std::span<const Vec3> normals, std::span<Vec3> positions);

}  // namespace skeletex
