// SPDX-License-Identifier: MIT
// Parts of Repair that look at the whole skeleton.
#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numeric>
#include <set>
#include <utility>

#include "skeletex/geometry/parallel.h"
#include "skeletex/math/portable.h"
#include "skeletex/skeletonize/repair.h"

namespace skeletex {

/// What the bones around a node cost when some of them are taken away.
double Repair::cost_without(int hub, const std::set<int>& gone) const {
  Skeleton rest = skeleton_;
  rest.bones.clear();
  std::vector<int> number(skeleton_.bones.size(), -1);
  for (int b = 0; b < static_cast<int>(number.size()); ++b) {
    if (gone.contains(b)) continue;
    number[b] = static_cast<int>(rest.bones.size());
    rest.bones.push_back(skeleton_.bones[b]);
  }
  std::vector<BoneIndex> left;
  for (const int b : bones_around({hub}))
    if (number[b] >= 0) left.push_back(number[b]);
  return cost(rest, bones_at_nodes(rest), left, kNoLimit);
}

void Repair::drop(const SkeletonLimb& limb) {
  std::vector<BoneIndex> bones = limb.bones;
  std::vector<NodeIndex> nodes(limb.nodes.begin() + 1, limb.nodes.end());
  std::sort(bones.rbegin(), bones.rend());
  std::sort(nodes.rbegin(), nodes.rend());
  for (const BoneIndex bone : bones) skeleton_.bones.erase(skeleton_.bones.begin() + bone);
  for (const NodeIndex node : nodes) remove_node(node);
  prepare();
}

/// Whether a limb hardly leaves the ball where it begins, or is short and ends where the body is thin, or at its
/// surface.
bool Repair::is_minor(const SkeletonLimb& limb) const {
  const double radius = radii_[limb.nodes.front()], end = radii_[limb.nodes.back()], length = length_of(limb);
  return length + end < 1.5 * radius || (length < 4 * radius && end < 0.35 * radius);
}

void Repair::drop_minor_limbs() {
  constexpr double kWorthIt = 0.5;        // a margin that is lacking by 0.7
  constexpr double kLengthWeight = 0.05;  // what it costs to lose a limb of two radii more than one of one
  for (;;) {
    std::map<int, std::vector<SkeletonLimb>> limbs;  // by the node where they begin
    for (SkeletonLimb& limb : find_limbs(skeleton_))
      if (is_minor(limb)) limbs[limb.nodes[0]].push_back(std::move(limb));
    const SkeletonLimb* cheapest = nullptr;
    double least = 0;
    for (const auto& [hub, at_hub] : limbs) {
      std::set<int> all;
      for (const SkeletonLimb& limb : at_hub) all.insert(limb.bones.begin(), limb.bones.end());
      if (cost_without(hub, {}) - cost_without(hub, all) < kWorthIt) continue;
      for (const SkeletonLimb& limb : at_hub) {
        const double out = std::max(0.0, length_of(limb) / radii_[hub] - 1);
        const double there = kLengthWeight * out * out + cost_without(hub, {limb.bones.begin(), limb.bones.end()}) -
                             cost_without(hub, {});
        if (!cheapest || there < least) cheapest = &limb, least = there;
      }
    }
    if (!cheapest) return;
    drop(SkeletonLimb(*cheapest));
  }
}

double Repair::total_cost() const {
  std::vector<BoneIndex> bones(skeleton_.bones.size());
  std::iota(bones.begin(), bones.end(), 0);
  double sum = cost(skeleton_, at_nodes_, bones, kNoLimit);
  for (int n = 0; n < static_cast<int>(skeleton_.nodes.size()); ++n) sum += displacement_cost(skeleton_, n);
  return sum;
}

/// The gradient of the total cost, per node and radius of the body there, by central differences.
std::vector<Vec3> Repair::gradient() const {
  constexpr double kStep = 0.03;  // radii
  std::vector<Vec3> result(skeleton_.nodes.size(), Vec3::Zero());
  for_each_index(result.size(), [&](std::size_t n) {
    const NodeIndex node = static_cast<int>(n);
    const std::vector<BoneIndex> bones = bones_around({node});
    if (std::all_of(bones.begin(), bones.end(), [&](int b) { return margins_[b].margin > kGoodMargin; })) return;
    Skeleton moved = skeleton_;
    for (int axis = 0; axis < 3; ++axis) {
      std::array<double, 2> costs{};
      for (const int side : {0, 1}) {
        moved.nodes[n].position = skeleton_.nodes[n].position;
        moved.nodes[n].position[axis] += (side == 0 ? -kStep : kStep) * radii_[n];
        costs[side] = cost(moved, at_nodes_, bones, kNoLimit) + displacement_cost(moved, node);
      }
      result[n][axis] = (costs[1] - costs[0]) / (2 * kStep);
    }
  });
  return result;
}

/// Steps with momentum, of a length that depends little on the gradient's (Kingma and Ba, Adam, 2015). A node stays
/// where it is when the step would take it or its bones too near to the surface.
void Repair::descend(int steps) {
  constexpr double kFirst = 0.12, kLast = 0.012;  // lengths of steps, radii of the body
  const std::size_t count = skeleton_.nodes.size();
  std::vector<Vec3> direction(count, Vec3::Zero());
  std::vector<double> square(count, 0);
  for (int step = 0; step < steps; ++step) {
    const double length = kFirst * portable::pow(kLast / kFirst, static_cast<double>(step) / steps);
    const std::vector<Vec3> slopes = gradient();
    for (std::size_t n = 0; n < count; ++n) {
      direction[n] = 0.8 * direction[n] + 0.2 * slopes[n];
      square[n] = 0.95 * square[n] + 0.05 * slopes[n].squaredNorm();
      if (direction[n].squaredNorm() == 0) continue;
      const Vec3 start = skeleton_.nodes[n].position;
      const Vec3 move = -length * radii_[n] / (std::sqrt(square[n]) + 1e-3) * direction[n];
      for (double share = 1; share > 0.2; share *= 0.5) {
        skeleton_.nodes[n].position = start + share * move;
        if (!surface_.is_between(start, skeleton_.nodes[n].position) &&
            is_placed_well(skeleton_, static_cast<int>(n), 0.35 * radii_[n]))
          break;
        skeleton_.nodes[n].position = start;
      }
    }
    margins_ = bone_margins(surface_.mesh, surface_.tree, skeleton_, kAngles);
  }
  margins_ = bone_margins(surface_.mesh, surface_.tree, skeleton_, kFinalAngles);
}

/// Contracts the bone at a bone's ends, or next to them, whose loss does the least.
bool Repair::merge_near(BoneIndex bone) {
  Merge best;
  for (const int b : bones_around({skeleton_.bones[bone].head, skeleton_.bones[bone].tail})) {
    const bool is_end =
        at_nodes_[skeleton_.bones[b].head].size() == 1 || at_nodes_[skeleton_.bones[b].tail].size() == 1;
    if (is_end || !is_ring_kept(b)) continue;
    for (const Vec3& place : merge_places(b)) try_merge(b, place, best);
  }
  if (best.bone >= 0) merge_at(best);
  return best.bone >= 0;
}

void Repair::relax() {
  constexpr int kFirstSteps = 60, kSteps = 30;
  constexpr double kHelps = 0.95;  // of the cost before
  descend(kFirstSteps);
  for (double before = total_cost();;) {
    const BoneIndex bone = worst_bone();
    if (bone < 0) return;
    const Skeleton skeleton = skeleton_;
    const std::vector<double> radii = radii_;
    if (!merge_near(bone)) return;
    descend(kSteps);
    const double now = total_cost();
    if (now < kHelps * before) {
      before = now;
      continue;
    }
    skeleton_ = skeleton;
    radii_ = radii;
    prepare();
    return;
  }
}

}  // namespace skeletex
