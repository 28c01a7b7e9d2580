// SPDX-License-Identifier: MIT
#pragma once
#include <array>
#include <vector>

#include "skeletex/reconstruct/reconstruct_mesh.h"

namespace skeletex {

/// Points of a texture's texels, from the model's origin: x, y and z per texel.
using TexelPlanes = std::array<std::vector<float>, 3>;

/// What the meshes of all points of one layout have in common: numbers of vertices and triangles (lattice.h), seams.
struct LatticeFrame {
  const SkeletexModel& model;  ///< all but its texels
  Lattice numbers;
  DeviceQuads quads;
  std::vector<EndSeam> ends;        ///< per patch, head and tail
  std::vector<Vec3> positions;      ///< seam samples and corners; the rest is open
  std::vector<int> texels;          ///< per vertex; of seam samples and corners -1
  std::vector<int> texel_patches;   ///< per texel; -1 between rectangles
  std::vector<int> triangle_order;  ///< all triangles, those next to each other in the texture near each other
  bool is_inner(int vertex) const { return vertex < numbers.inner_count; }
};
LatticeFrame frame_lattice(ClContext& context, const SkeletexModel& model);

/// The mesh that the model would reconstruct to, were its texels at given points: what reconstruct_mesh makes.
/// \param rule    of its diagonals, in place of the model's
/// \param points  of rows 0 and height-1 only poles count
TriangleMesh build_lattice_mesh(ClContext& context, const LatticeFrame& frame, DiagonalRule rule,
                                const TexelPlanes& points);

}  // namespace skeletex
