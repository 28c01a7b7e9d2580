// SPDX-License-Identifier: MIT
#pragma once
#include "skeletex/geometry/mesh.h"

namespace skeletex {

/// Vector from the nearest point of triangle a, b, c to p, computed from differences of positions only, so that short
/// vectors are as accurate as long ones. Triangles without area are segments or points.
Vec3 offset_from_triangle(const Vec3& p, const Vec3& a, const Vec3& b, const Vec3& c);

}  // namespace skeletex
