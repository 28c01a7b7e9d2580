// SPDX-License-Identifier: MIT
// Structs that the host shares with encode.cl, unfold.cl, half.cl and lattice.cl.
#ifndef SKELETEX_TEXEL_STRUCTS_H
#define SKELETEX_TEXEL_STRUCTS_H

/// Planes of the buffer of a map's triangles, `triangle_count` ints each.
#define MAP_CORNERS 0  // three planes; a triangle's pole, where it has one, is its corner 2
#define MAP_TURNS 3    // three planes: turns of v that the corners are from theirs
#define MAP_ACROSS 6   // three planes: the triangles behind the edges opposite to the corners; -1 at the map's border
#define MAP_POLES 9
#define MAP_PATCHES 10
#define MAP_TRIANGLE_PLANES 11

#define NO_TRIANGLE 0x7fffffff  // of a map that a texel is in
#define BAND_COLUMNS 64         // of a band of rows that a group of choose_diagonals takes

/// What find_folds and relax_folds count.
#define FOLD_QUADS 0     // quads that are listed
#define FOLD_FOUND 1     // folded quads
#define FOLD_MARKED 2    // texels that are marked
#define FOLD_RETURNED 3  // texels that were away from their places and returned
#define FOLD_COUNTS 4

#ifndef __OPENCL_C_VERSION__
namespace skeletex {
#endif

/// How long the planes of the maps are.
typedef struct MapSizes {
  int triangle_count;
  int vertex_count;
  int row_count;
} MapSizes;

/// What the kernels that read maps take: encode.cl and unfold.cl.
typedef struct MapParameters {
  MapSizes maps;
  int texture_width;
  int texel_count;   ///< of the texture
  int count;         ///< rows of the table, or texels of a list
  int first;         ///< read_listed alone: where the list begins in its buffer
  int vertex_count;  ///< place_anchored alone: vertices that texels can sit on
  int is_back;       ///< relax_folds alone: texels return to their places
} MapParameters;

/// What the kernels on points of texels take: encode.cl and half.cl.
typedef struct TexelParameters {
  int texture_width;
  int texel_count;   ///< of the texture
  int count;         ///< rows of the table, or texels of a list
  int column_count;  ///< values per plane of the column table
  int kept;          ///< prefilter_positions alone: the bits that keep a texel
} TexelParameters;

/// What choose_diagonals takes.
typedef struct DiagonalParameters {
  int texture_width;
  int texel_count;
  int row_count;
  int band;       ///< rows that a group takes
  int is_smooth;  ///< DiagonalRule::kSmooth
} DiagonalParameters;

#ifndef __OPENCL_C_VERSION__
static_assert(sizeof(MapParameters) == 36);
static_assert(sizeof(TexelParameters) == 20);
static_assert(sizeof(DiagonalParameters) == 20);
}  // namespace skeletex
#endif
#endif
