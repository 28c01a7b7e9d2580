// SPDX-License-Identifier: MIT
#pragma once
#include <array>
#include <span>
#include <vector>

#include "skeletex/convert/parameterize/chart.h"
#include "skeletex/convert/snap/lattice_surface.h"
#include "skeletex/geometry/triangle_tree.h"

namespace skeletex {

/// The mesh that a lattice is compared with, and the maps that its texels read.
struct OriginalSurface {
  struct Vertex {
    int number;  ///< among the vertices of all VSM patches' maps, see DeviceMaps
    int quad;    ///< of the lattice, at its place in the map
    Vec3 position;
  };
  const TriangleMesh& mesh;
  const TriangleTree& tree;
  std::vector<std::array<Vec3, 3>> map_triangles;  ///< corners, of all VSM patches' maps, see DeviceMaps
  std::vector<Vec3> map_normals;                   ///< unit; 0 of triangles without area
  std::vector<Vertex> vertices;                    ///< inner ones of the maps
  std::vector<std::vector<int>> quads;             ///< per chart those of its inner vertices; none for height fields
};
OriginalSurface prepare_original(const TriangleMesh& mesh, const TriangleTree& tree, std::span<const Chart> charts,
                                 const LatticeFrame& frame);

/// The mesh of a lattice, and where each of its texels reads.
struct LatticeSurface {
  const LatticeFrame& frame;
  const TriangleMesh& mesh;
  std::span<const int> map_triangles;  ///< per texel: of OriginalSurface, or beyond all of them

  /// Per corner of a triangle the triangle of the maps that it reads; -1 where it is no texel of a VSM patch.
  std::array<int, 3> read_by(TriangleIndex triangle, const OriginalSurface& original) const;
};

struct MeasuredTriangle {
  TriangleIndex triangle;
  double distance;   ///< to the original, of the furthest of its sampled points
  bool is_inverted;  ///< against the original's triangle nearest to its middle
};

/// Of the triangles of the regular grid between inner rows.
struct RegularGridFaults {
  double furthest = 0;        ///< distance to the original
  std::vector<int> inverted;  ///< triangles
};
RegularGridFaults measure_regular_grid(const LatticeSurface& surface, const OriginalSurface& original);

/// Of some triangles those that are further from the original than `share` of the limit, or inverted.
/// \param triangles  in any order; the result is in the same
std::vector<MeasuredTriangle> measure_triangles(const LatticeSurface& surface, const OriginalSurface& original,
                                                std::span<const int> triangles, double limit, double share);

/// The lattice's triangles that are nearest to vertices of the original which are further from it than the limit.
/// \param tree     of the lattice's mesh
/// \param is_held  per vertex of the maps whether a texel sits on it: then it is not measured
std::vector<int> nearest_to_far_vertices(const LatticeSurface& surface, const OriginalSurface& original,
                                         const TriangleTree& tree, std::span<const char> is_held, double limit);

}  // namespace skeletex
