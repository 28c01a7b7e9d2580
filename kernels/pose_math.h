// SPDX-License-Identifier: MIT
// What the kernels of poses share.
#ifndef SKELETEX_POSE_MATH_H
#define SKELETEX_POSE_MATH_H

// The nearest whole number of |x| < 2^22: what is added leaves no bits for the fraction. rint() costs as much as the
// two polynomials below together with PoCL, which does not turn it into one instruction.
#define NEAREST(x) (((x) + 12582912.0f) - 12582912.0f)

// sin and cos of any angle, to about 2e-7: of half of the angle, reduced to at most a quarter turn, by the polynomials
// whose largest error there is least (5e-9 and 5e-8). Both are exact at 0.
#define SIN_COS(angle, sine, cosine)                                                                                   \
  {                                                                                                                    \
    const float half_angle = 0.5f * ((angle)-6.2831853f * NEAREST((angle)*0.15915494f));                               \
    const float t = half_angle * half_angle;                                                                           \
    const float half_sine =                                                                                            \
        half_angle + half_angle * t * (-0.16666657f + t * (8.3330173e-3f + t * (-1.9806612e-4f + t * 2.6000483e-6f))); \
    const float half_cosine =                                                                                          \
        1.0f + t * (-0.49999932f + t * (4.1663989e-2f + t * (-1.3855924e-3f + t * 2.3194311e-5f)));                    \
    sine = 2.0f * half_sine * half_cosine;                                                                             \
    cosine = 1.0f - 2.0f * half_sine * half_sine;                                                                      \
  }

// Rolls and what a pose changes in slopes go from end to end along this curve, not straight: what changes at one end is
// felt at the other only to second order, so the surface stays smooth there. Slope: the bind pose's, linear, and the
// change.
#define EASED(axial) ((axial) * (axial) * (3.0f - 2.0f * (axial)))

#endif
