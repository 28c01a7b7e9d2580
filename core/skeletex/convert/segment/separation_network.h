// SPDX-License-Identifier: MIT
#pragma once
#include <array>
#include <cstdint>
#include <unordered_map>
#include <vector>

#include "skeletex/convert/segment/cells.h"
#include "skeletex/geometry/cut_mesh.h"
#include "skeletex/geometry/union_find.h"

namespace skeletex {

using Barycentric = std::array<double, 3>;

/// Where separation planes meet an edge (two cells) or each other inside a triangle (three cells).
struct NetworkPoint {
  Vec3 position;
  std::array<int, 3> cells{-1, -1, -1};
  Barycentric weights{};   ///< of a point on an edge: weights[0] is the parameter along the edge
  TriangleIndex triangle;  ///< of a point inside
  VertexIndex vertex;      ///< once it is kept
};

/// A piece of separation plane inside a triangle, from point to point, with the regions of the triangle on its two
/// sides: the left one first.
struct NetworkPiece {
  std::array<int, 2> points;
  std::array<int, 2> regions;
  std::array<int, 2> cells;
};

/// The points on an edge, in the direction of `half_edge`, and later the half-edges of its parts on both sides.
struct DividedEdge {
  int half_edge = -1, opposite = -1;
  int first_point = 0, point_count = 0;
  std::array<int, 2> parts{-1, -1};  ///< first entry in the list of parts: of half_edge, of its opposite
};

/// A triangle whose corners lie in different cells.
struct MixedTriangle {
  TriangleIndex triangle;
  int first_piece = 0, piece_count = 0;
  int region_count = 0;
  int first_merge = 0, merge_count = 0;  ///< pairs of regions that are one
};

/// The polylines in which the separation planes of one node meet a mesh, combinatorially sound whatever rounding does.
class SeparationNetwork {
 public:
  /// \param labels  cell of every vertex
  SeparationNetwork(const CutMesh& mesh, const NodeCells& node, const std::vector<std::uint8_t>& labels);

  /// The edge of a half-edge; it is added where the network does not meet it.
  DividedEdge& edge(int half_edge);
  /// Barycentric weights of a point in one of the triangles that it lies in.
  Barycentric weights_in(int point, TriangleIndex triangle) const;
  /// The component that a point lies in, by the smallest of its points.
  int component(int point) { return components_.find(point); }

  std::vector<NetworkPoint> points;
  std::vector<NetworkPiece> pieces;
  std::vector<DividedEdge> edges;
  std::vector<std::array<int, 2>> merges;
  std::vector<MixedTriangle> triangles;

 private:
  /// The boundary of a part of a triangle, counter-clockwise: regions and the point after each.
  struct Ring {
    std::vector<int> cells, regions, points;

    int size() const { return static_cast<int>(cells.size()); }
    /// Regions begin to end (cyclic), closed by a point.
    Ring part(int begin, int end, int closing_point) const;
  };
  double value(int cell, VertexIndex vertex) const { return node_.value(cell, mesh_.positions[vertex]); }
  int edge_slot(int half_edge);
  void find_edge_points(DividedEdge& edge);
  void divide(MixedTriangle& triangle);
  void resolve(Ring ring, MixedTriangle& triangle);
  bool split_at_repeated_cell(const Ring& ring, MixedTriangle& triangle);
  NetworkPoint end_of_first_plane(const Ring& ring, TriangleIndex triangle) const;
  void add_piece(const Ring& ring, int to, MixedTriangle& triangle);

  const CutMesh& mesh_;
  const NodeCells& node_;
  const std::vector<std::uint8_t>& labels_;
  std::unordered_map<int, int> edge_of_;  ///< half-edge -> edge
  UnionFind components_;
  std::array<std::vector<double>, 3> corner_values_;  ///< of the triangle under division: per corner, per cell
};

}  // namespace skeletex
