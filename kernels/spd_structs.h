// SPDX-License-Identifier: MIT
// Structs that the host and spd.cl share.
#ifndef SKELETEX_SPD_STRUCTS_H
#define SKELETEX_SPD_STRUCTS_H

#ifndef __OPENCL_C_VERSION__
namespace skeletex {
#endif

/// One patch whose rays are cast. Rows are looked up by marks, which grow along a column as the rows' rays do: the
/// axial parameter in [0, 1] along the bone, 1 + sin / (sin + cos) of the latitude in the tail's cap, -sin / (sin +
/// cos) in the head's.
typedef struct SpdPatch {
  float bone_length;     ///< L
  float tolerance;       ///< rounding of a point's distance to a ray, world units
  float head_tolerance;  ///< how far a point may miss the first row's ray and still count as on it; 0 at a pole
  float tail_tolerance;  ///< the same for the last row
  int width;             ///< columns
  int height;            ///< rows
  int row_begin;         ///< first entry in the row table (RowRecord)
  int column_begin;      ///< first entry in the column table (ColumnRecord) and in the columns' lists of triangles
  int texel_begin;       ///< first entry in the results
  int is_head_free, is_tail_free;
  int guess_begin;  ///< first entry in the table of guesses: entry i is the first row with a mark >= i /
                    ///< guesses_per_mark - 1
  int guess_count;
  float guesses_per_mark;
} SpdPatch;

typedef struct CastParameters {
  int column_count;  ///< of all patches
  int tile_rows;     ///< rows that a work-item takes
  int wants_last;    ///< the last hit of a ray counts, not the first
  int guesses;       ///< in `tables`, see SpdPatch; the columns' patches are at 0
  int list_begins;   ///< in `tables`, per column and one more: its list of triangles
} CastParameters;

#ifndef __OPENCL_C_VERSION__
static_assert(sizeof(CastParameters) == 20);
static_assert(sizeof(SpdPatch) == 56);
}  // namespace skeletex
#endif
#endif
