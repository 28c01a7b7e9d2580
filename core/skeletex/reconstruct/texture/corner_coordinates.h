// SPDX-License-Identifier: MIT
#pragma once
#include <array>
#include <vector>

#include "skeletex/geometry/mesh.h"
#include "skeletex/reconstruct/prepared_model.h"

namespace skeletex {

/// The bone of each triangle of a model's mesh (reconstruct_mesh).
std::vector<int> triangle_bones(const Lattice& lattice, const std::vector<Triangle>& triangles);

/// Where the corners of each triangle lie in its patch, three pairs each: the share of the rows (0 at row 0, 1 at the
/// last row), and v. v does not jump inside a triangle, so that it may lie below 0 or above 1.
/// \param mesh  the model's mesh in its bind pose
std::vector<std::array<double, 2>> corner_coordinates(const PreparedModel& model, const TriangleMesh& mesh);

}  // namespace skeletex
