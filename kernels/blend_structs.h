// SPDX-License-Identifier: MIT
// Structs that the host and blend.cl share.
#ifndef SKELETEX_BLEND_STRUCTS_H
#define SKELETEX_BLEND_STRUCTS_H

#ifdef __OPENCL_VERSION__
#define SKELETEX_INT int
#else
#include <cstdint>
#define SKELETEX_INT std::int32_t
namespace skeletex {
#endif

/// Where one patch of the result reads in one source.
typedef struct BlendSource {
  SKELETEX_INT begin;         ///< of the source patch's row 0, column 0 in the planes
  SKELETEX_INT stride;        ///< from row to row
  SKELETEX_INT width;         ///< columns of the source patch
  SKELETEX_INT height;        ///< rows
  SKELETEX_INT column_begin;  ///< first entry in the table of columns
  SKELETEX_INT slope_begin;   ///< first entry in the table of the source's slopes; -1: texels are not turned
  float sign;                 ///< of the parts along and around: -1 where the source's bone is reversed
} BlendSource;

/// Where one column of the result reads in one source, at the bone's head and tail, and how far the separation planes'
/// slopes of the result lie above the source's there. `even` is the same smoothed around the bone: what counts away
/// from that end.
typedef struct BlendColumn {
  float head, even_head, tail, even_tail;  ///< columns of the source, any lift; the patch is periodic
  float head_rise, even_head_rise, tail_rise, even_tail_rise;
} BlendColumn;

/// Where one row of the result reads in one source.
typedef struct BlendRow {
  float row;     ///< of the source patch
  float weight;  ///< of what is read there
} BlendRow;

#ifndef __OPENCL_VERSION__
static_assert(sizeof(BlendSource) == 28);
static_assert(sizeof(BlendColumn) == 32);
static_assert(sizeof(BlendRow) == 8);
}  // namespace skeletex
#endif
#undef SKELETEX_INT
#endif
