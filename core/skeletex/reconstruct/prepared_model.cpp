// SPDX-License-Identifier: MIT
#include "skeletex/reconstruct/prepared_model.h"

namespace skeletex {

PreparedModel::PreparedModel(const SkeletexModel& of)
    : model(of),
      lattice(number_lattice(of)),
      separation(of.skeleton),
      tables(frame_tables(of.skeleton, separation, of.patches, of.origin)),
      all_rows(lattice_rows(of.patches, RowChoice::kAll)),
      inner_rows(lattice_rows(of.patches, RowChoice::kInner)) {}

const std::vector<LatticeRow>& PreparedModel::rows(RowChoice choice) const {
  return choice == RowChoice::kInner ? inner_rows : all_rows;
}

}  // namespace skeletex
