// SPDX-License-Identifier: MIT
// Parameters of the kernels that turn texels into points and back: reconstruct.cl, pose.cl, coordinates.cl and skin.cl.
// Read by C++20 and by OpenCL C 1.2; all members are 4 bytes wide, no padding.
#ifndef SKELETEX_RECONSTRUCT_STRUCTS_H
#define SKELETEX_RECONSTRUCT_STRUCTS_H

#ifndef __OPENCL_C_VERSION__
namespace skeletex {
#endif

/// Between texels and points: displace, enter_tangent_space and the kernels of pose.cl.
typedef struct DisplaceParameters {
  int row_count;         ///< rows of the table
  int texture_width;     ///< texels
  int column_count;      ///< values per plane of the column tables
  int texel_count;       ///< values per plane of texels
  int point_count;       ///< values per plane of points
  int is_distance_kept;  ///< displace_posed_from_bind alone: 0: the distance from the foot is kept instead
} DisplaceParameters;

/// The triangles of quads.
typedef struct TriangulateParameters {
  int row_count;
  int point_count;  ///< values per plane of points
  int is_smooth;    ///< DiagonalRule::kSmooth
} TriangulateParameters;

/// One axis of a resampling, and what limits its fit.
typedef struct ResampleParameters {
  int row_count;
  int in_count;   ///< values per plane of the points that are read
  int out_count;  ///< values per plane of the points that are written
  float share;    ///< limit_fit alone: of an edge
} ResampleParameters;

/// Blocks of vertices (SkinBlock): skin.cl and coordinates.cl.
typedef struct BlockParameters {
  int block_count;
  int first_block;       ///< bone_weights alone: the number of the block that the first group works on
  int slots;             ///< bone_weights alone: weights per vertex
  int point_count;       ///< values per plane of points and of coordinates
  int is_stretched;      ///< skin alone: 0: no bone changes its length
  int is_distance_kept;  ///< pose_by_coordinates alone, as above
} BlockParameters;

#ifndef __OPENCL_C_VERSION__
}  // namespace skeletex
#endif
#endif
