// SPDX-License-Identifier: MIT
#pragma once
#include <array>
#include <cstdint>

#include "skeletex/skeleton/skeleton.h"

namespace skeletex {

/// Nodes of a compact model lie on a grid of 2^-18 of the diagonal.
inline constexpr double kNodeStep = 0x1p-18;
/// Angles of `s` and of corners are in 65536ths of a turn.
inline constexpr int kAngleSteps = 65536;

/// The angle of a direction about an axis, from the world axis that is least aligned with it.
int angle_code(const Vec3& axis, const Vec3& s);
Vec3 direction_of_code(const Vec3& axis, int code);

/// A unit frame: the scale is mantissa 2^(exponent - 24), the offset in 2^-24 of the scale.
struct FrameCode {
  int exponent = 0;
  std::uint32_t mantissa = 0;
  std::array<std::int64_t, 3> offset{};
};
FrameCode frame_code(const UnitFrame& frame);
UnitFrame frame_of_code(const FrameCode& code);

/// Nodes, frame and directions s as a compact file holds them.
Skeleton rounded_skeleton(const Skeleton& skeleton);

}  // namespace skeletex
