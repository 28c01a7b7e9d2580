// SPDX-License-Identifier: MIT
// What host and device share of the maps. Read by C++20 and by OpenCL C 1.2; all members are 4 bytes wide, no padding.
#ifndef SKELETEX_VSM_STRUCTS_H
#define SKELETEX_VSM_STRUCTS_H

#define VSM_TILE 8  // rows and columns of dense matrices are padded to this

#ifdef __OPENCL_C_VERSION__
#define SKELETEX_INT int
#else
#include <cstdint>
#define SKELETEX_INT std::int32_t
namespace skeletex {
#endif

/// Vertices that are eliminated together, and what comes of it: a dense matrix whose columns are first the pivots, then
/// the boundary, both padded.
typedef struct FrontRecord {
  SKELETEX_INT chart;
  SKELETEX_INT axes;   ///< 1: of the system of u; 2: of v; 3: of both, which are the same here
  SKELETEX_INT first;  ///< the pivots are rows first to first + pivots - 1 of the system
  SKELETEX_INT pivots;
  SKELETEX_INT
      boundary;         ///< vertices that come later and are neighbours; the last column stands for all fixed vertices
  SKELETEX_INT list;    ///< first entry of the boundary in `boundary_rows` and `parent_columns`
  SKELETEX_INT shared;  ///< so many of these, the first, are pivots of the parent
  SKELETEX_INT
      child_begin;  ///< fronts whose boundaries lie in this front: children[child_begin] to children[child_end - 1]
  SKELETEX_INT child_end;
  SKELETEX_INT rows;     ///< the pivots' rows in `matrices`, in tiles' rows (VSM_TILE floats)
  SKELETEX_INT rest;     ///< the boundary's rows there
  SKELETEX_INT vectors;  ///< four rows of `vectors`, in the same unit
} FrontRecord;

/// A chart, and what of each list is its own.
typedef struct ChartRecord {
  SKELETEX_INT chart;
  SKELETEX_INT slice_begin;
  SKELETEX_INT slice_end;
  SKELETEX_INT front_begin;
  SKELETEX_INT front_end;
  SKELETEX_INT triangle_begin;
  SKELETEX_INT triangle_end;
} ChartRecord;

#ifndef __OPENCL_C_VERSION__
static_assert(sizeof(ChartRecord) == 4 * 7);
static_assert(sizeof(FrontRecord) == 4 * 12);
}  // namespace skeletex
#endif
#undef SKELETEX_INT
#endif
