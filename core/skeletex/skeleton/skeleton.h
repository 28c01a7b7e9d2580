// SPDX-License-Identifier: MIT
#pragma once
#include <optional>
#include <string>
#include <vector>

#include "skeletex/geometry/mesh.h"

namespace skeletex {

enum class BoneEnd { kHead = 0, kTail = 1 };
inline BoneEnd opposite(BoneEnd end) { return end == BoneEnd::kHead ? BoneEnd::kTail : BoneEnd::kHead; }

struct Node {
  std::string name;
  Vec3 position = Vec3::Zero();
};

/// A bone from its head node to its tail node.
struct Bone {
  std::string name;
  NodeIndex head;
  NodeIndex tail;
  std::optional<Vec3> s;  ///< direction of angle 0, as the file gives it; need not be unit or orthogonal
};

/// A graph of bones: a tree, or a graph with cycles (paper, Figure 12). A node may have any number of bones at it.
struct Skeleton {
  std::vector<Node> nodes;
  std::vector<Bone> bones;
  UnitFrame frame{};  ///< of the positions; a model's texels and seams are in that of its skeleton
};

/// The skeleton of a mesh in the unit frame of the mesh, rounded (UnitFrame::rounded_from_user).
Skeleton in_unit_frame(Skeleton skeleton, const UnitFrame& frame);
/// The skeleton with its nodes in another frame.
Skeleton in_frame(Skeleton skeleton, const UnitFrame& frame);
/// Where a point of the skeleton's frame is, in the user's units, for messages.
std::string text_of(const Skeleton& skeleton, const Vec3& point);

/// Orthonormal right-handed basis of a bone (paper 3.1): o along the bone, b = o x s. The angle about the bone runs
/// from s towards b.
struct BoneBasis {
  Vec3 o, s, b;
};

/// A bone as seen from one of its end nodes.
struct BoneAtNode {
  BoneIndex bone;
  BoneEnd end;  ///< which end of the bone lies at the node
};

/// The bones at each node, in the order of the skeleton's bones.
std::vector<std::vector<BoneAtNode>> bones_at_nodes(const Skeleton& skeleton);
/// Unit direction from the node at `end` along the bone, away from that node.
Vec3 direction_from(const Skeleton& skeleton, BoneAtNode bone);
double bone_length(const Skeleton& skeleton, BoneIndex bone);
/// Position of the node at one end of a bone.
const Vec3& end_position(const Skeleton& skeleton, BoneIndex bone, BoneEnd end);
NodeIndex end_node(const Skeleton& skeleton, BoneIndex bone, BoneEnd end);
/// The end of a bone that lies at a node.
/// \pre one of them does
BoneEnd end_at(const Skeleton& skeleton, BoneIndex bone, NodeIndex node);

/// Bases of all bones. A given `s` is made orthonormal to o; a missing one is carried from a neighbouring bone by the
/// reflection in the separation plane between them, so that nothing twists: a point of the separation plane at angle v
/// about the one bone lies at v about the other, or at -v when the same end of both is at the node. (Where a tail meets
/// a head this is the smallest rotation between the two.) Carried breadth first from the given ones, else from the
/// first bone of each component, whose own s is the world axis least aligned with o, made orthogonal.
/// \throw InputError naming a bone of no length, or one whose s is parallel to it
std::vector<BoneBasis> bone_bases(const Skeleton& skeleton);

/// That no two bones leave a node in the same direction, so that a plane separates them.
/// \throw TopologyError naming the bones, the node and its place
void check_directions(const Skeleton& skeleton);

/// Centre of the nodes' bounding box.
/// \pre there are nodes
Vec3 middle_of_nodes(const Skeleton& skeleton);

/// Distance from a point to the bone segment [H,T].
double distance_to_bone(const Vec3& point, const Vec3& head, const Vec3& tail);

}  // namespace skeletex
