// SPDX-License-Identifier: MIT
#pragma once
#include "skeletex/encode/snap.h"
#include "skeletex/model/mesh.h"
#include "skeletex/model/texture.h"

namespace skeletex {

/// What the guard of the finished lattice compares.
struct GuardSources {
  const SkeletexModel& model;     ///< all but its texels: layout, seams, rule of diagonals
  const TriangleMesh& mesh;       ///< the original
  std::span<const Chart> charts;  ///< its maps
};

struct GuardReport {
  int texels_put_back = 0;
  int turned_triangles = 0, even_turned_triangles = 0;  ///< that look against the mesh: of the VSM patches' lattice, and of the even one
  std::vector<int> anchors;  ///< per texel what holds it now, see ReadingPositions
};

/// Looks at the very mesh that the decoder will make, strips at seams included. Texels go back to the even lattice
///  - where its triangles intersect, or look against the original,
///  - where it is further from the original, or the original's vertices from it, than (nearly) the even lattice anywhere,
/// and with them what then folds. Repeated until nothing is left, so that neither the maximum nor those numbers rise above the even
/// lattice's. Where the even lattice has the same faults, and not clearly fewer, they are left.
/// \param even_triangles, triangles  per texel a triangle of the map near it, of the even lattice and of the points
/// \param even      the even lattice's points
/// \param filtered  these as they would be stored: what texels go back to
GuardReport put_back_faults(ClContext& context, const GuardSources& sources, const DeviceLayout& layout, const DeviceMaps& maps,
                            const SnapFeatures& features, const ClBuffer<int>& even_triangles, const ClBuffer<int>& triangles,
                            const TexelPoints& even, const TexelPoints& filtered, ReadingPositions& positions, TexelPoints& points);

}  // namespace skeletex
