// SPDX-License-Identifier: MIT
// Structs and planes that the host shares with fit.cl. Planes have the texture's size and lie behind each other.
#ifndef SKELETEX_FIT_STRUCTS_H
#define SKELETEX_FIT_STRUCTS_H

#include "texel_structs.h"

#define FIT_SAMPLES 4  ///< points of the mesh per quad

/// Planes of the buffer `numbers`, ints.
#define FIT_COVERING 0   ///< the triangle of the map that covers a texel's place
#define FIT_TRIANGLES 1  ///< FIT_SAMPLES planes: the triangles that the samples of a texel's quad lie in
#define FIT_DIAGONALS (FIT_TRIANGLES + FIT_SAMPLES)
#define FIT_MATCHES (FIT_DIAGONALS + 1)  ///< FIT_SAMPLES planes, see match_samples
#define FIT_NUMBER_PLANES (FIT_MATCHES + FIT_SAMPLES)

/// Planes per sample: x, y, z, normal x, y, z, share of the area; the normal is 0 where there is nothing to fit.
#define SAMPLE_PLANES 7
/// Planes of the buffer `matched`: per sample the weights of its triangle's corners 1 and 2, and the residual; then the
/// costs and areas of quads.
#define MATCH_PLANES 3
#define FIT_COSTS (MATCH_PLANES * FIT_SAMPLES)
#define FIT_AREAS (FIT_COSTS + 1)
#define FIT_MATCHED_PLANES (FIT_AREAS + 1)
/// Planes per triangle of the lattice, of its middle: weight (area), residual, normal x, y, z.
#define LATTICE_PLANES 5
/// Floats of a texel's row: 6 own block (xx, xy, xz, yy, yz, zz), 3 right-hand side, 4 x 6 blocks with the texels
/// ahead.
#define SYSTEM_STRIDE 36

#ifndef __OPENCL_C_VERSION__
namespace skeletex {
#endif

/// What the kernels take.
typedef struct FitParameters {
  MapSizes maps;
  int texture_width;
  int texture_height;
  float least_residual;  ///< assemble alone: added to |residual| in the weights
  int colour;            ///< relax_moves alone, as the rest
  float damping;         ///< share of a texel's mean diagonal entry
  float springs;         ///< the same share
  float share;           ///< move_points alone: of the moves that is made
} FitParameters;

#ifndef __OPENCL_C_VERSION__
static_assert(sizeof(FitParameters) == 40);
}  // namespace skeletex
#endif
#endif
