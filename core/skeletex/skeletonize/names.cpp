// SPDX-License-Identifier: MIT
#include "skeletex/skeletonize/names.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <map>
#include <utility>
#include <vector>

#include "skeletex/convert/guess_stance.h"
#include "skeletex/skeleton/pose.h"
#include "skeletex/skeletonize/limbs.h"

namespace skeletex {
namespace {

constexpr double kApart = 0.05;  // diagonals, between a tip and the image of its partner

class Namer {
 public:
  Namer(const Surface& surface, const std::optional<MirrorPlane>& plane, Skeleton& skeleton)
      : surface_(surface), plane_(plane), skeleton_(skeleton), at_nodes_(bones_at_nodes(skeleton)) {}

  void run() {
    is_limb_.assign(skeleton_.bones.size(), false);
    if (plane_) {
      const Stance stance = guess_stance(surface_.mesh, skeleton_);
      left_ = plane_->normal.dot(stance.up.cross(stance.front)) < -0.5 ? -plane_->normal : plane_->normal;
    }
    sort_limbs();
    root_ = root();
    order_ = turn_away_from(root_, skeleton_);
    at_nodes_ = bones_at_nodes(skeleton_);
    name_limbs();
    name_trunk();
    name_nodes();
  }

 private:
  /// From the top.
  void sort_limbs() {
    limbs_ = find_limbs(skeleton_);
    for (const SkeletonLimb& limb : limbs_)
      for (const int b : limb.bones) is_limb_[b] = true;
    const auto rank = [&](const SkeletonLimb& limb) {
      const Vec3& tip = skeleton_.nodes[limb.nodes.back()].position;
      return std::array{-tip.y(), -tip.z(), -tip.x()};
    };
    std::sort(limbs_.begin(), limbs_.end(),
              [&](const SkeletonLimb& a, const SkeletonLimb& b) { return rank(a) < rank(b); });
  }

  int root() const {
    int best = -1;
    double largest = -1;
    for (int n = 0; n < static_cast<int>(skeleton_.nodes.size()); ++n) {
      if (std::all_of(at_nodes_[n].begin(), at_nodes_[n].end(),
                      [&](const BoneAtNode& at) { return is_limb_[at.bone]; }) &&
          at_nodes_[n].size() < 3)
        continue;
      const double radius = surface_.radius(skeleton_.nodes[n].position);
      if (radius > largest) largest = radius, best = n;
    }
    return best;
  }

  void name_limbs() {
    int number = 0;
    std::vector<char> is_named(limbs_.size(), 0);
    const auto name = [&](std::size_t limb, const std::string& side) {
      is_named[limb] = 1;
      for (std::size_t i = 0; i < limbs_[limb].bones.size(); ++i)
        skeleton_.bones[limbs_[limb].bones[i]].name = fmt::format("{}limb_{}_{}", side, number, i + 1);
    };
    const std::vector<int> partner =
        plane_ ? pair_limbs(skeleton_, limbs_, *plane_, kApart * surface_.diagonal) : std::vector<int>();
    for (std::size_t limb = 0; limb < limbs_.size(); ++limb) {
      if (is_named[limb]) continue;
      ++number;
      const int other = partner.empty() ? -1 : partner[limb];
      if (other < 0 || other == static_cast<int>(limb)) {
        name(limb, "");
        continue;
      }
      const bool is_left = left_.dot(skeleton_.nodes[limbs_[limb].nodes.back()].position - plane_->point) > 0;
      name(limb, is_left ? "left_" : "right_");
      name(other, is_left ? "right_" : "left_");
    }
  }

  void name_trunk() {
    int spine = 0, ring = 0;
    const std::vector<bool> is_in_cycle = bones_in_cycles(skeleton_);
    for (const BoneIndex bone : order_)
      if (!is_limb_[bone])
        skeleton_.bones[bone].name =
            is_in_cycle[bone] ? fmt::format("ring_{}", ++ring) : fmt::format("spine_{}", ++spine);
  }

  /// A node has the name of the bone that arrives there.
  void name_nodes() {
    for (Node& node : skeleton_.nodes) node.name.clear();
    skeleton_.nodes[root_].name = "root";
    for (const BoneIndex bone : order_) {
      Node& tail = skeleton_.nodes[skeleton_.bones[bone].tail];
      if (tail.name.empty()) tail.name = skeleton_.bones[bone].name + "_end";
    }
  }

  const Surface& surface_;
  const std::optional<MirrorPlane>& plane_;
  Skeleton& skeleton_;
  std::vector<std::vector<BoneAtNode>> at_nodes_;
  std::vector<bool> is_limb_;
  std::vector<SkeletonLimb> limbs_;
  std::vector<int> order_;  // of bones, from the root outwards
  int root_ = 0;
  Vec3 left_ = Vec3::UnitX();  // of the plane's two sides
};

}  // namespace

std::vector<int> turn_away_from(NodeIndex node, Skeleton& skeleton) {
  const auto at_nodes = bones_at_nodes(skeleton);
  std::vector<char> is_reached(skeleton.nodes.size(), 0), is_done(skeleton.bones.size(), 0);
  std::vector<int> order, queue{node};
  is_reached[node] = 1;
  for (std::size_t i = 0; i < queue.size(); ++i)
    for (const BoneAtNode& at : at_nodes[queue[i]]) {
      if (is_done[at.bone]) continue;
      is_done[at.bone] = 1;
      Bone& bone = skeleton.bones[at.bone];
      if (bone.head != queue[i]) std::swap(bone.head, bone.tail);
      order.push_back(at.bone);
      if (is_reached[bone.tail]) continue;
      is_reached[bone.tail] = 1;
      queue.push_back(bone.tail);
    }
  return order;
}

void name_by_place(const Surface& surface, const std::optional<MirrorPlane>& plane, Skeleton& skeleton) {
  Namer(surface, plane, skeleton).run();
}

}  // namespace skeletex
