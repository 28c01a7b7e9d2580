// SPDX-License-Identifier: MIT
#pragma once
#include <vector>

namespace skeletex {

/// An arc of the loop of seams around a bone's end: the bone on its other side, and the angles, in turns, between which
/// it runs.
struct AngleInterval {
  int neighbour;
  double begin, end;
};

/// An angle about a model's bone and the angle about a target's bone that corresponds to it, in turns.
struct AnglePair {
  double model = 0;
  double target = 0;  ///< in the model's direction of turning
};

/// The value at an angle of the map that is linear between pairs and grows by a turn per turn.
/// \param pairs     both angles grow; one pair makes a rotation
/// \param from, to  the members between which the map leads
double map_angle(const std::vector<AnglePair>& pairs, double AnglePair::*from, double AnglePair::*to, double turn);

/// Pairs the bounds of equal neighbours of two loops, both in the direction of growing angle. Neighbours that only one
/// loop has are left out. So are neighbours in another order than the rest, the thinnest first.
/// \return empty when the loops have no neighbour in common
std::vector<AnglePair> pair_bounds(const std::vector<AngleInterval>& target, std::vector<AngleInterval> model);

}  // namespace skeletex
