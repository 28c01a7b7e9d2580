// SPDX-License-Identifier: MIT
#pragma once
#include <array>
#include <vector>

#include "skeletex/model/texture.h"
#include "skeletex/reconstruct/lattice.h"

namespace skeletex {

/// The next level of a solver: a lattice of about every other row, column and seam sample of a finer one, and of all
/// its poles and corners. Values on it are interpolated on the finer one: bilinear in rows and columns, linear along
/// seams. Its model has no texels.
struct CoarseLattice {
  SkeletexModel model;
  Lattice lattice;
  std::vector<Vec3> positions;
  std::vector<int> picks;                    ///< per vertex, the vertex of the finer lattice at its place
  std::vector<std::array<int, 4>> sources;   ///< per vertex of the finer lattice, the vertices that it is a mean of
  std::vector<std::array<float, 4>> shares;  ///< their shares, which sum to 1
};
/// \param positions  of all vertices of the model's lattice, world units
CoarseLattice coarsen(const SkeletexModel& model, const Lattice& lattice, const std::vector<Vec3>& positions);

}  // namespace skeletex
