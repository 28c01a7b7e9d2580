// SPDX-License-Identifier: MIT
#pragma once
#include <array>
#include <span>
#include <vector>

#include "skeletex/convert/sample/device_maps.h"
#include "skeletex/reconstruct/reconstruct_mesh.h"

namespace skeletex {

/// Points of a texture's texels, from the model's origin: x, y and z per texel.
using TexelPlanes = std::array<std::vector<float>, 3>;

/// Which diagonals the decoder takes: per texel whether the quad to the right of and above it takes the second one.
/// \param records  see frame_tables
/// \param rows     that the quads begin at, see quad_rows; all other values are 0
/// \param points   x, y, z per texel; those of rows 0 and height-1 do not count
ClBuffer<int> choose_diagonals(ClContext& context, DiagonalRule rule, const std::vector<LatticeRow>& rows,
                               const ClBuffer<PatchRecord>& records, int texture_width, const DevicePlanes& points);

/// What the meshes of all points of one layout have in common: numbers of vertices and triangles (lattice.h), seams.
struct LatticeFrame {
  const SkeletexModel& model;  ///< all but its texels
  Lattice numbers;
  ClBuffer<PatchRecord> patches;
  std::vector<LatticeRow> rows;      ///< that quads begin at
  std::vector<EndSeam> ends;         ///< per patch, head and tail
  std::vector<Vec3> positions;       ///< seam samples and corners; the rest is open
  std::vector<int> texels;           ///< per vertex; of seam samples and corners -1
  std::vector<int> texel_patches;    ///< per texel; -1 between rectangles
  std::vector<int> triangle_order;   ///< all triangles, those next to each other in the texture near each other
  std::vector<int> triangle_places;  ///< per triangle, in that order
  bool is_inner(VertexIndex vertex) const { return vertex < numbers.inner_count; }
};
LatticeFrame frame_lattice(ClContext& context, const SkeletexModel& model);

/// The mesh that the model would reconstruct to, were its texels at given points: what reconstruct_mesh makes.
/// \param rule    of its diagonals, in place of the model's
/// \param points  per texel; of rows 0 and height-1 only poles count
/// \param mesh    out; empty before, or one of the same frame, whose memory is used again
void build_lattice_mesh(ClContext& context, const LatticeFrame& frame, DiagonalRule rule, const DevicePlanes& points,
                        TriangleMesh& mesh);
/// After inner texels have moved: diagonals and strips next to them are chosen again.
/// \param points     where they are now
/// \param on_device  takes over the points of those that have moved
/// \return the triangles that are not what they were, or not where, in order
std::vector<int> move_texels(ClContext& context, const LatticeFrame& frame, DiagonalRule rule,
                             std::span<const int> texels, const TexelPlanes& points, DevicePlanes& on_device,
                             TriangleMesh& mesh);

}  // namespace skeletex
