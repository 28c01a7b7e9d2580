// SPDX-License-Identifier: MIT
#include "skeletex/math/portable.h"

#include <sleef.h>

// "cinz": scalar code without fused operations, which SLEEF promises to be the same bits everywhere. The functions
// of 3.5 units are as fast as the C library's, those of 1 unit two to six times slower.
namespace skeletex::portable {

double sin(double x) { return Sleef_cinz_sind1_u35purec(x); }
double cos(double x) { return Sleef_cinz_cosd1_u35purec(x); }
double atan2(double y, double x) { return Sleef_cinz_atan2d1_u35purec(y, x); }
double log(double x) { return Sleef_cinz_logd1_u35purec(x); }
double exp(double x) { return Sleef_cinz_expd1_u10purec(x); }
double pow(double x, double exponent) { return Sleef_cinz_powd1_u10purec(x, exponent); }

}  // namespace skeletex::portable
