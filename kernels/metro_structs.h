// SPDX-License-Identifier: MIT
// Parameters of metro.cl. Read by C++20 and by OpenCL C 1.2; all members are 4 bytes wide, no padding.
#ifndef SKELETEX_METRO_STRUCTS_H
#define SKELETEX_METRO_STRUCTS_H

#ifndef __OPENCL_C_VERSION__
namespace skeletex {
#endif

typedef struct NearestParameters {
  int count;             ///< points
  int run;               ///< consecutive points per work-item
  int top_level;         ///< of the tree; level 0 are the blocks
  float enough_squared;  ///< a triangle so near need not be the nearest; 0: always the nearest
} NearestParameters;

#ifndef __OPENCL_C_VERSION__
}  // namespace skeletex
#endif
#endif
