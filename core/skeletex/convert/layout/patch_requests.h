// SPDX-License-Identifier: MIT
#pragma once
#include <span>
#include <vector>

#include "skeletex/convert/layout/pack_atlas.h"
#include "skeletex/convert/layout/row_profile.h"
#include "skeletex/convert/parameterize/chart.h"
#include "skeletex/model/texture.h"

namespace skeletex {

/// What a patch's share of the texels follows: the error that is expected of it, its triangles or its area.
enum class TexelShare { kError, kTriangles, kArea };

/// How far flat triangles over a regular grid on a map are expected to leave the surface: the integral of the
/// distance, but for a constant factor, is around / columns^2 + along / rows^2 + 2 both / (columns rows). World units
/// cubed.
struct ExpectedError {
  double around = 0, along = 0, both = 0;
  /// The same, error times texels, of a map that would spread texels evenly over the surface.
  double even = 0;

  /// columns / rows with the least error for a number of texels; infinite or not a number where the surface bends in
  /// one direction or none
  double best_ratio() const;
  /// The error times the number of texels, with that ratio.
  double least() const;
  /// The error times the number of texels.
  double with_ratio(double columns_per_row) const;
};
/// The expected error of a chart that is mapped. A surface of triangles bends at its edges: one of length l and
/// dihedral angle d adds d l h^2, where h is the extent of a cell across it (that of a column plus that of a row, each
/// as the triangles at the edge are stretched). Triangles at poles do not count.
/// \param profile  of its rows; null: they are even in u
ExpectedError expected_error(const Chart& chart, const RowProfile* profile);

/// One bone's part of the surface.
struct PatchSource {
  const ExpectedError* error = nullptr;        ///< null for a height field, which has no map
  double triangles = 0, area = 0, length = 0;  ///< world units; length: of the meridians, their mean
};
/// The shares and side ratios of patches. By triangles or area their sides have the ratio of girth to length. By error
/// they have the ratio with the least expected error, and the share is the geometric mean of triangles and the root of
/// that error: shares by the root have the least error all in all, where errors fall as cells get smaller; but where
/// texels sit on vertices and edges, what counts is how many there are for each. Of very uneven maps the root counts as
/// twenty times that of an even one. Height fields keep the ratio of girth to length, and their share is by triangles.
std::vector<PatchRequest> patch_requests(std::span<const PatchSource> sources, TexelShare share);

}  // namespace skeletex
