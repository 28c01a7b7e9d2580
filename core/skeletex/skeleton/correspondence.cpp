// SPDX-License-Identifier: MIT
#include "skeletex/skeleton/correspondence.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <map>
#include <numbers>
#include <numeric>
#include <optional>
#include <queue>

#include "skeletex/geometry/best_rotation.h"
#include "skeletex/model/error.h"
#include "skeletex/skeleton/cost_table.h"
#include "skeletex/skeleton/find_bone.h"
#include "skeletex/skeleton/separation_planes.h"

namespace skeletex {

Correspondence identity_correspondence(const Skeleton& skeleton) {
  Correspondence result;
  result.bones.resize(skeleton.bones.size());
  result.nodes.resize(skeleton.nodes.size());
  std::iota(result.bones.begin(), result.bones.end(), 0);
  std::iota(result.nodes.begin(), result.nodes.end(), 0);
  result.is_reversed.assign(skeleton.bones.size(), false);
  return result;
}

Correspondence inverse(const Correspondence& a_to_b) {
  Correspondence result = a_to_b;
  for (std::size_t i = 0; i < a_to_b.bones.size(); ++i) {
    result.bones[a_to_b.bones[i]] = static_cast<int>(i);
    result.is_reversed[a_to_b.bones[i]] = a_to_b.is_reversed[i];
  }
  for (std::size_t i = 0; i < a_to_b.nodes.size(); ++i) result.nodes[a_to_b.nodes[i]] = static_cast<int>(i);
  return result;
}

Correspondence composed(const Correspondence& a_to_b, const Correspondence& b_to_c) {
  Correspondence result = a_to_b;
  for (std::size_t i = 0; i < a_to_b.bones.size(); ++i) {
    result.bones[i] = b_to_c.bones[a_to_b.bones[i]];
    result.is_reversed[i] = a_to_b.is_reversed[i] != b_to_c.is_reversed[a_to_b.bones[i]];
  }
  for (NodeIndex& node : result.nodes) node = b_to_c.nodes[node];
  result.cost += b_to_c.cost;
  return result;
}

namespace {

/// The separation planes at one end of a bone. In direction s'(angle) + x d the cell begins at the largest x over the
/// planes, x = -s'.n / d.n. So each plane is a sinusoid of the angle, and the upper envelope of sinusoids changes hands
/// where two of them cross.
class PlaneEnvelope {
 public:
  PlaneEnvelope(const Skeleton& skeleton, BoneAtNode at) : d_(direction_from(skeleton, at)) {
    const auto at_nodes = bones_at_nodes(skeleton);
    for (const BoneAtNode& other : at_nodes[end_node(skeleton, at.bone, at.end)])
      if (other.bone != at.bone) planes_.emplace_back(other.bone, d_ - direction_from(skeleton, other));
    s_ = d_.unitOrthogonal();
    b_ = d_.cross(s_);
  }
  bool is_empty() const { return planes_.empty(); }
  int first_bone() const { return planes_[0].first; }

  /// Angles where two planes cross, sorted, in [0, 2 pi).
  std::vector<double> crossings() const {
    std::vector<double> angles;
    for (std::size_t i = 0; i < planes_.size(); ++i)
      for (std::size_t j = i + 1; j < planes_.size(); ++j) {
        const Vec3 difference =
            planes_[i].second / d_.dot(planes_[i].second) - planes_[j].second / d_.dot(planes_[j].second);
        const double angle = std::atan2(s_.dot(difference), -b_.dot(difference));
        for (const double a : {angle, angle + std::numbers::pi})
          angles.push_back(a - 2 * std::numbers::pi * std::floor(a / (2 * std::numbers::pi)));
      }
    std::sort(angles.begin(), angles.end());
    return angles;
  }

  /// The bone whose plane is the highest at an angle.
  int bone_at(double angle) const {
    const auto height = [&](const Vec3& n) {
      return -(std::cos(angle) * s_.dot(n) + std::sin(angle) * b_.dot(n)) / d_.dot(n);
    };
    std::size_t best = 0;
    for (std::size_t n = 1; n < planes_.size(); ++n)
      if (height(planes_[n].second) > height(planes_[best].second)) best = n;
    return planes_[best].first;
  }

 private:
  Vec3 d_, s_, b_;
  std::vector<std::pair<int, Vec3>> planes_;  ///< bone and normal
};

}  // namespace

std::vector<NeighbourInterval> neighbour_order(const Skeleton& skeleton, BoneAtNode at) {
  const PlaneEnvelope envelope(skeleton, at);
  if (envelope.is_empty()) return {};
  const std::vector<double> bounds = envelope.crossings();
  if (bounds.empty()) return {{envelope.first_bone(), 1.0}};
  std::vector<NeighbourInterval> order;
  for (std::size_t i = 0; i < bounds.size(); ++i) {
    const double begin = bounds[i], end = i + 1 < bounds.size() ? bounds[i + 1] : bounds[0] + 2 * std::numbers::pi;
    const BoneIndex bone = envelope.bone_at((begin + end) / 2);
    const double turns = (end - begin) / (2 * std::numbers::pi);
    if (!order.empty() && order.back().bone == bone)
      order.back().turns += turns;
    else
      order.push_back({bone, turns});
  }
  if (order.size() > 1 && order.front().bone == order.back().bone) {
    order.front().turns += order.back().turns;
    order.pop_back();
  }
  return order;
}

namespace {

constexpr double kImpossible = std::numeric_limits<double>::infinity();
/// Neighbours that share less than this part of a turn of a bone's boundary may fall in another order: separation
/// planes of nearly co-circular directions meet in slivers.
constexpr double kSliver = 0.03;

/// One skeleton with what the search asks of it again and again.
struct Side {
  const Skeleton* skeleton;
  std::vector<std::vector<BoneAtNode>> at;
  std::vector<double> lengths;                                       // shares of the whole skeleton's length
  std::vector<std::array<std::vector<NeighbourInterval>, 2>> order;  // per bone and end

  explicit Side(const Skeleton& s) : skeleton(&s), at(bones_at_nodes(s)), order(s.bones.size()) {
    double total = 0;
    for (int i = 0; i < count(); ++i) total += lengths.emplace_back(bone_length(s, i));
    for (double& length : lengths) length *= count() / total;
    for (int i = 0; i < count(); ++i)
      for (const BoneEnd end : {BoneEnd::kHead, BoneEnd::kTail})
        order[i][static_cast<int>(end)] = neighbour_order(s, {i, end});
  }
  int count() const { return static_cast<int>(skeleton->bones.size()); }
  int node(BoneAtNode bone) const { return end_node(*skeleton, bone.bone, bone.end); }
  const std::string& bone_name(BoneIndex bone) const { return skeleton->bones[bone].name; }
  const std::string& node_name(NodeIndex node) const { return skeleton->nodes[node].name; }
};

/// Search for the cheapest isomorphism under a fixed rotation of A onto B. Partial assignments grow from a pair of
/// directed bones; a subtree's best assignment does not depend on what lies before it, so trees are solved by memo.
class Search {
 public:
  Search(const Side& a, const Side& b, const std::vector<int>& given) : a_(a), b_(b), given_(given) {
    is_tree_ = a.count() + 1 == static_cast<int>(a.skeleton->nodes.size());
  }

  std::optional<Correspondence> run(const Eigen::Matrix3d& rotation) {
    rotation_ = rotation;
    memo_.clear();
    const BoneAtNode start{0, BoneEnd::kHead};
    std::optional<Correspondence> best;
    for (int j = 0; j < b_.count(); ++j)
      for (const BoneEnd end : {BoneEnd::kHead, BoneEnd::kTail}) {
        bound_ = best ? best->cost : kImpossible;
        State state = empty_state();
        if (!assign_bone(state, start, {j, end})) continue;
        const double cost = is_tree_ ? assign_tree(state, start, {j, end}) : assign_graph(state, start, {j, end});
        if (cost < kImpossible) best = Correspondence{state.bones, state.is_reversed, state.nodes, cost};
      }
    return best;
  }

 private:
  struct State {
    std::vector<BoneIndex> bones;
    std::vector<NodeIndex> nodes;
    std::vector<bool> is_reversed, is_taken, is_node_taken;
  };
  /// Assigns all bones when x becomes y.
  /// \return the cost, or kImpossible if it is not below the bound
  double assign_tree(State& state, BoneAtNode x, BoneAtNode y) {
    const BoneAtNode behind_x{x.bone, opposite(x.end)}, behind_y{y.bone, opposite(y.end)};
    const double cost = bone_cost(x, y) + (subtree_cost(x, y) + subtree_cost(behind_x, behind_y));
    if (cost >= bound_ || !expand_tree(state, x, y) || !expand_tree(state, behind_x, behind_y)) return kImpossible;
    return cost;
  }
  double assign_graph(State& state, BoneAtNode x, BoneAtNode y) {
    const BoneAtNode behind_x{x.bone, opposite(x.end)}, behind_y{y.bone, opposite(y.end)};
    std::vector<std::pair<int, int>> open{{a_.node(x), b_.node(y)}, {a_.node(behind_x), b_.node(behind_y)}};
    const std::optional<std::pair<double, State>> found = expand_graph(state, open, bone_cost(x, y));
    if (!found) return kImpossible;
    state = found->second;
    return found->first;
  }

  State empty_state() const {
    State s;
    s.bones.assign(a_.count(), -1);
    s.is_reversed.assign(a_.count(), false);
    s.is_taken.assign(b_.count(), false);
    s.nodes.assign(a_.skeleton->nodes.size(), -1);
    s.is_node_taken.assign(b_.skeleton->nodes.size(), false);
    return s;
  }

  bool assign_node(State& s, NodeIndex node, int to) const {
    if (s.nodes[node] == to) return true;
    if (s.nodes[node] >= 0 || s.is_node_taken[to] || a_.at[node].size() != b_.at[to].size()) return false;
    s.nodes[node] = to;
    s.is_node_taken[to] = true;
    return true;
  }
  /// Bone x with its end matches bone y with its end.
  bool assign_bone(State& s, BoneAtNode x, BoneAtNode y) const {
    if (s.bones[x.bone] == y.bone) return s.is_reversed[x.bone] == (x.end != y.end);
    if (s.bones[x.bone] >= 0 || s.is_taken[y.bone] || !may_become(x, y)) return false;
    if (!assign_node(s, a_.node(x), b_.node(y)) ||
        !assign_node(s, a_.node({x.bone, opposite(x.end)}), b_.node({y.bone, opposite(y.end)})))
      return false;
    s.bones[x.bone] = y.bone;
    s.is_reversed[x.bone] = x.end != y.end;
    s.is_taken[y.bone] = true;
    return true;
  }

  double bone_cost(BoneAtNode x, BoneAtNode y) const {
    if (given_[x.bone] == y.bone) return 0;
    const double name = a_.bone_name(x.bone) == b_.bone_name(y.bone) ? 0 : 1;
    const double length = std::min(1.0, std::abs(std::log(a_.lengths[x.bone] / b_.lengths[y.bone])));
    const double cosine = (rotation_ * direction_from(*a_.skeleton, x)).dot(direction_from(*b_.skeleton, y));
    return (0.5 * name + 0.15 * length + 0.35 * (1 - cosine) / 2) / a_.count();
  }

  /// Do the neighbours of x follow each other as those of y do, but for slivers on either side?
  /// \param bones  what bones become; others are left out
  bool keeps_order(BoneAtNode x, BoneAtNode y, const std::map<int, int>& bones) const {
    const auto& from = a_.order[x.bone][static_cast<int>(x.end)];
    const auto& to = b_.order[y.bone][static_cast<int>(y.end)];
    const auto turns_of = [](const std::vector<NeighbourInterval>& order, BoneIndex bone) {
      double turns = 0;
      for (const NeighbourInterval& i : order)
        if (i.bone == bone) turns += i.turns;
      return turns;
    };
    std::vector<int> left, right;
    for (const NeighbourInterval& i : from) {
      const auto target = bones.find(i.bone);
      if (i.turns >= kSliver && target != bones.end() && turns_of(to, target->second) >= kSliver)
        left.push_back(target->second);
    }
    for (const NeighbourInterval& i : to) {
      int source = -1;
      for (const auto& [p, q] : bones)
        if (q == i.bone) source = p;
      if (i.turns >= kSliver && source >= 0 && turns_of(from, source) >= kSliver) right.push_back(i.bone);
    }
    if (left.size() != right.size()) return false;
    if (left.empty()) return true;
    for (std::size_t shift = 0; shift < right.size(); ++shift) {
      if (left == right) return true;
      std::rotate(right.begin(), right.begin() + 1, right.end());
    }
    return false;
  }

  /// \param targets  some bones at a node, and what they become
  bool node_keeps_order(const std::map<int, BoneAtNode>& targets, NodeIndex node) const {
    std::map<int, int> bones;
    for (const auto& [bone, target] : targets) bones[bone] = target.bone;
    return std::all_of(a_.at[node].begin(), a_.at[node].end(), [&](const BoneAtNode& x) {
      const auto y = targets.find(x.bone);
      return y == targets.end() || keeps_order(x, y->second, bones);
    });
  }

  /// Whether bone x may become bone y: pairs that are given, and the number of bones at the other ends.
  bool may_become(BoneAtNode x, BoneAtNode y) const {
    if (given_[x.bone] >= 0 ? given_[x.bone] != y.bone
                            : std::find(given_.begin(), given_.end(), y.bone) != given_.end())
      return false;
    return a_.at[a_.node({x.bone, opposite(x.end)})].size() == b_.at[b_.node({y.bone, opposite(y.end)})].size();
  }

  /// Calls visit(free, targets, cost) with assignments of the bones at a node, given some of them, that keep the order
  /// and cost less than the limit: branch and bound, as k bones have k! of them.
  /// \param cost_of  of a free bone and its target
  /// \param limit  returns what is too much by now
  template <class Cost, class Limit, class Visit>
  void for_each_assignment(NodeIndex node, int to, std::map<int, BoneAtNode> known, const Cost& cost_of,
                           const Limit& limit, const Visit& visit) const {
    std::vector<BoneAtNode> free_from, free_to;
    for (const BoneAtNode& x : a_.at[node])
      if (!known.contains(x.bone)) free_from.push_back(x);
    for (const BoneAtNode& y : b_.at[to])
      if (std::none_of(known.begin(), known.end(), [&](const auto& k) { return k.second.bone == y.bone; }))
        free_to.push_back(y);
    const std::size_t count = free_from.size();
    if (free_to.size() != count) return;
    CostTable costs(count);
    for (std::size_t i = 0; i < count; ++i)
      for (std::size_t j = 0; j < count; ++j)
        if (may_become(free_from[i], free_to[j])) costs.of(i, j) = cost_of(free_from[i], free_to[j]);
    const std::function<void(std::size_t, double)> assign_from = [&](std::size_t i, double cost) {
      if (cost + costs.least_from(i) >= limit() || !node_keeps_order(known, node)) return;
      if (i == count) return visit(free_from, known, cost);
      for (const std::size_t j : costs.cheapest_first(i)) {
        known.insert_or_assign(free_from[i].bone, free_to[j]);
        costs.take(j, true);
        assign_from(i + 1, cost + costs.of(i, j));
        costs.take(j, false);
      }
      known.erase(free_from[i].bone);
    };
    assign_from(0, 0);
  }

  /// Cheapest cost of everything behind the node at x's end, when x becomes y. Trees.
  double subtree_cost(BoneAtNode x, BoneAtNode y) {
    const auto key = std::array<int, 4>{x.bone, static_cast<int>(x.end), y.bone, static_cast<int>(y.end)};
    if (const auto it = memo_.find(key); it != memo_.end()) return it->second.first;
    double best = kImpossible;
    std::map<int, BoneAtNode> best_targets;
    const auto cost_of = [&](BoneAtNode child, BoneAtNode target) {
      return bone_cost(child, target) +
             subtree_cost({child.bone, opposite(child.end)}, {target.bone, opposite(target.end)});
    };
    const NodeIndex node = a_.node(x), to = b_.node(y);
    if (a_.at[node].size() == b_.at[to].size())
      for_each_assignment(
          node, to, {{x.bone, y}}, cost_of, [&] { return best; },
          [&](const std::vector<BoneAtNode>&, const std::map<int, BoneAtNode>& targets, double cost) {
            best = cost;
            best_targets = targets;
          });
    memo_[key] = {best, best_targets};
    return best;
  }
  bool expand_tree(State& s, BoneAtNode x, BoneAtNode y) {
    const auto targets = memo_.at({x.bone, static_cast<int>(x.end), y.bone, static_cast<int>(y.end)}).second;
    for (const BoneAtNode& child : a_.at[a_.node(x)]) {
      if (child.bone == x.bone) continue;
      const BoneAtNode target = targets.at(child.bone);
      if (!assign_bone(s, child, target)) return false;
      if (!expand_tree(s, {child.bone, opposite(child.end)}, {target.bone, opposite(target.end)})) return false;
    }
    return true;
  }

  /// Branch and bound over the nodes whose bones are not all assigned. Cyclic graphs.
  std::optional<std::pair<double, State>> expand_graph(const State& state, std::vector<std::pair<int, int>> open,
                                                       double cost) {
    if (cost >= bound_) return {};
    if (open.empty()) {
      bound_ = cost;
      return std::pair{cost, state};
    }
    const auto [node, to] = open.back();
    open.pop_back();
    std::map<int, BoneAtNode> known;
    for (const BoneAtNode& x : a_.at[node])
      if (state.bones[x.bone] >= 0)
        known.emplace(x.bone, BoneAtNode{state.bones[x.bone], state.is_reversed[x.bone] ? opposite(x.end) : x.end});
    std::optional<std::pair<double, State>> best;
    for_each_assignment(
        node, to, known, [&](BoneAtNode child, BoneAtNode target) { return bone_cost(child, target); },
        [&] { return bound_ - cost; },
        [&](const std::vector<BoneAtNode>& free, const std::map<int, BoneAtNode>& targets, double added) {
          State next = state;
          auto next_open = open;
          for (const BoneAtNode& child : free) {
            const int far = a_.node({child.bone, opposite(child.end)});
            const bool is_new = next.nodes[far] < 0;
            if (!assign_bone(next, child, targets.at(child.bone))) return;
            if (is_new) next_open.emplace_back(far, next.nodes[far]);
          }
          if (auto found = expand_graph(next, std::move(next_open), cost + added)) best = std::move(found);
        });
    return best;
  }

  const Side& a_;
  const Side& b_;
  const std::vector<int>& given_;
  bool is_tree_ = true;
  Eigen::Matrix3d rotation_ = Eigen::Matrix3d::Identity();
  std::map<std::array<int, 4>, std::pair<double, std::map<int, BoneAtNode>>> memo_;
  double bound_ = kImpossible;
};

/// The rotation that turns A's bone directions best onto those they correspond to.
Eigen::Matrix3d best_rotation(const Side& a, const Side& b, const Correspondence& c) {
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  for (int i = 0; i < a.count(); ++i) {
    const Vec3 to = direction_from(*b.skeleton, {c.bones[i], c.is_reversed[i] ? BoneEnd::kTail : BoneEnd::kHead});
    covariance += to * direction_from(*a.skeleton, {i, BoneEnd::kHead}).transpose();
  }
  return skeletex::best_rotation(covariance);
}

/// The nodes breadth first from the one with the most bones, those with more bones first.
std::vector<int> walk_from_busiest(const Side& side) {
  int start = 0;
  for (std::size_t n = 0; n < side.at.size(); ++n)
    if (side.at[n].size() > side.at[start].size()) start = static_cast<int>(n);
  std::vector<int> order{start};
  std::vector<bool> seen(side.at.size(), false);
  seen[start] = true;
  for (std::size_t i = 0; i < order.size(); ++i) {
    std::vector<int> next;
    for (const BoneAtNode& bone : side.at[order[i]]) {
      const int far = side.node({bone.bone, opposite(bone.end)});
      if (!seen[far]) seen[far] = true, next.push_back(far);
    }
    std::sort(next.begin(), next.end(), [&](int p, int q) { return side.at[p].size() > side.at[q].size(); });
    order.insert(order.end(), next.begin(), next.end());
  }
  return order;
}

/// Why there is no isomorphism: both graphs are walked from the nodes that look most alike.
std::string first_difference(const Side& a, const Side& b) {
  std::map<std::string, int> named;
  for (std::size_t n = 0; n < b.skeleton->nodes.size(); ++n)
    named[b.node_name(static_cast<int>(n))] = static_cast<int>(n);
  for (std::size_t n = 0; n < a.skeleton->nodes.size(); ++n) {
    const auto it = named.find(a.node_name(static_cast<int>(n)));
    if (it != named.end() && a.at[n].size() != b.at[it->second].size())
      return fmt::format("the number of bones at node \"{}\" is {} in the first and {} in the second", it->first,
                         a.at[n].size(), b.at[it->second].size());
  }
  // Without names: degrees along a breadth-first walk from the busiest nodes.
  const std::vector<int> left = walk_from_busiest(a), right = walk_from_busiest(b);
  for (std::size_t i = 0; i < std::min(left.size(), right.size()); ++i)
    if (a.at[left[i]].size() != b.at[right[i]].size())
      return fmt::format("the number of bones at node \"{}\" of the first is {}, at node \"{}\" of the second {}",
                         a.node_name(left[i]), a.at[left[i]].size(), b.node_name(right[i]), b.at[right[i]].size());
  if (a.count() != b.count()) return fmt::format("the first has {} bones, the second {}", a.count(), b.count());
  // Same degrees: the order around some node differs.
  for (std::size_t i = 0; i < left.size(); ++i)
    if (a.at[left[i]].size() > 3)
      return fmt::format(
          "the bones follow each other in another order around node \"{}\" of the first and node \"{}\" of the second",
          a.node_name(left[i]), b.node_name(right[i]));
  return "their bones are joined differently";
}

int index_of(const Skeleton& skeleton, const std::string& name, const char* which) {
  if (const std::optional<int> bone = find_bone(skeleton, name)) return *bone;
  throw InputError(fmt::format("the {} skeleton has no bone \"{}\"", which, name));
}

/// The cheapest isomorphism under any rotation. Models may face any way: the turns about each axis are tried, and each
/// is refined by the alignment that it leads to.
std::optional<Correspondence> cheapest_isomorphism(const Side& left, const Side& right, Search& search) {
  std::vector<Eigen::Matrix3d> rotations{Eigen::Matrix3d::Identity()};
  for (const Vec3& axis : {Vec3(Vec3::UnitY()), Vec3(Vec3::UnitZ()), Vec3(Vec3::UnitX())})
    for (const int quarter : {2, 1, 3})
      rotations.push_back(Eigen::AngleAxisd(quarter * std::numbers::pi / 2, axis).toRotationMatrix());
  std::optional<Correspondence> best;
  for (const Eigen::Matrix3d& initial : rotations) {
    Eigen::Matrix3d rotation = initial;
    for (int round = 0; round < 3; ++round) {
      const std::optional<Correspondence> found = search.run(rotation);
      if (!found) break;
      if (!best || found->cost < best->cost - 1e-12) best = found;
      rotation = best_rotation(left, right, *found);
    }
    if (!best || best->cost < 1e-12) break;  // no isomorphism under any rotation, or none that is cheaper
  }
  return best;
}

}  // namespace

Correspondence find_correspondence(const Skeleton& a, const Skeleton& b, const CorrespondenceOptions& options) {
  const Side left(a), right(b);
  std::vector<int> given(a.bones.size(), -1);
  for (const auto& [from, to] : options.given) given[index_of(a, from, "first")] = index_of(b, to, "second");
  if (left.count() == right.count() && a.nodes.size() == b.nodes.size() && left.count() > 0) {
    Search search(left, right, given);
    if (const std::optional<Correspondence> best = cheapest_isomorphism(left, right, search)) return *best;
  }
  if (!options.given.empty()) {
    find_correspondence(a, b);  // throws when there is none at all
    throw InputError(fmt::format(
        "no correspondence of the skeletons holds the pair {}={}; the bones around them are joined differently",
        options.given.front().first, options.given.front().second));
  }
  throw InputError(fmt::format("the skeletons do not correspond: {}; give skeletons with the same branching",
                               first_difference(left, right)));
}

}  // namespace skeletex
