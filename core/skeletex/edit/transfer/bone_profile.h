// SPDX-License-Identifier: MIT
#pragma once
#include <array>
#include <vector>

#include "skeletex/reconstruct/displace.h"

namespace skeletex {

/// Points of all rows of a model's patches on the host, each in the axes (s, b, o) of its bone from the bone's head.
struct BonePoints {
  std::array<std::vector<float>, 3> planes;
  Vec3 at(std::size_t i) const { return {planes[0][i], planes[1][i], planes[2][i]}; }
};
BonePoints download_points(ClContext& context, const DevicePlanes& points);

/// The points of one patch, row by row.
struct PatchPoints {
  const BonePoints* points;
  std::size_t first;  ///< of row 0, column 0
  int width, height;
};

/// One column of a patch from one of its ends on: per row, the components of its point along s', o x s' and o, where s'
/// is the column's radial direction.
using BoneProfile = std::vector<Vec3>;
/// \param length  of the bone: at the tail, places along the bone count from there
BoneProfile bone_profile(const PatchPoints& patch, int column, BoneEnd end, double length);
/// The profile between its rows.
Vec3 at_row(const BoneProfile& profile, double row);

/// The components of a vector in the bone's axes along a column's s', o x s' and o.
Vec3 about_bone(const Vec3& vector, int column, int width);

/// A periodic row of values without waves shorter than about an eighth of a turn.
void smooth_around(std::vector<double>& values);

}  // namespace skeletex
