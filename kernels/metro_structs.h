// SPDX-License-Identifier: MIT
// Parameters of metro.cl. Read by C++20 and by OpenCL C 1.2; all members are 4 bytes wide, no padding.
#ifndef SKELETEX_METRO_STRUCTS_H
#define SKELETEX_METRO_STRUCTS_H

#ifdef __OPENCL_C_VERSION__
#define SKELETEX_INT int
#else
#include <cstdint>
#define SKELETEX_INT std::int32_t
namespace skeletex {
#endif

typedef struct NearestParameters {
  SKELETEX_INT count;       ///< points
  SKELETEX_INT run;         ///< consecutive points per work-item
  SKELETEX_INT top_level;   ///< of the tree; level 0 are the blocks
  SKELETEX_INT has_bounds;  ///< 0: bounds_squared is not read
  float enough_squared;     ///< a triangle so near need not be the nearest; 0: always the nearest
} NearestParameters;

#ifndef __OPENCL_C_VERSION__
}  // namespace skeletex
#endif
#undef SKELETEX_INT
#endif
