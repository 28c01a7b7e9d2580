// SPDX-License-Identifier: MIT
#include "skeletex/skeletonize/limbs.h"

#include <algorithm>
#include <limits>
#include <set>
#include <utility>

namespace skeletex {
namespace {

constexpr double kApart = 0.06;  // diagonals, between a node and the image of its partner

/// Per node the one at its image, itself in the plane; -1: none. Of nodes that are not marked only.
std::vector<int> pair_nodes(const Skeleton& skeleton, const std::vector<char>& is_left_out, const MirrorPlane& plane,
                            double apart) {
  const int count = static_cast<int>(skeleton.nodes.size());
  std::vector<int> partner(count, -1);
  for (int n = 0; n < count; ++n) {
    if (is_left_out[n]) continue;
    const Vec3 image = plane.mirrored(skeleton.nodes[n].position);
    double least = apart;
    for (int m = 0; m < count; ++m) {
      const double distance = (skeleton.nodes[m].position - image).norm();
      if (!is_left_out[m] && distance < least) least = distance, partner[n] = m;
    }
  }
  for (int n = 0; n < count; ++n)
    if (partner[n] >= 0 && partner[partner[n]] != n) return {};
  return partner;
}

/// Replaces a limb by the image of another one.
void mirror_limb(const SkeletonLimb& from, const SkeletonLimb& to, const MirrorPlane& plane, Skeleton& skeleton,
                 std::set<int>& gone_bones) {
  int before = to.nodes[0];
  for (std::size_t i = 1; i < from.nodes.size(); ++i) {
    const Vec3 place = plane.mirrored(skeleton.nodes[from.nodes[i]].position);
    NodeIndex node = i < to.nodes.size() ? to.nodes[i] : NodeIndex();
    if (node < 0) {
      node = static_cast<int>(skeleton.nodes.size());
      skeleton.nodes.push_back({"", place});
    }
    skeleton.nodes[node].position = place;
    if (i - 1 < to.bones.size())
      skeleton.bones[to.bones[i - 1]] = {"", before, node, {}};
    else
      skeleton.bones.push_back({"", before, node, {}});
    before = node;
  }
  for (std::size_t i = from.bones.size(); i < to.bones.size(); ++i) gone_bones.insert(to.bones[i]);
}

bool is_inside(const Surface& surface, const Skeleton& skeleton) {
  return std::all_of(skeleton.bones.begin(), skeleton.bones.end(), [&](const Bone& bone) {
    const Vec3 &p = skeleton.nodes[bone.head].position, &q = skeleton.nodes[bone.tail].position;
    return (q - p).norm() > 1e-4 * surface.diagonal && !surface.is_between(p, q) &&
           surface.radius(p) > 1e-4 * surface.diagonal;
  });
}

/// Makes what is not on a limb symmetric: pairs of nodes, and nodes in the plane.
/// \return false where it has no symmetric counterpart
bool symmetrize_trunk(const Skeleton& skeleton, const std::vector<char>& is_on_limb,
                      const std::vector<int>& node_partner, const MirrorPlane& plane, Skeleton& result) {
  if (node_partner.empty()) return false;
  for (std::size_t n = 0; n < node_partner.size(); ++n) {
    if (is_on_limb[n]) continue;
    if (node_partner[n] < 0) return false;
    result.nodes[n].position =
        0.5 * (skeleton.nodes[n].position + plane.mirrored(skeleton.nodes[node_partner[n]].position));
  }
  std::set<std::pair<int, int>> trunk;
  for (const Bone& bone : skeleton.bones)
    if (!is_on_limb[bone.head] && !is_on_limb[bone.tail]) trunk.insert(std::minmax(bone.head, bone.tail));
  return std::all_of(trunk.begin(), trunk.end(), [&](const std::pair<int, int>& bone) {
    return trunk.contains(std::minmax(node_partner[bone.first], node_partner[bone.second]));
  });
}

}  // namespace

void drop_bones(const std::set<int>& gone, Skeleton& skeleton) {
  std::vector<Bone> bones;
  for (int b = 0; b < static_cast<int>(skeleton.bones.size()); ++b)
    if (!gone.contains(b)) bones.push_back(skeleton.bones[b]);
  skeleton.bones = std::move(bones);
  std::vector<int> number(skeleton.nodes.size(), -1);
  for (const Bone& bone : skeleton.bones) number[bone.head] = number[bone.tail] = 0;
  std::vector<Node> nodes;
  for (std::size_t n = 0; n < number.size(); ++n)
    if (number[n] == 0) number[n] = static_cast<int>(nodes.size()), nodes.push_back(skeleton.nodes[n]);
  for (Bone& bone : skeleton.bones) bone.head = number[bone.head], bone.tail = number[bone.tail];
  skeleton.nodes = std::move(nodes);
}

std::vector<SkeletonLimb> find_limbs(const Skeleton& skeleton) {
  const auto at_nodes = bones_at_nodes(skeleton);
  std::vector<SkeletonLimb> limbs;
  for (int n = 0; n < static_cast<int>(skeleton.nodes.size()); ++n) {
    if (at_nodes[n].size() != 1) continue;
    SkeletonLimb limb{{}, {n}};
    BoneAtNode at = at_nodes[n][0];
    for (;;) {
      limb.bones.push_back(at.bone);
      const int next = end_node(skeleton, at.bone, opposite(at.end));
      limb.nodes.push_back(next);
      if (at_nodes[next].size() == 1) return {};  // from free end to free end
      if (at_nodes[next].size() > 2) break;
      at = at_nodes[next][at_nodes[next][0].bone == at.bone ? 1 : 0];
    }
    std::reverse(limb.bones.begin(), limb.bones.end());
    std::reverse(limb.nodes.begin(), limb.nodes.end());
    limbs.push_back(std::move(limb));
  }
  return limbs;
}

std::vector<int> pair_limbs(const Skeleton& skeleton, const std::vector<SkeletonLimb>& limbs, const MirrorPlane& plane,
                            double apart) {
  std::vector<int> partner(limbs.size(), -1);
  const auto tip = [&](std::size_t limb) { return skeleton.nodes[limbs[limb].nodes.back()].position; };
  for (std::size_t i = 0; i < limbs.size(); ++i) {
    double least = apart;
    for (std::size_t j = 0; j < limbs.size(); ++j) {
      const double distance = (tip(j) - plane.mirrored(tip(i))).norm();
      if (distance < least) least = distance, partner[i] = static_cast<int>(j);
    }
  }
  for (std::size_t i = 0; i < limbs.size(); ++i)
    if (partner[i] >= 0 && partner[partner[i]] != static_cast<int>(i)) partner[i] = -1;
  return partner;
}

std::optional<Skeleton> symmetrized(const Surface& surface, const MirrorPlane& plane, const Skeleton& skeleton) {
  const double apart = kApart * surface.diagonal;
  const std::vector<SkeletonLimb> limbs = find_limbs(skeleton);
  const std::vector<int> partner = pair_limbs(skeleton, limbs, plane, apart);
  Skeleton result = skeleton;
  std::vector<char> is_on_limb(skeleton.nodes.size(), 0);
  for (const SkeletonLimb& limb : limbs)
    for (std::size_t i = 1; i < limb.nodes.size(); ++i) is_on_limb[limb.nodes[i]] = 1;
  const std::vector<int> node_partner = pair_nodes(skeleton, is_on_limb, plane, apart);
  if (!symmetrize_trunk(skeleton, is_on_limb, node_partner, plane, result)) return std::nullopt;
  std::set<int> gone;
  for (std::size_t i = 0; i < limbs.size(); ++i) {
    if (partner[i] < 0) return std::nullopt;
    const SkeletonLimb &limb = limbs[i], &other = limbs[partner[i]];
    if (node_partner[limb.nodes[0]] != other.nodes[0]) return std::nullopt;
    if (partner[i] == static_cast<int>(i)) {
      for (std::size_t k = 1; k < limb.nodes.size(); ++k) {
        Vec3& p = result.nodes[limb.nodes[k]].position;
        p -= plane.height(p) * plane.normal;
      }
      continue;
    }
    // The one with more bones is kept; else the one on the left.
    const double left = plane.height(skeleton.nodes[limb.nodes.back()].position);
    if (std::make_pair(limb.bones.size(), left) > std::make_pair(other.bones.size(), -left))
      mirror_limb(limb, other, plane, result, gone);
  }
  drop_bones(gone, result);
  return is_inside(surface, result) ? std::optional(std::move(result)) : std::nullopt;
}

Skeleton with_joints(const Surface& surface, Skeleton skeleton) {
  constexpr double kLong = 9;            // radii of the body
  constexpr double kLeastLength = 0.08;  // diagonals
  constexpr int kSteps = 20;
  std::vector<BoneIndex> bones;
  for (const SkeletonLimb& limb : find_limbs(skeleton)) bones.insert(bones.end(), limb.bones.begin(), limb.bones.end());
  for (const BoneIndex long_bone : bones) {
    const Vec3 head = end_position(skeleton, long_bone, BoneEnd::kHead),
               tail = end_position(skeleton, long_bone, BoneEnd::kTail);
    std::vector<double> radii;
    double best_share = 0.5, least = std::numeric_limits<double>::infinity();
    for (int step = 1; step < kSteps; ++step) {
      const double share = static_cast<double>(step) / kSteps, from_middle = std::abs(share - 0.5);
      radii.push_back(surface.radius(head + share * (tail - head)));
      // Limbs get thinner outwards; a joint is where they are thinner than by that.
      const double score = radii.back() * (1 + 1.5 * from_middle);
      if (from_middle < 0.16 && score < least) least = score, best_share = share;
    }
    std::nth_element(radii.begin(), radii.begin() + kSteps / 2, radii.end());
    const double length = (tail - head).norm();
    if (length <= kLong * radii[kSteps / 2] || length < kLeastLength * surface.diagonal) continue;
    const NodeIndex node = static_cast<int>(skeleton.nodes.size());
    skeleton.nodes.push_back({"", head + best_share * (tail - head)});
    Bone& bone = skeleton.bones[long_bone];
    const int end = std::exchange(bone.tail, node);
    bone.s.reset();
    skeleton.bones.push_back({"", node, end, {}});
  }
  return skeleton;
}

}  // namespace skeletex
