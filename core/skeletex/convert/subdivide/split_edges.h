// SPDX-License-Identifier: MIT
#pragma once
#include <optional>

#include "skeletex/geometry/mesh.h"

namespace skeletex {

/// The same surface with shorter edges: long edges of large triangles are split in the middle, until there are none.
/// The map of a chart is linear on every triangle; on few large ones it cannot be even.
/// \param longest  edges that are longer are split, world units
/// \param least_area  triangles of at least this area are large, square world units
/// \return nothing where no edge is split
/// \pre longest > 0
std::optional<TriangleMesh> split_long_edges(const TriangleMesh& mesh, double longest, double least_area);

/// The share of the surface that lies in triangles whose edges split_long_edges splits, from 0 to 1.
double share_to_split(const TriangleMesh& mesh, double longest, double least_area);

}  // namespace skeletex
