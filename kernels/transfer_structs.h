// SPDX-License-Identifier: MIT
// Structs that the host and transfer.cl share.
#ifndef SKELETEX_TRANSFER_STRUCTS_H
#define SKELETEX_TRANSFER_STRUCTS_H

/// A correction is a sum of bands of waves around the bone, the longest first. Each band fades over its own width.
#define SKELETEX_TRANSFER_BANDS 6

#ifndef __OPENCL_C_VERSION__
namespace skeletex {
#endif

/// How one patch of the result takes a patch of the source.
typedef struct TransferPatch {
  int begin;            ///< of the source patch's row 0, column 0 in the planes of points
  int width;            ///< columns of the source patch
  int height;           ///< its rows
  int column_begin;     ///< first entry of the result's patch in the tables of columns and corrections
  float sign;           ///< -1 where the source's bone is reversed, else 1
  float source_length;  ///< of its bone
  float length_scale;   ///< of places along the bone
  float length_offset;  ///< where the source's bone begins on the result's
  float lean_s;         ///< shear of the part: its move across the bone per length from lean_end back
  float lean_b;
  float lean_end;    ///< place along the bone that stays
  float head_width;  ///< rows over which the longest waves of the correction at the head fade; 0: none
  float tail_width;
  int is_linear;     ///< corrections fade linearly, else by a cosine
  int target_begin;  ///< of the target's patch in the planes of its points, which are mixed in by that fade
                     ///< instead of corrections; -1: not
} TransferPatch;

/// One row of the result.
typedef struct TransferRow {
  int patch;
  int row;      ///< of the patch
  int width;    ///< columns
  int vertex;   ///< of its column 0 in the planes of the result's points
  int texel;    ///< of its column 0 in the result's texture
  float axial;  ///< axial parameter of the foot, which interpolates the columns of head and tail
  float scale;  ///< of places across the bone
} TransferRow;

/// One column of the result.
typedef struct TransferColumn {
  float head_column;  ///< of the source at the bone's head, plus any number of whole turns
  float tail_column;
  float head_shear;  ///< length along the bone per distance from it
  float tail_shear;
  float row_begin;  ///< of the source, in the direction of the result's bone, at row 0
  float row_step;   ///< source rows per row
  float first_row;  ///< the target's surface up to this row,
  float last_row;   ///< and from this one on; in between the source's
} TransferColumn;

/// What the kernels take. Each reads those that it needs.
typedef struct TransferParameters {
  int row_count;
  int column_count;  ///< of the result's patches
  int source_count;  ///< values per plane of the source
  int target_count;  ///< values per plane of the target; of the result's texels, too
  int point_count;   ///< values per plane of the result's points
} TransferParameters;

#ifndef __OPENCL_C_VERSION__
static_assert(sizeof(TransferPatch) == 60);
static_assert(sizeof(TransferRow) == 28);
static_assert(sizeof(TransferColumn) == 32);
static_assert(sizeof(TransferParameters) == 20);
}  // namespace skeletex
#endif
#endif
