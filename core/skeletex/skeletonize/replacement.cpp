// SPDX-License-Identifier: MIT
#include "skeletex/skeletonize/replacement.h"

#include <algorithm>
#include <limits>
#include <map>
#include <set>
#include <utility>
#include <vector>

#include "skeletex/skeleton/free_name.h"
#include "skeletex/skeleton/pose.h"
#include "skeletex/skeletonize/limbs.h"
#include "skeletex/skeletonize/names.h"

namespace skeletex {
namespace {

constexpr int kSamples = 8;      // per bone
constexpr double kReach = 0.06;  // diagonals beside the ball around a bone

/// The nearest bone, and the place on it.
struct OnBone {
  BoneIndex bone;
  Vec3 place = Vec3::Zero();
  double distance = std::numeric_limits<double>::infinity();
};

OnBone nearest_on_bones(const Skeleton& skeleton, const Vec3& point) {
  OnBone nearest;
  for (int b = 0; b < static_cast<int>(skeleton.bones.size()); ++b) {
    const Vec3& head = end_position(skeleton, b, BoneEnd::kHead);
    const Vec3 way = end_position(skeleton, b, BoneEnd::kTail) - head;
    const Vec3 place = head + std::clamp((point - head).dot(way) / way.squaredNorm(), 0.0, 1.0) * way;
    if (const double distance = (point - place).norm(); distance < nearest.distance) nearest = {b, place, distance};
  }
  return nearest;
}

/// Whether a place belongs to the part of the body around a place on a bone.
bool is_near(const Surface& surface, const Vec3& place, const Vec3& on_bone) {
  return (place - on_bone).norm() < surface.radius(on_bone) + kReach * surface.diagonal &&
         !surface.is_between(place, on_bone);
}

/// The length of a bone that lies near the bones of another skeleton.
double followed_length(const Surface& surface, const Skeleton& skeleton, BoneIndex bone, const Skeleton& other) {
  const Vec3 &head = end_position(skeleton, bone, BoneEnd::kHead), &tail = end_position(skeleton, bone, BoneEnd::kTail);
  int followed = 0;
  for (int i = 0; i < kSamples; ++i) {
    const Vec3 place = head + (i + 0.5) / kSamples * (tail - head);
    const OnBone nearest = nearest_on_bones(other, place);
    followed += is_near(surface, place, nearest.place);
  }
  return followed * bone_length(skeleton, bone) / kSamples;
}

int nearest_node(const Skeleton& skeleton, const Vec3& point) {
  int nearest = 0;
  for (int n = 1; n < static_cast<int>(skeleton.nodes.size()); ++n)
    if ((skeleton.nodes[n].position - point).norm() < (skeleton.nodes[nearest].position - point).norm()) nearest = n;
  return nearest;
}

/// Takes away limbs of which no node is wanted, as ears, but those whose free ends are far from all wanted bones: a rig
/// that was made for another animal can lack a leg.
/// \param bends  names of the nodes that are not wanted
void drop_new_limbs(const Surface& surface, const Skeleton& wanted, const std::set<std::string>& bends,
                    Repair& repair) {
  for (;;) {
    const Skeleton& skeleton = repair.skeleton();
    const std::vector<SkeletonLimb> limbs = find_limbs(skeleton);
    const auto is_unwanted = [&](const SkeletonLimb& limb) {
      if (!std::all_of(limb.nodes.begin() + 1, limb.nodes.end(),
                       [&](int n) { return bends.contains(skeleton.nodes[n].name); }))
        return false;
      const OnBone nearest = nearest_on_bones(wanted, skeleton.nodes[limb.nodes.back()].position);
      return nearest.distance < surface.radius(nearest.place) + kReach * surface.diagonal;
    };
    const auto found = std::find_if(limbs.begin(), limbs.end(), is_unwanted);
    if (found == limbs.end()) return;
    repair.drop(*found);
  }
}

}  // namespace

double followed_share(const Surface& surface, const Skeleton& skeleton, const Skeleton& other) {
  double length = 0, followed = 0;
  for (int b = 0; b < static_cast<int>(skeleton.bones.size()); ++b) {
    length += bone_length(skeleton, b);
    followed += followed_length(surface, skeleton, b, other);
  }
  return length > 0 ? followed / length : 1;
}

Repair with_nodes_of(const Surface& surface, Skeleton accepted, const Skeleton& wanted, const Skeleton& original) {
  std::set<std::string> taken, bends;  // names
  for (const Node& node : wanted.nodes) taken.insert(node.name);
  std::vector<char> is_placed(wanted.nodes.size(), 0);
  for (Node& node : accepted.nodes) {
    const int n = nearest_node(wanted, node.position);
    const Vec3& place = wanted.nodes[n].position;
    const bool is_pair = !is_placed[n] && &accepted.nodes[nearest_node(accepted, place)] == &node &&
                         is_near(surface, place, node.position);
    if (is_pair) {
      node.name = wanted.nodes[n].name;
      is_placed[n] = 1;
    } else {
      node.name = free_name("bend", taken);
      bends.insert(node.name);
    }
  }
  Repair repair(surface, std::move(accepted), original);
  for (std::size_t n = 0; n < wanted.nodes.size(); ++n) {
    if (is_placed[n]) continue;
    const Vec3& place = wanted.nodes[n].position;
    const OnBone at = nearest_on_bones(repair.skeleton(), place);
    if (is_near(surface, place, at.place)) repair.split(at.bone, at.place, wanted.nodes[n].name);
  }
  drop_new_limbs(surface, wanted, bends, repair);
  for (int n = static_cast<int>(repair.skeleton().nodes.size()) - 1; n >= 0; --n)
    if (bends.contains(repair.skeleton().nodes[n].name)) repair.straighten(n);
  return repair;
}

void take_bone_names(const Skeleton& wanted, Skeleton& skeleton) {
  turn_away_from(nearest_node(skeleton, wanted.nodes[root_nodes(wanted).front()].position), skeleton);
  std::map<std::pair<std::string, std::string>, std::string> between;  // names of nodes to that of the bone
  for (const Bone& bone : wanted.bones)
    between[std::minmax(wanted.nodes[bone.head].name, wanted.nodes[bone.tail].name)] = bone.name;
  std::set<std::string> taken;
  std::vector<int> others;
  for (int b = 0; b < static_cast<int>(skeleton.bones.size()); ++b) {
    Bone& bone = skeleton.bones[b];
    const auto found = between.find(std::minmax(skeleton.nodes[bone.head].name, skeleton.nodes[bone.tail].name));
    if (found != between.end() && taken.insert(found->second).second)
      bone.name = found->second;
    else
      others.push_back(b);
  }
  for (const int b : others) {
    const Vec3 middle = 0.5 * (end_position(skeleton, b, BoneEnd::kHead) + end_position(skeleton, b, BoneEnd::kTail));
    const std::string& name = wanted.bones[nearest_on_bones(wanted, middle).bone].name;
    skeleton.bones[b].name = free_name(taken.contains(name) ? name + "_part" : name, taken);
  }
}

}  // namespace skeletex
