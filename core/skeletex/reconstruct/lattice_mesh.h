// SPDX-License-Identifier: MIT
#pragma once
#include <array>
#include <span>
#include <vector>

#include "skeletex/reconstruct/reconstruct_mesh.h"

namespace skeletex {

/// The mesh that a model would reconstruct to whose texels decode to given points; its own texture is not looked at. Points
/// can move, and what stands on them follows.
class LatticeMesh {
 public:
  using Planes = std::array<std::vector<float>, 3>;
  /// \param rule    of its diagonals, in place of the model's
  /// \param planes  x, y, z per texel of the texture, relative to the model's origin; of rows 0 and height-1 only poles count
  LatticeMesh(ClContext& context, const SkeletexModel& model, DiagonalRule rule, const Planes& planes);

  const TriangleMesh& mesh() const { return mesh_; }
  const Lattice& lattice() const { return lattice_; }
  /// Per inner vertex its texel.
  const std::vector<int>& texels() const { return texels_; }
  /// Inner vertices and the triangles between inner rows, on the device.
  const DevicePlanes& device_points() const { return device_points_; }
  const ClBuffer<Triangle>& device_triangles() const { return device_triangles_; }

  /// Moves inner vertices to their texels' points in other planes. Quads around them take their diagonals anew, strips beside
  /// them are filled anew. \return the triangles that are not what they were, in order
  std::vector<int> move(std::span<const int> vertices, const Planes& planes);

 private:
  int patch_of(int vertex) const;
  void retriangulate(std::span<const int> quads);

  ClContext& context_;
  const SkeletexModel& model_;
  DiagonalRule rule_;
  Walls walls_;
  Lattice lattice_;
  std::vector<int> texels_, first_row_;                // first_row_: per patch, the first of the device's rows
  std::vector<std::array<std::size_t, 2>> first_end_;  // per patch and end, the first triangle
  Planes points_;
  TriangleMesh mesh_;
  DeviceQuads quads_;
  DevicePlanes device_points_;
  ClBuffer<Triangle> device_triangles_;
};

}  // namespace skeletex
