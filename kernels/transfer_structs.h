// SPDX-License-Identifier: MIT
// Structs that the host and transfer.cl share.
#ifndef SKELETEX_TRANSFER_STRUCTS_H
#define SKELETEX_TRANSFER_STRUCTS_H

/// A correction is a sum of bands of waves around the bone, the longest first, each with a fade of its own.
#define SKELETEX_TRANSFER_BANDS 6

#ifdef __OPENCL_VERSION__
#define SKELETEX_INT int
#else
#include <cstdint>
#define SKELETEX_INT std::int32_t
namespace skeletex {
#endif

/// Which patch of the source one of the result's takes, and how.
typedef struct LaidPatch {
  SKELETEX_INT begin;         ///< of the source patch's row 0, column 0 in the planes of points
  SKELETEX_INT width;         ///< columns of the source patch
  SKELETEX_INT height;        ///< its rows
  SKELETEX_INT column_begin;  ///< first entry of the result's patch in the tables of columns and corrections
  float sign;                 ///< -1 where the source's bone is reversed, else 1
  float source_length;        ///< of its bone
  float length_scale;         ///< of places along the bone
  float length_offset;        ///< where the source's bone begins on the result's
  float lean_s;               ///< what the part leans: moved across the bone per length from lean_end back along it
  float lean_b;
  float lean_end;    ///< place along the bone that stays
  float head_width;  ///< rows over which the longest waves of the correction at the head fade; 0: none
  float tail_width;
  SKELETEX_INT is_linear;     ///< it fades linearly, else by a cosine
  SKELETEX_INT target_begin;  ///< of the target's patch in the planes of its points, to be mixed with them by that fade
                              ///< instead; -1: not
} LaidPatch;

/// One row of the result.
typedef struct LaidRow {
  float axial;  ///< of the foot: shares the columns of head and tail
  float scale;  ///< of places across the bone
} LaidRow;

/// One column of the result.
typedef struct LaidColumn {
  float head_column;  ///< of the source at the bone's head, any lift
  float tail_column;
  float head_shear;  ///< length along the bone per distance from it
  float tail_shear;
  float row_begin;  ///< of the source, in the direction of the result's bone, at row 0
  float row_step;   ///< source rows per row
  float first_row;  ///< the target's surface up to this row,
  float last_row;   ///< and from this one on; in between the source's
} LaidColumn;

#ifndef __OPENCL_VERSION__
static_assert(sizeof(LaidPatch) == 60);
static_assert(sizeof(LaidRow) == 8);
static_assert(sizeof(LaidColumn) == 32);
}  // namespace skeletex
#endif
#undef SKELETEX_INT
#endif
