// SPDX-License-Identifier: MIT
#pragma once
#include <Eigen/Geometry>
#include <vector>

#include "skeletex/geometry/mesh.h"

namespace skeletex {

/// The rotation that turns one set of points about the origin best onto another (Kabsch). Points on a line leave their
/// turn about it open: there the smallest rotation.
Eigen::Quaterniond best_rotation(const std::vector<Vec3>& from, const std::vector<Vec3>& to);

}  // namespace skeletex
