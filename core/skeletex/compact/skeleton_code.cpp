// SPDX-License-Identifier: MIT
#include "skeletex/compact/skeleton_code.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "skeletex/math/portable.h"

namespace skeletex {
namespace {

/// Two directions across an axis.
std::array<Vec3, 2> across_axis(const Vec3& axis) {
  int least = 0;
  for (int k = 1; k < 3; ++k)
    if (std::abs(axis[k]) < std::abs(axis[least])) least = k;
  const Vec3 x = (Vec3::Unit(least) - axis[least] * axis).normalized();
  return {x, axis.cross(x)};
}

}  // namespace

int angle_code(const Vec3& axis, const Vec3& s) {
  const auto [x, y] = across_axis(axis);
  const double turn = portable::atan2(s.dot(y), s.dot(x)) / (2 * std::numbers::pi);
  return static_cast<int>(std::lround(turn * kAngleSteps)) & (kAngleSteps - 1);
}

Vec3 direction_of_code(const Vec3& axis, int code) {
  const auto [x, y] = across_axis(axis);
  const double angle = 2 * std::numbers::pi * code / kAngleSteps;
  return portable::cos(angle) * x + portable::sin(angle) * y;
}

FrameCode frame_code(const UnitFrame& frame) {
  FrameCode code;
  const double mantissa = std::frexp(frame.scale, &code.exponent);
  code.mantissa = static_cast<std::uint32_t>(std::min(16777215.0, std::rint(std::ldexp(mantissa, 24))));
  const double scale = std::ldexp(code.mantissa, code.exponent - 24);
  for (int k = 0; k < 3; ++k)
    code.offset[k] = std::llround(std::clamp(frame.offset[k] / scale * 0x1p24, -0x1p38, 0x1p38));
  return code;
}

UnitFrame frame_of_code(const FrameCode& code) {
  UnitFrame frame;
  frame.scale = std::ldexp(code.mantissa, code.exponent - 24);
  for (int k = 0; k < 3; ++k) frame.offset[k] = static_cast<double>(code.offset[k]) * 0x1p-24 * frame.scale;
  return frame;
}

Skeleton rounded_skeleton(const Skeleton& skeleton) {
  const std::vector<BoneBasis> bases = bone_bases(skeleton);
  Skeleton rounded = skeleton;
  rounded.frame = frame_of_code(frame_code(skeleton.frame));
  for (Node& node : rounded.nodes) node.position = (node.position / kNodeStep).array().rint() * kNodeStep;
  for (std::size_t bone = 0; bone < rounded.bones.size(); ++bone) {
    const Vec3 axis = direction_from(rounded, {static_cast<int>(bone), BoneEnd::kHead});
    rounded.bones[bone].s = direction_of_code(axis, angle_code(axis, bases[bone].s));
  }
  return rounded;
}

}  // namespace skeletex
