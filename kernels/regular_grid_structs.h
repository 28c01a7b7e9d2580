// SPDX-License-Identifier: MIT
// Structs that the host and regular_grid.cl share.
#ifndef SKELETEX_REGULAR_GRID_STRUCTS_H
#define SKELETEX_REGULAR_GRID_STRUCTS_H

#ifndef __OPENCL_C_VERSION__
namespace skeletex {
#endif

/// What the kernels take.
typedef struct SlideParameters {
  int row_count;
  int point_count;  ///< of all rows of the lattice
} SlideParameters;

#ifndef __OPENCL_C_VERSION__
static_assert(sizeof(SlideParameters) == 8);
}  // namespace skeletex
#endif
#endif
