// SPDX-License-Identifier: MIT
#pragma once
#include <span>
#include <vector>

#include "skeletex/geometry/mesh.h"

namespace skeletex {

/// Normals of a surface after its vertices have moved: they turn as the triangles around a vertex do. Each triangle
/// maps a normal by the inverse transpose of the linear map that takes its edges and unit normal to those that it has
/// afterwards; the mean, weighted by the areas before, is what the vertex gets.
/// \param before  triangles, and where the vertices were
/// \param normals  unit, per vertex
/// \param after  where they are
/// \return unit; where nothing has moved, the normals bit by bit
std::vector<Vec3> turn_normals(const TriangleMesh& before, std::span<const Vec3> normals, std::span<const Vec3> after);

}  // namespace skeletex
