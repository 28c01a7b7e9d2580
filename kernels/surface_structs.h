// SPDX-License-Identifier: MIT
// Structs that the host shares with filter.cl, diffusion.cl and orientation.cl. filter.cl explains rows, fans and
// fields.
#ifndef SKELETEX_SURFACE_STRUCTS_H
#define SKELETEX_SURFACE_STRUCTS_H

/// Vertices of the fans, and values of fields, that one work-group does.
#define FAN_CHUNK 64
#define VERTEX_CHUNK 4096

#ifndef __OPENCL_C_VERSION__
namespace skeletex {
#endif

/// An inner row of a patch.
typedef struct SurfaceRow {
  int first;       ///< its first vertex
  int width;       ///< columns
  int has_before;  ///< 1: the row before it is an inner row, too
  int has_after;
} SurfaceRow;

/// A vertex at an end of a patch. The table of these has one entry more than vertices.
typedef struct FanVertex {
  int vertex;
  int begin;  ///< its first triangle in the table of fans; its last one is before the next entry's
} FanVertex;

/// Some columns of a patch's inner rows.
typedef struct ColumnBlock {
  int first;    ///< their first vertex in the first inner row
  int columns;  ///< their number
  int stride;   ///< from row to row
  int rows;     ///< inner rows of the patch
} ColumnBlock;

/// What the kernels on a surface take. Each reads those that it needs.
typedef struct SurfaceParameters {
  int row_count;
  int block_count;
  int fan_count;
  int inner_count;    ///< vertices in rows, the first ones
  int count;          ///< all vertices
  int components;     ///< of the fields
  int coarse_count;   ///< vertices of the coarser lattice
  int first_seam;     ///< the first vertex on a seam
  int first_partial;  ///< where the kernel's partial sums begin
  float mass_share;   ///< the operator is mass_share M + time L
  float time;
} SurfaceParameters;

/// What the kernels of conjugate gradients take. Slots are entries of the table of sums.
typedef struct SolveParameters {
  int value_count;  ///< of the fields, all components; of partial sums
  int count;        ///< vertices
  int slot;         ///< of r z, or of the sum to write
  int other_slot;   ///< of p q, or of the new r z
} SolveParameters;

/// What noise_at_points takes.
typedef struct NoiseParameters {
  int count;
  int octaves;
  unsigned seed;
  float frequency;  ///< 1 / wavelength, in the points' unit
} NoiseParameters;

#ifndef __OPENCL_C_VERSION__
static_assert(sizeof(SurfaceRow) == 16);
static_assert(sizeof(FanVertex) == 8);
static_assert(sizeof(ColumnBlock) == 16);
static_assert(sizeof(SurfaceParameters) == 44);
static_assert(sizeof(SolveParameters) == 16);
static_assert(sizeof(NoiseParameters) == 16);
}  // namespace skeletex
#endif
#endif
