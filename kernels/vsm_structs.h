// SPDX-License-Identifier: MIT
// What host and device share of the maps. Read by C++20 and by OpenCL C 1.2; all members are 4 bytes wide, no padding.
#ifndef SKELETEX_VSM_STRUCTS_H
#define SKELETEX_VSM_STRUCTS_H

#define VSM_SLICE 32     // rows whose entries lie together
#define VSM_POLE (-128)  // the jump to a pole

#ifdef __OPENCL_C_VERSION__
#define SKELETEX_INT int
#else
#include <cstdint>
#define SKELETEX_INT std::int32_t
namespace skeletex {
#endif

/// Sizes, and where the tables and planes begin in the buffers of vsm.cl.
typedef struct VsmLayout {
  SKELETEX_INT rows;                    ///< vertices of all charts, with padding
  SKELETEX_INT entries;                 ///< of all rows, with padding
  SKELETEX_INT triangles;               ///< of all charts
  SKELETEX_INT slice_begin;             ///< in `tables`, per slice: its first entry; the slice's chart is at 0
  SKELETEX_INT row_length;              ///< in `tables`, per row: its entries
  SKELETEX_INT later_end;               ///< per row: its entries whose neighbours are eliminated later
  SKELETEX_INT fixed_end;               ///< per row: these and those with fixed neighbours
  SKELETEX_INT matrix_begin;            ///< per row: where the elimination has its values
  SKELETEX_INT columns;                 ///< per entry: the neighbour
  SKELETEX_INT triangles_at;            ///< two planes, per entry: the triangles at the edge
  SKELETEX_INT fixed, roots, residual;  ///< in `system`, see EliminationLayout
} VsmLayout;

#ifndef __OPENCL_C_VERSION__
static_assert(sizeof(VsmLayout) == 4 * 13);
}  // namespace skeletex
#endif
#undef SKELETEX_INT
#endif
