// SPDX-License-Identifier: MIT
#pragma once
#include <Eigen/Core>
#include <cmath>

namespace skeletex {

/// Two numbers from -1 to 1 for a direction: the octahedron around the origin, its lower half folded out (Cigolle et
/// al. 2014, A Survey of Efficient Representations for Independent Unit Vectors). (0, 0) is the direction (0, 0, 1).
/// \param direction  of any length; without one: (0, 0)
inline Eigen::Vector2f octahedral_of(const Eigen::Vector3f& direction) {
  const float sum = direction.cwiseAbs().sum();
  if (!(sum > 0)) return Eigen::Vector2f::Zero();
  Eigen::Vector2f p = direction.head<2>() / sum;
  if (direction.z() >= 0) return p;
  return {std::copysign(1 - std::abs(p.y()), p.x()), std::copysign(1 - std::abs(p.x()), p.y())};
}

/// The unit direction of two such numbers.
inline Eigen::Vector3f direction_of(const Eigen::Vector2f& p) {
  Eigen::Vector3f direction(p.x(), p.y(), 1 - std::abs(p.x()) - std::abs(p.y()));
  if (direction.z() < 0) {
    direction.x() = std::copysign(1 - std::abs(p.y()), p.x());
    direction.y() = std::copysign(1 - std::abs(p.x()), p.y());
  }
  return direction.normalized();
}

}  // namespace skeletex
