// SPDX-License-Identifier: MIT
#include "skeletex/skeletonize/repair.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <set>
#include <utility>

#include "skeletex/geometry/parallel.h"

namespace skeletex {
namespace {

constexpr double kReachWeight = 0.05;
constexpr double kDisplacementWeight = 0.02;  // with 0.1, bones are contracted that moves would save
constexpr int kTrials = 20;
constexpr int kPatience = 10;           // failed attempts before a bone is contracted
constexpr double kWorthTrying = -0.2;   // a margin that the segmentation may accept all the same
constexpr double kHopeless = -30;       // margins that moves have not cured
constexpr long kMostMeasured = 40'000;  // bones, a second or two; then patience ends

}  // namespace

double RandomNumbers::uniform() {
  std::uint64_t z = state_ += 0x9e3779b97f4a7c15ULL;
  z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9ULL;
  z = (z ^ (z >> 27)) * 0x94d049bb133111ebULL;
  return static_cast<double>((z ^ (z >> 31)) >> 11) * 0x1.0p-53;
}

Vec3 RandomNumbers::in_ball(double radius) {
  for (;;) {
    Vec3 p;
    for (int d = 0; d < 3; ++d) p[d] = 2 * uniform() - 1;
    if (p.squaredNorm() <= 1) return radius * p;
  }
}

Repair::Repair(const Surface& surface, Skeleton skeleton, const Skeleton& original)
    : surface_(surface), skeleton_(std::move(skeleton)) {
  for (const Node& node : original.nodes) original_places_[node.name] = node.position;
  skeleton_.frame = surface.frame;
  for (const Node& node : skeleton_.nodes) radii_.push_back(surface.radius(node.position));
  prepare();
}

void Repair::prepare() {
  at_nodes_ = bones_at_nodes(skeleton_);
  failures_.assign(skeleton_.bones.size(), 0);
  margins_ = bone_margins(surface_.mesh, surface_.tree, skeleton_, kFinalAngles);
}

/// Bones whose margins depend on the places of these nodes.
std::vector<BoneIndex> Repair::bones_around(const std::vector<NodeIndex>& nodes) const {
  std::set<int> bones;
  for (const NodeIndex node : nodes)
    for (const BoneAtNode& at : at_nodes_[node])
      for (const BoneAtNode& next : at_nodes_[end_node(skeleton_, at.bone, opposite(at.end))]) bones.insert(next.bone);
  for (const NodeIndex node : nodes)
    for (const BoneAtNode& at : at_nodes_[node]) bones.insert(at.bone);
  return {bones.begin(), bones.end()};
}

/// What bones lack in margin, and for planes that are long. Not exact above the limit.
double Repair::cost(const Skeleton& skeleton, const std::vector<std::vector<BoneAtNode>>& at_nodes,
                    const std::vector<BoneIndex>& bones, double limit) const {
  double sum = 0;
  for (const BoneIndex bone : bones) {
    if (sum > limit) break;
    const double stop_below = kGoodMargin - std::sqrt(limit - sum) - 1e-9;  // below it the cost is above the limit
    const BoneMargin margin =
        margin_of_bone(surface_.mesh, surface_.tree, skeleton, at_nodes, bone, kAngles, stop_below);
    const double lack = std::max(0.0, kGoodMargin - margin.margin);
    const double radius = radii_[skeleton.bones[bone].head] + radii_[skeleton.bones[bone].tail];
    sum += lack * lack + kReachWeight * margin.lean * radius / surface_.diagonal;
  }
  return sum;
}

/// Whether a node and its bones keep clear of the surface.
bool Repair::is_placed_well(const Skeleton& skeleton, NodeIndex node, double least_radius) const {
  const Vec3& p = skeleton.nodes[node].position;
  if (surface_.is_near(p, least_radius)) return false;
  for (const Bone& bone : skeleton.bones) {
    if (bone.head != node && bone.tail != node) continue;
    const int other = bone.head == node ? bone.tail : bone.head;
    const Vec3& q = skeleton.nodes[other].position;
    const double length = (q - p).norm(), room = 0.2 * std::min(radii_[other], 2 * least_radius);
    if (length < 1e-4 * surface_.diagonal || surface_.is_between(p, q)) return false;
    for (const double share : {0.25, 0.5, 0.75})
      if (surface_.is_near(p + share * (q - p), room)) return false;
  }
  return true;
}

/// What the distance of a node from its original place costs; it is measured in radii of the body.
double Repair::displacement_cost(const Skeleton& skeleton, NodeIndex node) const {
  const auto place = original_places_.find(skeleton.nodes[node].name);
  if (place == original_places_.end()) return 0;
  return kDisplacementWeight * (skeleton.nodes[node].position - place->second).squaredNorm() /
         (radii_[node] * radii_[node]);
}

double Repair::length_of(const SkeletonLimb& limb) const {
  double length = 0;
  for (const int b : limb.bones) length += bone_length(skeleton_, b);
  return length;
}

bool Repair::move_node(NodeIndex node, double step, int trials) {
  std::vector<BoneIndex> bones = bones_around({node});
  // The worst first: most moves are ruled out by it.
  std::stable_sort(bones.begin(), bones.end(), [&](int a, int b) { return margins_[a].margin < margins_[b].margin; });
  const double before = displacement_cost(skeleton_, node) + cost(skeleton_, at_nodes_, bones, kNoLimit);
  const Vec3 start = skeleton_.nodes[node].position;
  std::vector<Vec3> places;
  for (int trial = 0; trial < trials; ++trial) places.push_back(start + random_.in_ball(step));
  struct Best {
    double cost;
    Vec3 place;
    long measured = 0;  ///< bones
  };
  const std::size_t per_block = (places.size() + processor_count() - 1) / processor_count();
  std::vector<Best> found(block_count(places.size(), per_block), Best{before, start});
  for_each_block(places.size(), per_block, [&](std::size_t block, std::size_t begin, std::size_t end) {
    Best& best = found[block];
    Skeleton skeleton = skeleton_;
    for (std::size_t trial = begin; trial < end; ++trial) {
      if (surface_.is_between(start, places[trial])) continue;
      skeleton.nodes[node].position = places[trial];
      if (!is_placed_well(skeleton, node, 0.5 * radii_[node])) continue;
      best.measured += static_cast<long>(bones.size());
      const double own = displacement_cost(skeleton, node);
      const double there = own + cost(skeleton, at_nodes_, bones, best.cost - own);
      if (there < best.cost) best.cost = there, best.place = places[trial];
    }
  });
  double least = before;
  for (const Best& best : found) {
    measured_ += best.measured;
    if (best.cost < least) least = best.cost, skeleton_.nodes[node].position = best.place;
  }
  return least < before;
}

/// \return whether its cost or that of the bones around has fallen noticeably
bool Repair::improve(BoneIndex bone) {
  const int head = skeleton_.bones[bone].head, tail = skeleton_.bones[bone].tail;
  std::vector<NodeIndex> nodes{head, tail};
  if (margins_[bone].margin > -0.7)
    for (const NodeIndex node : {head, tail})
      for (const BoneAtNode& at : at_nodes_[node]) {
        const int other = end_node(skeleton_, at.bone, opposite(at.end));
        if (std::find(nodes.begin(), nodes.end(), other) == nodes.end()) nodes.push_back(other);
      }
  const std::vector<BoneIndex> bones = bones_around(nodes);
  const double before = cost(skeleton_, at_nodes_, bones, kNoLimit);
  for (int scale = 0; scale < 4; ++scale)
    for (const NodeIndex node : nodes) {
      double length = 0;
      for (const BoneAtNode& at : at_nodes_[node]) length += bone_length(skeleton_, at.bone);
      length /= static_cast<double>(at_nodes_[node].size());
      const double step = scale < 3 ? std::array{0.16, 0.4, 0.05}[scale] * radii_[node] : 0.4 * length;
      move_node(node, step, kTrials);
    }
  const double after = cost(skeleton_, at_nodes_, bones, kNoLimit);
  for (const int b : bones)
    margins_[b] = margin_of_bone(surface_.mesh, surface_.tree, skeleton_, at_nodes_, b, kFinalAngles);
  return after < 0.93 * before;
}

int Repair::worst_bone() const {
  int worst = -1;
  for (int b = 0; b < static_cast<int>(margins_.size()); ++b)
    if (margins_[b].margin < kEnoughMargin && (worst < 0 || margins_[b].margin < margins_[worst].margin)) worst = b;
  return worst;
}

bool Repair::run(bool may_contract) {
  for (;;) {
    const BoneIndex bone = worst_bone();
    if (bone < 0) return true;
    if (failures_[bone] >= kPatience && margins_[bone].margin > kWorthTrying) return true;
    if (!improve(bone)) ++failures_[bone];
    if (margins_[bone].margin >= kEnoughMargin) continue;
    const bool is_patient = measured_ < kMostMeasured && margins_[bone].margin > kHopeless;
    if (failures_[bone] < (is_patient ? kPatience : 1)) continue;
    if (margins_[bone].margin > kWorthTrying) return true;
    if (!may_contract || !contract(bone)) return false;
  }
}

void Repair::shake(NodeIndex node) {
  const Vec3 start = skeleton_.nodes[node].position;
  const std::vector<BoneIndex> bones = bones_around({node});
  double least = std::numeric_limits<double>::infinity();
  Vec3 best = start;
  for (int trial = 0; trial < kTrials; ++trial) {
    const Vec3 place = start + random_.in_ball(0.5 * radii_[node]);
    skeleton_.nodes[node].position = place;
    if (surface_.is_between(start, place) || (place - start).norm() < 0.1 * radii_[node] ||
        !is_placed_well(skeleton_, node, 0.4 * radii_[node]))
      continue;
    const double there = cost(skeleton_, at_nodes_, bones, least);
    if (there < least) least = there, best = place;
  }
  skeleton_.nodes[node].position = best;
  for (const int b : bones)
    margins_[b] = margin_of_bone(surface_.mesh, surface_.tree, skeleton_, at_nodes_, b, kFinalAngles);
}

/// Whether every cycle keeps three bones when a bone is contracted.
bool Repair::is_ring_kept(BoneIndex bone) const {
  const Bone& gone = skeleton_.bones[bone];
  std::set<int> neighbours;
  for (const BoneAtNode& at : at_nodes_[gone.head])
    if (at.bone != bone) neighbours.insert(end_node(skeleton_, at.bone, opposite(at.end)));
  for (const BoneAtNode& at : at_nodes_[gone.tail])
    if (at.bone != bone && neighbours.contains(end_node(skeleton_, at.bone, opposite(at.end)))) return false;
  return true;
}

/// The tail goes, the head moves. Numbers of later bones fall by one; the tail's node is left without a bone.
Skeleton Repair::merged(BoneIndex bone, const Vec3& place) const {
  Skeleton result = skeleton_;
  const Bone gone = result.bones[bone];
  result.bones.erase(result.bones.begin() + bone);
  for (Bone& b : result.bones) {
    if (b.head == gone.tail) b.head = gone.head;
    if (b.tail == gone.tail) b.tail = gone.head;
  }
  result.nodes[gone.head].position = place;
  return result;
}

std::vector<Vec3> Repair::merge_places(BoneIndex bone) {
  const Vec3 &head = end_position(skeleton_, bone, BoneEnd::kHead),
             &tail = end_position(skeleton_, bone, BoneEnd::kTail);
  const Vec3 middle = 0.5 * (head + tail);
  const double radius = 0.5 * std::max(radii_[skeleton_.bones[bone].head], radii_[skeleton_.bones[bone].tail]);
  std::vector<Vec3> places{head, tail, middle};
  for (int i = 0; i < 5; ++i) {
    const Vec3 place = middle + random_.in_ball(std::max(radius, 0.5 * (tail - head).norm()));
    if (!surface_.is_between(middle, place)) places.push_back(place);
  }
  return places;
}

bool Repair::try_merge(BoneIndex bone, const Vec3& place, Merge& best) const {
  const Bone& gone = skeleton_.bones[bone];
  const Skeleton candidate = merged(bone, place);
  if (!is_placed_well(candidate, gone.head, 0.3 * std::min(radii_[gone.head], radii_[gone.tail]))) return false;
  const std::vector<BoneIndex> before = bones_around({gone.head, gone.tail});
  const auto at_nodes = bones_at_nodes(candidate);
  std::vector<BoneIndex> after;
  for (const int b : before)
    if (b != bone) after.push_back(b > bone ? b - 1 : b);
  const double change = cost(candidate, at_nodes, after, kNoLimit) - cost(skeleton_, at_nodes_, before, kNoLimit);
  if (best.bone < 0 || change < best.cost) best = {bone, place, change};
  return true;
}

/// \pre no bone has it
void Repair::remove_node(NodeIndex node) {
  skeleton_.nodes.erase(skeleton_.nodes.begin() + node);
  radii_.erase(radii_.begin() + node);
  for (Bone& bone : skeleton_.bones) {
    for (NodeIndex* end : {&bone.head, &bone.tail})
      if (*end > node) *end = *end - 1;
  }
}

void Repair::merge_at(const Merge& merge) {
  const Bone gone = skeleton_.bones[merge.bone];
  // The node with more bones, or the deeper one, keeps its name.
  const auto rank = [&](NodeIndex node) { return std::make_pair(at_nodes_[node].size(), radii_[node]); };
  const bool is_tail_kept = rank(gone.tail) > rank(gone.head);
  skeleton_ = merged(merge.bone, merge.place);
  if (is_tail_kept) std::swap(skeleton_.nodes[gone.head].name, skeleton_.nodes[gone.tail].name);
  radii_[gone.head] = surface_.radius(merge.place);
  remove_node(gone.tail);
  prepare();
}

/// Takes away a bone with a free end, and its end: one at the bone if there is, else the shortest.
bool Repair::drop_free_end(BoneIndex bone) {
  if (skeleton_.bones.size() < 2) return false;
  int shortest = -1;
  bool is_near = false;
  for (int b = 0; b < static_cast<int>(skeleton_.bones.size()); ++b) {
    const Bone &other = skeleton_.bones[b], &given = skeleton_.bones[bone];
    if (at_nodes_[other.head].size() > 1 && at_nodes_[other.tail].size() > 1) continue;
    const bool is_here =
        other.head == given.head || other.head == given.tail || other.tail == given.head || other.tail == given.tail;
    if (shortest >= 0 && (is_near != is_here ? is_near : bone_length(skeleton_, b) >= bone_length(skeleton_, shortest)))
      continue;
    shortest = b, is_near = is_here;
  }
  if (shortest < 0) return false;
  const Bone gone = skeleton_.bones[shortest];
  const NodeIndex node = at_nodes_[gone.head].size() == 1 ? gone.head : gone.tail;
  skeleton_.bones.erase(skeleton_.bones.begin() + shortest);
  remove_node(node);
  prepare();
  return true;
}

/// Where a bone is part of a limb, takes away what lies beyond it: planes at one end only do not cross.
bool Repair::drop_beyond(BoneIndex bone) {
  for (SkeletonLimb limb : find_limbs(skeleton_)) {
    const auto at = std::find(limb.bones.begin(), limb.bones.end(), bone);
    if (at == limb.bones.end() || at + 1 == limb.bones.end()) continue;
    const std::ptrdiff_t kept = at - limb.bones.begin() + 1;
    limb.bones.erase(limb.bones.begin(), limb.bones.begin() + kept);
    limb.nodes.erase(limb.nodes.begin(), limb.nodes.begin() + kept);
    drop(limb);
    return true;
  }
  return false;
}

bool Repair::contract(BoneIndex bone) {
  Merge best;
  const auto try_bone = [&](int b) {
    const bool is_end =
        at_nodes_[skeleton_.bones[b].head].size() == 1 || at_nodes_[skeleton_.bones[b].tail].size() == 1;
    if (is_end || !is_ring_kept(b)) return;
    for (const Vec3& place : merge_places(b)) try_merge(b, place, best);
  };
  if (skeleton_.bones.size() > 1) try_bone(bone);
  if (best.bone < 0 && drop_beyond(bone)) return true;
  if (best.bone < 0)
    for (const NodeIndex node : {skeleton_.bones[bone].head, skeleton_.bones[bone].tail})
      for (const BoneAtNode& at : at_nodes_[node])
        if (at.bone != bone) try_bone(at.bone);
  if (best.bone < 0) return drop_free_end(bone);
  merge_at(best);
  return true;
}

/// Takes a changed skeleton unless its least margin is not enough and less than before.
bool Repair::try_skeleton(Skeleton changed, std::vector<double> radii) {
  const auto least = [&] {
    double margin = kEnoughMargin;
    for (const BoneMargin& m : margins_) margin = std::min(margin, m.margin);
    return margin;
  };
  const double before = least();
  std::swap(skeleton_, changed);
  std::swap(radii_, radii);
  prepare();
  if (least() >= before) return true;
  skeleton_ = std::move(changed);
  radii_ = std::move(radii);
  prepare();
  return false;
}

bool Repair::split(BoneIndex bone, const Vec3& place, const std::string& name) {
  constexpr double kShortestPart = 0.3;  // radii of the body
  Skeleton changed = skeleton_;
  const NodeIndex node = static_cast<int>(changed.nodes.size());
  changed.nodes.push_back({name, place});
  changed.bones[bone].s.reset();
  Bone part = changed.bones[bone];
  changed.bones[bone].tail = part.head = node;
  changed.bones.push_back(std::move(part));
  std::vector<double> radii = radii_;
  radii.push_back(surface_.radius(place));
  for (const BoneIndex b : {bone, BoneIndex(static_cast<int>(changed.bones.size()) - 1)})
    if (bone_length(changed, b) < kShortestPart * radii.back()) return false;
  return try_skeleton(std::move(changed), std::move(radii));
}

bool Repair::straighten(NodeIndex node) {
  const std::vector<BoneAtNode>& at = at_nodes_[node];
  if (at.size() != 2) return false;
  const int from = end_node(skeleton_, at[0].bone, opposite(at[0].end)),
            to = end_node(skeleton_, at[1].bone, opposite(at[1].end));
  Skeleton changed = skeleton_;
  changed.bones[at[0].bone] = {skeleton_.bones[at[0].bone].name, from, to, {}};
  if (!is_ring_kept(at[0].bone) || !is_placed_well(changed, from, 0)) return false;
  drop_bones({at[1].bone}, changed);
  std::vector<double> radii = radii_;
  radii.erase(radii.begin() + node);
  return try_skeleton(std::move(changed), std::move(radii));
}

void Repair::thin_out() {
  for (;;) {
    const Skeleton before = skeleton_;
    const std::vector<double> radii = radii_;
    if (contract_cheapest() && worst_bone() < 0) continue;
    skeleton_ = before;
    radii_ = radii;
    prepare();
    return;
  }
}

void Repair::move_back() {
  constexpr int kRounds = 3;
  const auto is_fine_at = [&](NodeIndex node, const Vec3& place) {
    if (surface_.is_between(skeleton_.nodes[node].position, place)) return false;
    const Vec3 before = std::exchange(skeleton_.nodes[node].position, place);
    const std::vector<BoneIndex> bones = bones_around({node});
    const bool is_fine =
        is_placed_well(skeleton_, node, 0.25 * radii_[node]) && std::all_of(bones.begin(), bones.end(), [&](int b) {
          return margin_of_bone(surface_.mesh, surface_.tree, skeleton_, at_nodes_, b, kFinalAngles).margin >=
                 kEnoughMargin;
        });
    if (!is_fine) skeleton_.nodes[node].position = before;
    return is_fine;
  };
  for (int round = 0; round < kRounds; ++round)
    for (NodeIndex node = 0; node < static_cast<int>(skeleton_.nodes.size()); ++node) {
      const auto place = original_places_.find(skeleton_.nodes[node].name);
      if (place == original_places_.end()) continue;
      const Vec3 from = skeleton_.nodes[node].position;
      if ((place->second - from).norm() < 1e-3 * radii_[node]) continue;
      for (const double share : {1.0, 0.75, 0.5, 0.25})
        if (is_fine_at(node, from + share * (place->second - from))) break;
    }
  prepare();
}

bool Repair::contract_cheapest() {
  Merge best;
  for (int b = 0; b < static_cast<int>(skeleton_.bones.size()); ++b) {
    const bool is_end =
        at_nodes_[skeleton_.bones[b].head].size() == 1 || at_nodes_[skeleton_.bones[b].tail].size() == 1;
    if (is_end || !is_ring_kept(b)) continue;
    for (const Vec3& place : merge_places(b)) try_merge(b, place, best);
  }
  if (best.bone < 0) return drop_free_end(0);
  merge_at(best);
  return true;
}

}  // namespace skeletex
