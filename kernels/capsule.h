// SPDX-License-Identifier: MIT
// Where a ray that starts on a bone leaves the capsule around it (paper 3.6.1 and appendix A). Read by OpenCL C and
// GLSL, where REAL is float, and by C++, where it is double.
//
// A capsule is a cylinder around a piece of the bone's axis with half a sphere at both ends. The ray starts at the
// foot, a point of that piece, and runs along q. It leaves the capsule at m q; these functions return m. That point
// lies on the cylinder if it is no further along the axis than the end that q runs towards, else on the sphere there.
//   along         the part of q along the axis, signed
//   sin2          the square of the sine of the angle between q and the axis
//   inverse2      1 / |q|^2
//   below, above  distances from the foot to the lower and to the upper end of the piece
#ifndef SKELETEX_CAPSULE_H
#define SKELETEX_CAPSULE_H

#ifdef __cplusplus
#include <cmath>
#define REAL double
#define CAPSULE_FUNCTION inline
namespace skeletex {
using std::sqrt;
#else
#define REAL float
#define CAPSULE_FUNCTION
#endif

// \param radius2  the square of the capsule's radius, divided by |q|^2
CAPSULE_FUNCTION REAL leave_capsule_of_radius(REAL along, REAL sin2, REAL inverse2, REAL below, REAL above,
                                              REAL radius2) {
  const REAL rest = along < 0.0f ? below : above;
  const REAL rest2 = rest * rest;
  const REAL beyond2 = radius2 - rest2 * inverse2 * sin2;
  const bool is_cylinder = along * along * radius2 <= rest2 * sin2;
  const REAL root = sqrt(is_cylinder ? radius2 / sin2 : (beyond2 > 0.0f ? beyond2 : 0.0f));
  return is_cylinder ? root : rest * (along < 0.0f ? -along : along) * inverse2 + root;
}

// The same for the radius |q|. One square root serves both cases: PoCL's compiler would pair two next to each other,
// and then no longer vectorise the loop around them.
CAPSULE_FUNCTION REAL leave_capsule_of_own_length(REAL along, REAL sin2, REAL inverse2, REAL below, REAL above) {
  const REAL rest = along < 0.0f ? below : above;
  const REAL rest2 = rest * rest;
  const REAL beyond2 = 1.0f - rest2 * inverse2 * sin2;
  const bool is_cylinder = along * along <= rest2 * sin2;
  const REAL root = sqrt(is_cylinder ? sin2 : (beyond2 > 0.0f ? beyond2 : 0.0f));
  const REAL on_cylinder = 1.0f / root;
  const REAL on_sphere = rest * (along < 0.0f ? -along : along) * inverse2 + root;
  return is_cylinder ? on_cylinder : on_sphere;
}

#ifdef __cplusplus
}  // namespace skeletex
#endif
#undef CAPSULE_FUNCTION
#undef REAL

#endif
