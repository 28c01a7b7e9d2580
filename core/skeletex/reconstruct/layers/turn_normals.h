// SPDX-License-Identifier: MIT
#pragma once
#include <span>
#include <vector>

#include "skeletex/geometry/mesh.h"

namespace skeletex {

/// Normals of a surface after its vertices have moved: they turn as the triangles around a vertex do, by the rotation
/// nearest to the maps of their axes. So a mesh's creases stay out of smooth normals, and no stretch magnifies the
/// angle between normals and triangles, as the inverse transpose of a triangle's map would.
/// \param before  triangles, and where the vertices were
/// \param normals  unit, per vertex
/// \param after  where they are
/// \return unit; where nothing has moved, the normals bit by bit
std::vector<Vec3> turn_normals(const TriangleMesh& before, std::span<const Vec3> normals, std::span<const Vec3> after);

}  // namespace skeletex
