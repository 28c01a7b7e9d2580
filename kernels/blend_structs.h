// SPDX-License-Identifier: MIT
// Structs that the host and blend.cl share.
#ifndef SKELETEX_BLEND_STRUCTS_H
#define SKELETEX_BLEND_STRUCTS_H

#ifndef __OPENCL_C_VERSION__
namespace skeletex {
#endif

/// One row of the result.
typedef struct BlendRow {
  int patch;
  int texel;         ///< of its column 0 in the result's texture
  int width;         ///< columns
  int column_begin;  ///< first entry of its patch in tables over the result's columns
  float u;           ///< map coordinate, 0 to 1
  float axial;       ///< axial parameter of the foot, 0 to 1
} BlendRow;

/// Where one patch of the result reads in one source.
typedef struct BlendSource {
  int begin;         ///< of the source patch's row 0, column 0 in the planes
  int stride;        ///< from row to row
  int width;         ///< columns of the source patch
  int height;        ///< rows
  int column_begin;  ///< first entry in the table of columns
  int slope_begin;   ///< first entry in the table of the source's slopes; -1: texels are not turned
  float sign;        ///< of the components along and around: -1 where the source's bone is reversed
} BlendSource;

/// Where one row of the result reads in one source.
typedef struct BlendSourceRow {
  float row;     ///< of the source patch
  float weight;  ///< of what is read there
} BlendSourceRow;

/// Where one column of the result reads in one source, at the bone's head and tail, and how far the slopes of the
/// result's separation planes lie above the source's there. The values named `even` are smoothed around the bone; they
/// are used away from that end.
typedef struct BlendColumn {
  float head, even_head, tail, even_tail;  ///< columns of the source, plus any number of whole turns
  float head_rise, even_head_rise, tail_rise, even_tail_rise;
} BlendColumn;

/// What blend_texels takes.
typedef struct BlendParameters {
  int row_count;
  int source_count;
  int patch_count;
  int texel_count;    ///< values per plane of texels
  int blended_count;  ///< the same of the result
} BlendParameters;

/// What move_ends takes.
typedef struct MoveEndsParameters {
  int row_count;
  int column_count;  ///< of all patches
  int texel_count;   ///< values per plane of texels
} MoveEndsParameters;

/// What mix_texels takes.
typedef struct MixParameters {
  int height;
  int width;
  float share;  ///< of the second texture
} MixParameters;

#ifndef __OPENCL_C_VERSION__
static_assert(sizeof(BlendRow) == 24);
static_assert(sizeof(BlendSource) == 28);
static_assert(sizeof(BlendSourceRow) == 8);
static_assert(sizeof(BlendColumn) == 32);
static_assert(sizeof(BlendParameters) == 20);
static_assert(sizeof(MoveEndsParameters) == 12);
static_assert(sizeof(MixParameters) == 12);
}  // namespace skeletex
#endif
#endif
