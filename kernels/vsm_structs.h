// SPDX-License-Identifier: MIT
// What host and device share of the maps. Read by C++20 and by OpenCL C 1.2; all members are 4 bytes wide, no padding.
#ifndef SKELETEX_VSM_STRUCTS_H
#define SKELETEX_VSM_STRUCTS_H

#define VSM_SLICE 32     // rows whose entries lie together
#define VSM_POLE (-128)  // the jump to a pole

#ifndef __OPENCL_C_VERSION__
namespace skeletex {
#endif

/// Sizes, and where the tables and planes begin in the buffers of vsm.cl.
typedef struct VsmLayout {
  int rows;                    ///< vertices of all charts, with padding
  int entries;                 ///< of all rows, with padding
  int triangles;               ///< of all charts
  int slice_begin;             ///< in `tables`, per slice: its first entry; the slice's chart is at 0
  int row_length;              ///< in `tables`, per row: its entries
  int later_end;               ///< per row: its entries whose neighbours are eliminated later
  int fixed_end;               ///< per row: these and those with fixed neighbours
  int matrix_begin;            ///< per row: where the elimination has its values
  int columns;                 ///< per entry: the neighbour
  int triangles_at;            ///< two planes, per entry: the triangles at the edge
  int fixed, roots, residual;  ///< in `system`, see EliminationLayout
} VsmLayout;

#ifndef __OPENCL_C_VERSION__
static_assert(sizeof(VsmLayout) == 4 * 13);
}  // namespace skeletex
#endif
#endif
