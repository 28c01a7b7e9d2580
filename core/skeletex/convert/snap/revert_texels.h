// SPDX-License-Identifier: MIT
#pragma once
#include <span>
#include <vector>

#include "skeletex/convert/snap/lattice_surface.h"

namespace skeletex {

/// The texels of a layout on the host.
struct PlacedTexels {
  TexelPlanes points;
  std::vector<float> offset_x, offset_y;  ///< where they read, see ReadingPositions
  std::vector<int> anchors;               ///< likewise
  std::vector<int> map_triangles;         ///< near them, numbered as in DeviceMaps; beyond all of them: none
  DevicePlanes on_device{};               ///< the same points

  bool has_same_point(TexelIndex texel, const PlacedTexels& other) const {
    return points[0][texel] == other.points[0][texel] && points[1][texel] == other.points[1][texel] &&
           points[2][texel] == other.points[2][texel];
  }
};

/// Inner texels revert to the regular grid, those on vertices only `with_vertices`; and with them the texels of quads
/// at them that then fold in the map, or in space where the regular grid does not.
/// \param listed   each once
/// \param regular  the regular grid
/// \return those that have reverted
std::vector<int> revert_texels(const LatticeFrame& frame, std::span<const int> listed, bool with_vertices,
                               const PlacedTexels& regular, PlacedTexels& texels);

}  // namespace skeletex
