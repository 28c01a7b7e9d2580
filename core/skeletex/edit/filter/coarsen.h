// SPDX-License-Identifier: MIT
#pragma once
#include <array>
#include <vector>

#include "skeletex/model/texture.h"
#include "skeletex/reconstruct/lattice.h"

namespace skeletex {

/// A lattice of about every other row, column and seam sample of another one, with all its poles and corners, and how
/// values on it continue over the finer one: bilinear in rows and columns; along seams linear from sample to sample,
/// and from both sides the same. It is what solvers take as their next level, no model of its own: its texture has no
/// texels.
struct CoarseLattice {
  SkeletexModel model;
  Lattice lattice;
  std::vector<Vec3> positions;
  std::vector<int> picks;                    ///< per vertex here, the finer one's vertex at its place
  std::vector<std::array<int, 4>> sources;   ///< per vertex of the finer lattice, whose values it is interpolated from,
  std::vector<std::array<float, 4>> shares;  ///< and their shares; they sum to 1
};
/// \param positions  of all vertices of the model's lattice
CoarseLattice coarsen(const SkeletexModel& model, const Lattice& lattice, const std::vector<Vec3>& positions);

}  // namespace skeletex
