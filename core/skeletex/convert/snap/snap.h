// SPDX-License-Identifier: MIT
#pragma once
#include <span>
#include <vector>

#include "skeletex/convert/sample/device_maps.h"
#include "skeletex/reconstruct/displace.h"
#include "snap_structs.h"

namespace skeletex {

/// Vertices and edges of the maps that texels should sit on, whatever the layout.
struct MapFeatures {
  struct Vertex {
    VertexIndex vertex;   ///< of the chart
    double strength = 0;  ///< how much it counts; see what found it
    int rank = 0;         ///< by strength, from 1, among those of all patches
  };
  struct Edge {
    std::array<int, 2> vertices{-1, -1};  ///< of the chart
    std::array<int, 2> turns{0, 0};       ///< that its ends are from their v
    double dihedral = 0;                  ///< radians
  };
  std::vector<std::vector<Vertex>> vertices;  ///< per patch: inner ones that are not flat
  std::vector<std::vector<Edge>> edges;       ///< per patch: inner ones whose dihedral angle is above the least
};

/// The features of all VSM patches. The strength of a vertex is the sum over its edges of dihedral angle (radians) x
/// length.
///
/// \param methods         per chart
/// \param least_dihedral  radians; flatter edges are left out
MapFeatures find_features(std::span<const Chart> charts, std::span<const Method> methods, double least_dihedral);
/// Ranks all vertices by their strength; equal ones by patch and number.
void rank_vertices(MapFeatures& features);

/// Features where they lie in the cells of their patch: x = v width, unwrapped; y the row, with fractions, by the
/// patch's row table.
struct SnapFeatures {
  struct Vertex {
    PatchIndex patch;
    int point = -1;  ///< its number among the vertices of DeviceMaps
    double x = 0, y = 0;
    int rank = 0;  ///< the stronger, the higher
  };
  struct Edge {
    PatchIndex patch;
    std::array<int, 2> points{-1, -1};
    std::array<double, 2> x{0, 0}, y{0, 0};
    double dihedral = 0;  ///< radians
  };
  std::vector<Vertex> vertices;
  std::vector<Edge> edges;  ///< patch after patch; both there by rows and along them
};

/// Columns of a patch wrap round: the one of [0, width) that is the same.
inline int wrapped(int column, int width) {
  while (column < 0) column += width;
  while (column >= width) column -= width;
  return column;
}
/// The rows of a patch, with fractions, that read at some u.
/// \param row_u  per row, see Patch
/// \param u  of [0, 1]
/// \return per u
std::vector<double> rows_of(const std::vector<double>& row_u, std::span<const double> u);

/// Those near each other in the texture come one after the other.
/// \param charts   as for find_features
/// \param patches  per chart, with its size and row table
SnapFeatures place_features(const MapFeatures& features, std::span<const Chart> charts, std::span<const Patch> patches);

/// Features as the kernels take them (snap.cl).
struct SnapTables {
  std::vector<SnapVertex> vertices;
  std::vector<int> vertex_points;               ///< their numbers among the maps' vertices
  std::vector<std::array<int, 2>> edge_points;  ///< likewise
  std::vector<SnapEdge> edges;
  std::array<std::vector<LatticeRow>, 2> rows;  ///< of VSM patches, inner ones, even and odd: patch, row, first bin, 0
  std::vector<int> bin_begins, bin_edges;       ///< the edges near each bin of eight columns of two rows
};
/// \param patches  as for place_features
SnapTables tables_of(const SnapFeatures& features, std::span<const Patch> patches);

/// Where each texel reads, a thing of its own between the map and the texel: per texel an offset from its place in the
/// regular grid, in cells, at most 1 along each axis, and what holds it there.
struct ReadingPositions {
  ClBuffer<float> offsets;  ///< planes: around, along, and of texels on edges their places there, 0 at the first point
  ClBuffer<int> anchors;    ///< 0: nothing; 1 + i: vertex i of the features; -1 - i: edge i
  ClBuffer<float> home;     ///< the offsets that texels go back to, planes: 0, but where the regular grid is unfolded
};
/// The regular grid.
ReadingPositions even_positions(ClContext& context, const DeviceLayout& layout);

/// SnapTables on the device.
struct DeviceSnapTables {
  int vertex_count = 0, edge_count = 0;  ///< that texels can sit on
  ClBuffer<SnapVertex> vertices;
  ClBuffer<int> points;  ///< vertex_points, then edge_points
  ClBuffer<SnapEdge> edges;
  std::array<ClBuffer<LatticeRow>, 2> rows;
  ClBuffer<int> bins;  ///< bin_begins, then bin_edges
  int bin_count = 0;
};
/// \throw DeviceError when there is no room
DeviceSnapTables upload_tables(ClContext& context, const SnapTables& tables);

/// Moves reading positions from home to vertices, strongest first, and then to creased edges; the map does not fold.
ReadingPositions snap_positions(ClContext& context, const DeviceLayout& layout, const DeviceSnapTables& tables,
                                const ReadingPositions& positions);

}  // namespace skeletex
