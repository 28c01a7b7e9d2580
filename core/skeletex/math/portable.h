// SPDX-License-Identifier: MIT
#pragma once

/// Functions whose result is the same bits on every processor. Those of the C library are not: it has variants with and
/// without fused operations, and takes what the processor has. Angles in radians.
namespace skeletex::portable {

/// \return within 3.5 units in the last place
double sin(double x);
/// \return within 3.5 units in the last place
double cos(double x);
/// \return within 3.5 units in the last place
double atan2(double y, double x);
/// \return within 3.5 units in the last place
double log(double x);
/// \return within 1 unit in the last place
double exp(double x);
/// \return within 1 unit in the last place
double pow(double x, double exponent);

}  // namespace skeletex::portable
