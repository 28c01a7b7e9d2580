// SPDX-License-Identifier: MIT
#pragma once
#include <vector>

#include "skeletex/model/frame.h"
#include "skeletex/reconstruct/lattice.h"
#include "skeletex/skeleton/separation_planes.h"

namespace skeletex {

/// A model and what follows from it. Make one per model and pass it on. A model converts to one implicitly, for callers
/// that need it once.
struct PreparedModel {
  /// \param of  must outlive this
  /// \throw InputError as number_lattice
  PreparedModel(const SkeletexModel& of);
  /// The lattice's rows, all of them or the inner ones.
  const std::vector<LatticeRow>& rows(RowChoice choice) const;

  const SkeletexModel& model;
  Lattice lattice;              ///< numbers of vertices
  SeparationPlanes separation;  ///< of the bind pose; holds the bones' bases
  FrameTables tables;           ///< relative to the model's origin
  std::vector<LatticeRow> all_rows, inner_rows;
};

}  // namespace skeletex
