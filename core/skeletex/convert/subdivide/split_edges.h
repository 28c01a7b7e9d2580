// SPDX-License-Identifier: MIT
#pragma once
#include <optional>

#include "skeletex/geometry/mesh.h"

namespace skeletex {

/// The same surface with shorter edges: those of large triangles are split in the middle where they are long, until no
/// large triangle has a long edge. The map of a chart is linear on every triangle; on few large ones it cannot be even.
/// \param longest  no edge of a large triangle stays longer, world units
/// \param least_area  of a large triangle, square world units
/// \return nothing where no edge is split
/// \pre longest > 0
std::optional<TriangleMesh> split_long_edges(const TriangleMesh& mesh, double longest, double least_area);

}  // namespace skeletex
