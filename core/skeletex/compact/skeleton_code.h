// SPDX-License-Identifier: MIT
#pragma once
#include "skeletex/skeleton/skeleton.h"

namespace skeletex {

/// Nodes of a compact model lie on a grid of 2^-20 of the diagonal.
inline constexpr double kNodeStep = 0x1p-20;
/// Angles of `s` and of corners are in 65536ths of a turn.
inline constexpr int kAngleSteps = 65536;

/// The angle of a direction about an axis, from the world axis that is least aligned with it.
int angle_code(const Vec3& axis, const Vec3& s);
Vec3 direction_of_code(const Vec3& axis, int code);

/// Nodes, frame and directions s as a compact file holds them.
Skeleton rounded_skeleton(const Skeleton& skeleton);

}  // namespace skeletex
