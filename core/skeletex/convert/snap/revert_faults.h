// SPDX-License-Identifier: MIT
#pragma once
#include <span>

#include "skeletex/convert/measure/bone_distances.h"
#include "skeletex/convert/parameterize/chart.h"
#include "skeletex/convert/snap/revert_texels.h"
#include "skeletex/geometry/triangle_tree.h"

namespace skeletex {

/// What the finished lattice is compared with.
struct RevertSources {
  const SkeletexModel& model;     ///< all but its texels: layout, seams, rule of diagonals
  const TriangleMesh& mesh;       ///< the original
  const TriangleTree& tree;       ///< of the original
  std::span<const Chart> charts;  ///< its maps
};

struct RevertReport {
  int reverted_texels = 0;
  /// Triangles that look against the original: of the lattice, and of the regular grid but for its strips and fans.
  int inverted_triangles = 0, regular_inverted_triangles = 0;
  int triangles = 0;                    ///< all of the lattice
  std::vector<BoneDistance> distances;  ///< of what is left, see distances_from_bones; per chart
};

/// Looks at the mesh that the decoder will make of the texels. Texels revert to the regular grid
///  - where triangles intersect, or look against the original,
///  - where triangles are further from the original, or the original's vertices from them, than nearly the furthest of
///    the regular grid's triangles,
/// and with them what then folds. Repeated until nothing is left. Where the regular grid has the same faults, and not
/// clearly fewer, they are left.
/// \param vertex_points  per vertex that texels can sit on (ReadingPositions::anchors) its number among the maps'
///                       vertices, see DeviceMaps
/// \param regular        the regular grid, as it would be stored
/// \param texels         in and out
RevertReport revert_faults(ClContext& context, const RevertSources& sources, std::span<const int> vertex_points,
                           const PlacedTexels& regular, PlacedTexels& texels);

}  // namespace skeletex
