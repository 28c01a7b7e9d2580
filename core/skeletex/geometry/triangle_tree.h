// SPDX-License-Identifier: MIT
#pragma once
#include <functional>
#include <limits>
#include <span>
#include <vector>

#include "skeletex/geometry/mesh.h"

namespace skeletex {

/// A tree of boxes over the triangles of a mesh, eight children to a node, complete and hence without pointers: child k
/// of node j of level l is node 8 j + k of level l - 1; the nodes of level 0 are blocks of eight triangles in the order
/// of a Hilbert curve; the highest level has one node. Coordinates are float32, relative to `origin` and in units of
/// `scale`; boxes are rounded outwards.
struct TriangleTree {
  static constexpr int kWidth = 8;
  Vec3 origin = Vec3::Zero();
  double scale = 1;
  std::vector<int> order;               ///< place in the tree -> triangle of the mesh
  std::vector<Eigen::Vector3f> points;  ///< the mesh's vertices
  /// Per node of levels 1 and up six planes of eight values, one per child: least x, y, z, greatest x, y, z. Places
  /// past the end hold a box far away.
  std::vector<float> boxes;
  std::vector<int> level_begin;  ///< per level: its first node in `boxes`; [0] is unused
  int top_level() const { return static_cast<int>(level_begin.size()) - 1; }  ///< at least 1
};

/// Cost: O(triangles), about 0.3 s per million.
/// \pre at least one triangle; indices in range, coordinates finite
TriangleTree build_triangle_tree(const TriangleMesh& mesh);
/// The same over the triangles in a given order, in which those that follow each other lie near each other.
/// \param order  each triangle once
TriangleTree build_triangle_tree(const TriangleMesh& mesh, std::vector<int> order);

/// The triangles of the tree's blocks: per block nine planes of eight values, x, y, z of the first vertex, then of the
/// edges to the second and third. Places past the end hold a triangle far away.
std::vector<float> triangles_of_blocks(const TriangleMesh& mesh, const TriangleTree& tree);

/// Makes a tree fit again after triangles have moved, by no more than their mesh's extent.
/// \param places  theirs in the order of the tree
void update_triangle_tree(const TriangleMesh& mesh, std::span<const int> places, TriangleTree& tree);

struct NearestTriangle {
  TriangleIndex triangle;  ///< none where nothing is nearer than the bound
  double distance = std::numeric_limits<double>::infinity();
};
/// The triangle nearest to a point, on the host and in double precision; of few points, else see NearestSearch.
/// \param tree   of the mesh
/// \param bound  triangles that are not nearer are left out
/// \param counts when given, triangles for which it is false are left out
NearestTriangle find_nearest_triangle(const TriangleMesh& mesh, const TriangleTree& tree, const Vec3& point,
                                      double bound = std::numeric_limits<double>::infinity(),
                                      const std::function<bool(TriangleIndex triangle)>& counts = nullptr);

/// Calls visit with every triangle whose box meets a box, and with some others near by.
/// \param lower, upper  of the box, in the mesh's coordinates; may be infinite
void for_each_triangle_near(const TriangleTree& tree, const Vec3& lower, const Vec3& upper,
                            const std::function<void(TriangleIndex triangle)>& visit);

/// Where a ray first meets the mesh, in single precision: origin + share * direction. Triangles count from both sides.
/// \param limit    hits at larger shares are left out
/// \param skipped  so is this triangle
/// \return the share; infinity without a hit
double find_first_hit(const TriangleMesh& mesh, const TriangleTree& tree, const Vec3& origin, const Vec3& direction,
                      double limit = std::numeric_limits<double>::infinity(), int skipped = -1);

}  // namespace skeletex
