// SPDX-License-Identifier: MIT
#pragma once
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "skeletex/skeleton/skeleton.h"

namespace skeletex {

/// Which bone of skeleton B each bone of skeleton A becomes.
struct Correspondence {
  std::vector<BoneIndex> bones;   ///< per bone of A, the bone of B
  std::vector<bool> is_reversed;  ///< per bone of A: its head lies at the other bone's tail
  std::vector<NodeIndex> nodes;   ///< per node of A, the node of B
  double cost = 0;  ///< mean over bones: 0 for equal names, lengths and directions, about 1 for nothing in common
};

/// From a skeleton to itself.
Correspondence identity_correspondence(const Skeleton& skeleton);
/// From B to A.
Correspondence inverse(const Correspondence& a_to_b);
/// From A to C by way of B. The costs add up.
Correspondence composed(const Correspondence& a_to_b, const Correspondence& b_to_c);

struct CorrespondenceOptions {
  /// Pairs (name in A, name in B) that must correspond; the rest is found.
  std::vector<std::pair<std::string, std::string>> given;
};

/// Finds the isomorphism of two skeletons' graphs that keeps the cyclic order of the neighbours around every bone's end
/// (paper 5: "skeletons with the same node branching"), and among several the cheapest by names, lengths and
/// directions after the best rigid alignment. Trees and cyclic graphs.
/// \throw InputError naming the first node where the branching differs, or the given pair that cannot hold
Correspondence find_correspondence(const Skeleton& a, const Skeleton& b, const CorrespondenceOptions& options = {});

/// The other bones at one end of a bone in counter-clockwise order about the direction away from that node, each with
/// the part of a turn that its separation plane takes of the cell's boundary; the order starts anywhere.
struct NeighbourInterval {
  BoneIndex bone;
  double turns = 0;
};
std::vector<NeighbourInterval> neighbour_order(const Skeleton& skeleton, BoneAtNode at);

}  // namespace skeletex
