// SPDX-License-Identifier: MIT
// Parameters of the kernels that turn texels into points and back: reconstruct.cl, pose.cl, coordinates.cl and skin.cl.
// Read by C++20 and by OpenCL C 1.2; all members are 4 bytes wide, no padding.
#ifndef SKELETEX_RECONSTRUCT_STRUCTS_H
#define SKELETEX_RECONSTRUCT_STRUCTS_H

#ifdef __OPENCL_C_VERSION__
#define SKELETEX_INT int
#else
#include <cstdint>
#define SKELETEX_INT std::int32_t
namespace skeletex {
#endif

/// Between texels and points: displace, enter_tangent_space and the kernels of pose.cl.
typedef struct DisplaceParameters {
  SKELETEX_INT row_count;         ///< rows of the table
  SKELETEX_INT texture_width;     ///< texels
  SKELETEX_INT column_count;      ///< values per plane of the column tables
  SKELETEX_INT texel_count;       ///< values per plane of texels
  SKELETEX_INT point_count;       ///< values per plane of points
  SKELETEX_INT is_distance_kept;  ///< displace_posed_from_bind alone: 0: the distance from the foot is kept instead
} DisplaceParameters;

/// The triangles of quads.
typedef struct TriangulateParameters {
  SKELETEX_INT row_count;
  SKELETEX_INT point_count;  ///< values per plane of points
  SKELETEX_INT is_smooth;    ///< DiagonalRule::kSmooth
} TriangulateParameters;

/// One axis of a resampling, and what limits its fit.
typedef struct ResampleParameters {
  SKELETEX_INT row_count;
  SKELETEX_INT in_count;   ///< values per plane of the points that are read
  SKELETEX_INT out_count;  ///< values per plane of the points that are written
  float share;             ///< limit_fit alone: of an edge
} ResampleParameters;

/// Blocks of vertices (SkinBlock): skin.cl and coordinates.cl.
typedef struct BlockParameters {
  SKELETEX_INT block_count;
  SKELETEX_INT first_block;       ///< bone_weights alone: the number of the block that the first group works on
  SKELETEX_INT slots;             ///< bone_weights alone: weights per vertex
  SKELETEX_INT point_count;       ///< values per plane of points and of coordinates
  SKELETEX_INT is_stretched;      ///< skin alone: 0: no bone changes its length
  SKELETEX_INT is_distance_kept;  ///< pose_by_coordinates alone, as above
} BlockParameters;

#ifndef __OPENCL_C_VERSION__
}  // namespace skeletex
#endif
#undef SKELETEX_INT
#endif
