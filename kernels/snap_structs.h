// SPDX-License-Identifier: MIT
// Structs that the host and snap.cl share.
#ifndef SKELETEX_SNAP_STRUCTS_H
#define SKELETEX_SNAP_STRUCTS_H

#ifndef __OPENCL_C_VERSION__
namespace skeletex {
#endif

#define SNAP_BIN_WIDTH 8  // columns: a float8 of them

/// A vertex of the mesh, where it lies in the cells of its patch.
typedef struct SnapVertex {
  float x, y;  ///< x unwrapped
  int patch;
  int rank;  ///< by strength, from 1
} SnapVertex;

/// An edge at one turn of v.
typedef struct SnapEdge {
  float x, y;            ///< its first point
  float ex, ey;          ///< from there to its last one
  float over_x, over_y;  ///< that / -length squared
  float flatness;        ///< 1 / the square of its weight
  int number;
} SnapEdge;

/// What the kernels take.
typedef struct SnapParameters {
  int texture_width;
  int texel_count;  ///< of the texture
  int count;        ///< vertices, or rows of the table
  int least;        ///< more than all reservations of rounds before; of decide_the_rest: of the first round
  int step;         ///< decide_the_rest alone: from one round's to the next
  int bin_count;    ///< place_on_edges alone, as the next
  int is_again;     ///< texels look for edges again only in bins where one could not go to an edge that is sharp enough
} SnapParameters;

#ifndef __OPENCL_C_VERSION__
static_assert(sizeof(SnapVertex) == 16);
static_assert(sizeof(SnapEdge) == 32);
static_assert(sizeof(SnapParameters) == 28);
}  // namespace skeletex
#endif
#endif
