// SPDX-License-Identifier: MIT
#pragma once
#include "skeletex/device/context.h"
#include "skeletex/geometry/mesh.h"
#include "skeletex/model/texture.h"
#include "skeletex/skeleton/correspondence.h"

namespace skeletex {

/// The map of a morph from one model's surface to another's: the places on `to` of the vertices of `from`'s mesh. With
/// these positions, the triangles of that mesh show `to`'s surface at the resolution of `from`'s lattice.
/// \return positions in the order of reconstruct_mesh(context, from), world units
/// \throw DeviceError
std::vector<Vec3> map_surface(ClContext& context, const SkeletexModel& from, const SkeletexModel& to,
                              const Correspondence& correspondence);

/// How a map stretches a surface, from the singular values s1 >= s2 of its triangles. The surfaces are compared at
/// equal area. Means are weighted by the mean of a triangle's areas before and after, so that a map and its inverse
/// have the same. Each measure is 1 for an isometry.
struct Distortion {
  double area = 1;   ///< mean of max(s1 s2, 1 / (s1 s2))
  double angle = 1;  ///< mean of (s1 / s2 + s2 / s1) / 2
  /// Mean of (s1^2 + s2^2 + s1^-2 + s2^-2) / 4: the symmetric Dirichlet energy over that of an isometry.
  double dirichlet = 1;
  double area_median = 1, angle_median = 1, dirichlet_median = 1;  ///< half of the area lies below
  /// Share of the area whose triangles have (almost) no area on the other side; these are not counted above.
  double collapsed = 0;
};
/// \param to  positions of the same vertices
Distortion measure_distortion(const TriangleMesh& from, const std::vector<Vec3>& to);

}  // namespace skeletex
