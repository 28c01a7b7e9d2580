// SPDX-License-Identifier: MIT
#pragma once
#include <Eigen/Geometry>
#include <vector>

#include "skeletex/geometry/mesh.h"

namespace skeletex {

/// The rotation R with the largest trace of R^T moment, where moment is the sum of to * from^T (Kabsch). A moment of
/// rank 1 leaves a turn about one axis open: there the smallest rotation. A moment of 0 gives the identity.
Eigen::Matrix3d best_rotation(const Eigen::Matrix3d& moment);
/// The rotation that turns one set of points about the origin best onto another. Points on a line leave their turn
/// about it open: there the smallest rotation.
Eigen::Quaterniond best_rotation(const std::vector<Vec3>& from, const std::vector<Vec3>& to);

}  // namespace skeletex
