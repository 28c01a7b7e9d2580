// SPDX-License-Identifier: MIT
#pragma once
#include "skeletex/device/context.h"
#include "skeletex/geometry/mesh.h"
#include "skeletex/model/texture.h"
#include "skeletex/skeleton/correspondence.h"

namespace skeletex {

/// The map that a morph follows from one model's surface to another's: where the vertices of `from`'s mesh lie on `to`.
/// The triangles of that mesh with these positions are `to`'s surface again, as finely as `from`'s lattice shows it.
/// \return positions in the order of reconstruct_mesh(context, from), world units    \throw DeviceError
std::vector<Vec3> map_surface(ClContext& context, const SkeletexModel& from, const SkeletexModel& to,
                              const Correspondence& correspondence);

/// How a map stretches a surface, from its triangles' singular values s1 >= s2. Scaling all of the surface does not
/// count: the surfaces are compared at equal area. Means are weighted by the triangles' areas before and after, half
/// each, so that both directions of a map have the same; each measure is 1 for an isometry.
struct Distortion {
  double area = 1;   ///< mean of max(s1 s2, 1 / (s1 s2))
  double angle = 1;  ///< mean of (s1 / s2 + s2 / s1) / 2
  double dirichlet =
      1;  ///< mean of (s1^2 + s2^2 + s1^-2 + s2^-2) / 4: symmetric Dirichlet energy over that of an isometry
  double area_median = 1, angle_median = 1, dirichlet_median = 1;  ///< half of the area lies below
  double collapsed =
      0;  ///< share of the area whose triangles have (almost) none on the other side; not in the figures above
};
/// \param to  of the same vertices
Distortion measure_distortion(const TriangleMesh& from, const std::vector<Vec3>& to);

}  // namespace skeletex
