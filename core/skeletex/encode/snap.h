// SPDX-License-Identifier: MIT
#pragma once
#include <span>
#include <vector>

#include "skeletex/encode/device_maps.h"
#include "skeletex/reconstruct/displace.h"

namespace skeletex {

/// Points and edges of the maps that texels should sit on, in the cells of their patch: x = v width, unwrapped;
/// y the row, with fractions, by the patch's row table.
struct SnapFeatures {
  struct Vertex {
    int patch = -1;
    int point = -1;  ///< its number among the vertices of DeviceMaps
    double x = 0, y = 0;
    double strength = 0;  ///< sum over its edges of dihedral angle (radians) x length
  };
  struct Edge {
    int patch = -1;
    std::array<int, 2> points{-1, -1};
    std::array<double, 2> x{0, 0}, y{0, 0};
    double dihedral = 0;  ///< radians
  };
  std::vector<Vertex> vertices;  ///< inner ones that are not flat
  std::vector<Edge> edges;       ///< inner ones whose dihedral angle is above the least, patch after patch
};

/// The row, with fractions, that reads at u.
double row_of(const std::vector<double>& row_u, double u);

/// The features of all VSM patches.
/// \param least_dihedral  radians; flatter edges are left out
SnapFeatures find_features(std::span<const Chart> charts, std::span<const Patch> patches, double least_dihedral);

/// Features as the kernels take them (snap.cl).
struct SnapTables {
  /// An edge at one turn of v, as EdgeRecord of snap.cl.
  struct Edge {
    float x, y, ex, ey, over_x, over_y, flatness;
    int number;
  };
  std::vector<int> vertex_patches, vertex_points, vertex_ranks;  ///< ranks by strength, from 1
  std::vector<float> vertex_x, vertex_y;                         ///< cells
  std::vector<std::array<int, 2>> edge_points;
  std::vector<Edge> edges;
  std::array<std::vector<LatticeRow>, 2> rows;         ///< of VSM patches, inner ones, even and odd: patch, row, first bin, 0
  std::vector<int> bin_begins, bin_edges;              ///< the edges near each bin of eight columns of a row
};
/// \param patches  with their rectangles in the texture, as for find_features
SnapTables tables_of(const SnapFeatures& features, std::span<const Patch> patches);

/// Where each texel reads, a thing of its own between the map and the texel: per texel an offset from its place in the
/// even lattice, in cells, at most 1 along each axis, and what holds it there.
struct ReadingPositions {
  ClBuffer<float> x, y;         ///< around, along
  ClBuffer<int> anchors;        ///< 0: nothing; 1 + i: vertex i of the features; -1 - i: edge i
  ClBuffer<float> parameters;   ///< place on the edge, 0 at its first point, 1 at its last
  ClBuffer<float> home_x, home_y;  ///< the offsets that texels go back to: 0, but where the even lattice is unfolded
};
/// The even lattice.
ReadingPositions even_positions(ClContext& context, const DeviceLayout& layout);

/// Moves reading positions to vertices, strongest first, and then to creased edges; the map does not fold.
void snap_positions(ClContext& context, const DeviceLayout& layout, const SnapTables& tables, ReadingPositions& positions);

/// Planes of points, one per texel.
using TexelPoints = DevicePlanes;

/// Lists of put_back_listed, for all its calls on one lattice: 30 at most.
struct TexelReturns {
  TexelReturns(ClContext& context, const DeviceLayout& layout);
  ClBuffer<int> marks, back, bad, counts;  ///< see put_listed_back in snap.cl
  int calls = 0;
};

/// Texels of inner rows go back to the even lattice, those on vertices only `with_vertices`; and with them the texels of quads at
/// them that then fold in the map, or in space where the even lattice does not.
/// \param even    the even lattice's points, the measure of folds
/// \param before  what texels go back to: these as they would be stored
/// \param texels  each once
/// \return the texels that went back, in any order. \throw DeviceError
std::vector<int> put_back_listed(ClContext& context, const DeviceLayout& layout, const TexelPoints& even, const TexelPoints& before,
                                 const std::vector<int>& texels, bool with_vertices, TexelReturns& returns, ReadingPositions& positions, TexelPoints& points);

}  // namespace skeletex
