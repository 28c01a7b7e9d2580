// SPDX-License-Identifier: MIT
#pragma once
#include <array>
#include <vector>

#include "skeletex/geometry/mesh.h"
#include "skeletex/skeleton/skeleton.h"

namespace skeletex {

/// What a bone's segment is: a tube between two nodes, a cap at one free end, or the whole of a lone bone's surface.
enum class SegmentTopology { kAnnulus, kDisk, kSphere };

/// A piece of the separation plane between two bones at one node: a polyline on the surface, shared by exactly two
/// segments.
struct Arc {
  NodeIndex node;
  std::array<BoneIndex, 2> bones{-1, -1};
  /// Vertices of the cut mesh in the direction of growing v about bones[0]. An open arc holds both corners, first and
  /// last; a closed one (two bones at the node, no corner) does not repeat its first vertex. Every open arc has at
  /// least one inner vertex; every closed one at least three vertices.
  std::vector<int> vertices;
  bool is_closed = false;
};

/// An arc as one segment runs through it.
struct ArcUse {
  ArcIndex arc;
  bool is_reversed = false;  ///< the segment's v grows against the arc's order
};

/// One end of a segment where it meets its neighbours; empty at a free end.
struct BoundaryLoop {
  std::vector<int> vertices;  ///< local vertices once around, in the direction of growing v
  std::vector<ArcUse> arcs;   ///< in the same order, the first one starts at vertices[0]
};

/// The surface of one bone.
struct Segment {
  BoneIndex bone;
  SegmentTopology topology = SegmentTopology::kAnnulus;
  TriangleMesh mesh;                  ///< local vertices and triangles, outward
  std::vector<int> source_vertices;   ///< local vertex -> vertex of the cut mesh
  std::array<BoundaryLoop, 2> loops;  ///< at the head, at the tail
};

/// The mesh cut along the separation planes of a skeleton (paper 3.1).
struct Segmentation {
  TriangleMesh cut_mesh;            ///< the input's vertices first, then those on the separation planes
  std::vector<int> triangle_bones;  ///< per triangle of the cut mesh, its bone
  std::vector<Arc> arcs;
  std::vector<Segment> segments;  ///< one per bone, in the skeleton's order
};

}  // namespace skeletex
