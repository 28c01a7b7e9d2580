// SPDX-License-Identifier: MIT
#pragma once
#include <span>
#include <vector>

#include "skeletex/geometry/triangle_tree.h"
#include "skeletex/model/mesh_attributes.h"
#include "skeletex/skeleton/bone_motion.h"

namespace skeletex {

/// A mesh in place of another one near by.
struct CarriedOver {
  /// Per vertex: colours (of pictures too) and numbers. Their original is the other mesh with its weights, all its
  /// triangles turned outwards.
  MeshAttributes attributes;
  VertexBoneWeights weights;  ///< per vertex, where the other mesh has some
};
/// Per vertex of a mesh what another mesh has at its nearest point.
/// \param tree  of `from`
CarriedOver carry_over(const TriangleMesh& from, const TriangleTree& tree, const MeshAttributes& attributes,
                       const VertexBoneWeights& weights, const TriangleMesh& to);

/// Distances of the vertices of a mesh from another one, world units; of 20 000 vertices at most.
struct VertexDistances {
  double mean = 0, largest = 0;
};
VertexDistances distances_of_vertices(const TriangleMesh& mesh, const TriangleMesh& to);

/// The attributes of a mesh whose triangles have changed: those of new triangles are what other triangles have at the
/// same vertices.
/// \param before   the triangles that the attributes are of
/// \param after    those of now, with the same vertices
/// \param origins  per triangle of now the one before; -1: a new one
MeshAttributes with_triangles(const MeshAttributes& attributes, std::span<const Triangle> before,
                              std::span<const Triangle> after, std::span<const int> origins);

/// Turns the normals that look inwards at the corners of triangles that ran the other way round than most.
/// \param mesh  the positions, and the triangles of now, all of which run outwards or all inwards
/// \param before, after, origins  as above
/// \param normals  of now, by corner
void flip_inward_normals(const TriangleMesh& mesh, std::span<const Triangle> before, std::span<const Triangle> after,
                         std::span<const int> origins, CornerValues<Vec3>& normals);

}  // namespace skeletex
