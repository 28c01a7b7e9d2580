// SPDX-License-Identifier: MIT
#pragma once
#include <array>
#include <optional>
#include <vector>

#include "skeletex/device/context.h"
#include "skeletex/reconstruct/prepared_model.h"

namespace skeletex {

/// A place in a patch: row and column of its texels, not whole.
using Place = Eigen::Vector2d;

/// The cell of four texels around a place, and the place's shares of its later row and column.
struct GridCell {
  int row, column, next_column;
  double row_share, column_share;
};
/// \param place  rows are clamped, columns wrap round
GridCell cell_at(int rows, int columns, const Place& place);

/// The bilinear surface of a patch's points.
struct SourcePatch {
  int rows = 0, columns = 0;
  std::vector<Vec3> points;   ///< rows 0 and rows - 1 on the seams or poles
  std::vector<double> row_u;  ///< of the rows

  /// \param place  rows are clamped, columns wrap round
  Vec3 at(const Place& place) const;
};

/// The surface that a compact model is made from.
struct SourceSurface {
  std::vector<SourcePatch> patches;
  std::vector<std::vector<Vec3>> arcs;  ///< with their corners where they are open
  std::vector<Vec3> corners;
};
SourceSurface source_surface(ClContext& context, const PreparedModel& model);

/// Where a line meets the surface near a place.
struct Meeting {
  Place place;
  double distance = 0;  ///< from the line's origin along its direction
};
/// \param reach  in rows and columns around `start`
/// \param tolerance  how far from the line the point may lie
/// \return nothing when they do not meet there
std::optional<Meeting> meet_line(const SourcePatch& patch, const Place& start, const Place& reach, const Vec3& origin,
                                 const Vec3& direction, double tolerance);

/// The place of the point of the surface that is nearest to a point, to a hundredth of the reach.
/// \param reach  in rows and columns around `start`
Place nearest_place(const SourcePatch& patch, const Place& start, const Place& reach, const Vec3& point);

}  // namespace skeletex
