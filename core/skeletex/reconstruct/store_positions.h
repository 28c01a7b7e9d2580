// SPDX-License-Identifier: MIT
#pragma once
#include <span>

#include "skeletex/device/context.h"
#include "skeletex/geometry/mesh.h"
#include "skeletex/model/texture.h"

namespace skeletex {

/// The model whose bind pose has its vertices at the given places: positions become texels, poles and seam samples
/// again (the inverse of lattice_positions). What has not moved stays bit by bit as it is.
///
/// A seam lies in its separation planes, and a corner on the ray where separation planes meet: of a seam vertex the
/// angle about the bone and the distance from it are kept, so it comes back at its place if it lies there
/// (slide_to_walls moves it there), else at the point of the separation plane that has both. Row 0 and the last row of
/// a patch follow the seams and poles. \param positions  of all vertices of the model's lattice (lattice.h), world
/// units \throw InputError when their number is another one or one is not finite; DeviceError
SkeletexModel store_positions(ClContext& context, const SkeletexModel& model, std::span<const Vec3> positions);

/// Moves seam vertices along the surface into their separation planes, and corners onto their rays: each takes the
/// shortest way in its tangent plane, so that the surface keeps its place and only the seam slides over it. Where the
/// surface runs along the separation plane (below some 18 degrees) that way would be long; there it turns towards the
/// nearest point of the separation plane. \param normals  of the surface at all vertices, unit
void slide_to_separation(const SkeletexModel& model, std::span<const Vec3> normals, std::span<Vec3> positions);

}  // namespace skeletex
