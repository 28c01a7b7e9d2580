// SPDX-License-Identifier: MIT
#pragma once
#include <cmath>
#include <optional>
#include <vector>

#include "skeletex/geometry/mesh.h"

namespace skeletex {

/// Turns without whole ones: the shortest way to the same angle, from -1/2 to 1/2.
inline double shortest_turn(double turns) { return turns - std::round(turns); }

/// The v of a boundary loop's points: the angles about the bone, as near as possible in the least-squares sense (along
/// the loop's length, however densely it is sampled) while v grows everywhere, by at least `least_density` of the mean
/// rate along the loop's length. Most loops keep their angles to within a fraction of a column; where a loop turns back
/// about the bone, or runs towards it, v follows its length instead, so that no stretch of the seam falls between two
/// columns.
/// \param points  once around in the direction of growing angle, the first not repeated
/// \param turns  their angles about the bone, in turns, any lift
/// \return increasing values, the last below the first plus 1; nothing when the loop does not wind once around the bone
std::optional<std::vector<double>> loop_turns(const std::vector<Vec3>& points, const std::vector<double>& turns,
                                              double least_density = 0.4);

/// Shares of the way along an arc between two corners, from 0 to 1: by the angles about a bone, made to grow in the
/// same way. The bones on both sides see mirrored angles, and give their arc the same shares.
/// \param points, turns  the corners included, at least two
std::vector<double> arc_shares(const std::vector<Vec3>& points, const std::vector<double>& turns,
                               double least_density = 0.4);

/// Where a loop's polyline passes v = j / columns, for each column j.
/// \param turns  increasing, the last below the first plus 1
std::vector<Vec3> points_at_columns(std::vector<Vec3> points, std::vector<double> turns, int columns);

}  // namespace skeletex
