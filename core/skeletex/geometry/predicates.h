// SPDX-License-Identifier: MIT
// Signs of determinants with the error bounds of Shewchuk 1997 (the first, static stage): a sign that rounding could
// have made is reported as 0.
#pragma once
#include "skeletex/geometry/mesh.h"

namespace skeletex {

using Vec2 = Eigen::Vector2d;

/// +1 when a, b, c run counter-clockwise, -1 clockwise, 0 on a line to rounding.
int orientation(const Vec2& a, const Vec2& b, const Vec2& c);
/// +1 when d lies on the side of plane a, b, c that sees them clockwise (behind the face), -1 in front, 0 in the plane
/// to rounding.
int orientation(const Vec3& a, const Vec3& b, const Vec3& c, const Vec3& d);

}  // namespace skeletex
