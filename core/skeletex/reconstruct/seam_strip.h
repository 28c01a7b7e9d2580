// SPDX-License-Identifier: MIT
#pragma once
#include <span>
#include <vector>

#include "skeletex/geometry/mesh.h"
#include "skeletex/skeleton/skeleton.h"

namespace skeletex {

/// A closed polyline around a bone: at a seam, or a row of the lattice.
struct Ring {
  std::vector<int> vertices;  ///< in the direction of growing v
  std::vector<double> turns;  ///< angle of each about the bone; seams: measured, rows: column / width
};

/// Fills the strip between a seam and the inner row next to it with triangles, outward. Every edge of both rings is an
/// edge of exactly one triangle, and no edge between the rings occurs twice, whatever the rings are. Edges between the
/// rings span about a cell of v at most; among these merges the one with the smallest sum of their squared lengths is
/// taken.
/// \param turns  of the seam, in place of its own: see seam_turns
/// \pre seam has at least 3 vertices, row at least 4
void append_seam_strip(std::span<const Vec3> positions, const Ring& seam, std::span<const double> turns,
                       const Ring& row, BoneEnd end, std::vector<Triangle>& triangles);
/// The same with the turns that follow from the seam's measured ones.
void append_seam_strip(std::span<const Vec3> positions, const Ring& seam, const Ring& row, BoneEnd end,
                       std::vector<Triangle>& triangles);

/// v of a seam's vertices: that of its loop (loop_turns), the first in [0,1), with no step above 0.45 of a turn. If the
/// points do not wind once around the bone, it is evenly spread.
std::vector<double> seam_turns(const std::vector<Vec3>& points, const std::vector<double>& turns);

}  // namespace skeletex
