// SPDX-License-Identifier: MIT
#include "skeletex/rig/joint_skeleton.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "skeletex/analysis/surface_probe.h"
#include "skeletex/skeleton/free_name.h"

namespace skeletex {
namespace {

/// Joints nearer to each other are in one place; diagonals.
constexpr double kSameJoint = 2e-3;
/// Twist joints lie so near to the bone that they help to turn; of its length.
constexpr double kBesideBone = 0.05;
/// The shortest bone that is worth one at a free end; diagonals.
constexpr double kShortestTip = 0.01;

std::string lower(std::string text) {
  for (char& c : text) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return text;
}
bool has_word(const std::string& name, std::initializer_list<const char*> words) {
  const std::string text = lower(name);
  return std::any_of(words.begin(), words.end(),
                     [&](const char* word) { return text.find(word) != std::string::npos; });
}

struct Joint {
  int node = -1;
  int parent = -1;  ///< another joint
  std::vector<int> children;
  std::string name;
  Vec3 position = Vec3::Zero();
  double weight = 0;          ///< of all vertices that it moves itself
  bool is_needed = false;     ///< it or one below it moves something
  int merged_into = -1;       ///< the joint that takes its weights
  int group = -1;             ///< node of the skeleton
  std::vector<int> vertices;  ///< that it moves most
};

class SkeletonBuilder {
 public:
  SkeletonBuilder(const GltfScene& scene, const GltfSurface& surface)
      : scene_(scene), surface_(surface), diagonal_(bounding_box(surface.mesh).diagonal()), probe_(surface.mesh) {}

  JointSkeleton build() {
    collect_joints();
    weigh();
    for (int j = count() - 1; j >= 0; --j) mark_needed(j);
    drop_roots();
    join_roots();
    choose_root();
    merge_twist_joints();
    group_joints();
    if (root_ >= 0) {
      add_bones();
      add_tips();
      give_weights();
    }
    report();
    return std::move(result_);
  }

 private:
  int count() const { return static_cast<int>(joints_.size()); }
  bool is_kept(int j) const { return joints_[j].is_needed && joints_[j].merged_into < 0; }
  std::vector<int> kept_children(int j) const {
    std::vector<int> result;
    for (const int child : joints_[j].children)
      if (is_kept(child)) result.push_back(child);
    return result;
  }

  /// Joints in an order in which parents come first.
  void collect_joints() {
    const int nodes = static_cast<int>(scene_.nodes.size());
    std::vector<int> number(nodes, -1);
    std::vector<std::pair<int, int>> order;  // depth, node
    for (int node = 0; node < nodes; ++node) {
      if (!surface_.is_joint[node]) continue;
      int depth = 0;
      for (int above = node; above >= 0; above = scene_.nodes[above].parent) ++depth;
      order.emplace_back(depth, node);
    }
    std::sort(order.begin(), order.end());
    for (const auto& [depth, node] : order) {
      number[node] = count();
      Joint joint;
      joint.node = node;
      joint.name = scene_.nodes[node].name;
      if (joint.name.empty()) joint.name = fmt::format("joint_{}", node);
      joint.position = surface_.rest[node].translation();
      int above = scene_.nodes[node].parent;
      while (above >= 0 && number[above] < 0) above = scene_.nodes[above].parent;
      joint.parent = above < 0 ? -1 : number[above];
      if (joint.parent >= 0) joints_[joint.parent].children.push_back(count());
      joints_.push_back(std::move(joint));
    }
    joint_of_node_ = std::move(number);
  }

  void weigh() {
    for (int v = 0; v < static_cast<int>(surface_.weights.size()); ++v) {
      const JointWeight* strongest = nullptr;
      for (const JointWeight& weight : surface_.weights[v]) {
        joints_[joint_of_node_[weight.node]].weight += weight.weight;
        if (!strongest || weight.weight > strongest->weight) strongest = &weight;
      }
      if (strongest) joints_[joint_of_node_[strongest->node]].vertices.push_back(v);
      for (const JointWeight& a : surface_.weights[v])
        for (const JointWeight& b : surface_.weights[v])
          if (const int i = joint_of_node_[a.node], j = joint_of_node_[b.node]; i < j)
            shared_[{i, j}] += std::min(a.weight, b.weight);
    }
  }

  void mark_needed(int j) {
    Joint& joint = joints_[j];
    if (joint.weight > 0) joint.is_needed = true;
    if (joint.is_needed && joint.parent >= 0) joints_[joint.parent].is_needed = true;
  }

  /// A root that moves nothing and has one joint below: files put it at the feet, or at the origin.
  void drop_roots() {
    for (int j = 0; j < count(); ++j) {
      Joint& joint = joints_[j];
      if (!joint.is_needed || joint.parent >= 0 || joint.weight > 0) continue;
      const std::vector<int> below = kept_children(j);
      const bool is_at_child = std::any_of(below.begin(), below.end(), [&](int child) {
        return (joints_[child].position - joint.position).norm() < kSameJoint * diagonal_;
      });
      if (below.size() != 1 || is_at_child) continue;
      joint.is_needed = false;
      joints_[below[0]].parent = -1;
    }
  }

  Vec3 mean_of_vertices(int j) const {
    Vec3 sum = Vec3::Zero();
    for (const int v : joints_[j].vertices) sum += surface_.mesh.positions[v];
    return sum / static_cast<double>(joints_[j].vertices.size());
  }

  /// What a bone between two joints costs. Joints that share vertices belong together, the more the better; between
  /// others its length counts, and much more where it leaves the body.
  double cost_of_bone(int a, int b) const {
    constexpr double kLeastShare = 0.02, kOutside = 10;
    const auto found = shared_.find(std::minmax(a, b));
    if (found != shared_.end()) {
      const double share = found->second / std::min(joints_[a].weight, joints_[b].weight);
      if (share > kLeastShare) return 1 - share;
    }
    const Vec3 &p = joints_[a].position, &q = joints_[b].position;
    return 1 + (q - p).norm() / diagonal_ * (probe_.crossings(p, q).empty() ? 1 : kOutside);
  }

  /// The cheapest bone from a root to the trees that are joined already.
  struct Link {
    double cost = INFINITY;
    int joint = -1;
  };

  /// Links from roots to a tree that was joined last.
  void look_for_links(int tree_root, const std::vector<int>& roots, std::vector<Link>& links) const {
    std::vector<int> tree{tree_root};
    for (std::size_t i = 0; i < tree.size(); ++i)
      for (const int child : kept_children(tree[i])) tree.push_back(child);
    for (const int root : roots)
      for (const int j : tree)
        if (const double cost = cost_of_bone(j, root); cost < links[root].cost) links[root] = {cost, j};
  }

  /// Several trees become one, by the cheapest bones between them (Prim). Some programs write all joints side by side,
  /// and have the hierarchy in their code.
  void join_roots() {
    std::vector<double> heavy(joints_.size(), 0);
    for (int j = count() - 1; j >= 0; --j) {
      heavy[j] += joints_[j].weight;
      if (joints_[j].parent >= 0) heavy[joints_[j].parent] += heavy[j];
    }
    std::vector<int> roots;
    for (int j = 0; j < count(); ++j) {
      if (!is_kept(j) || joints_[j].parent >= 0) continue;
      roots.push_back(j);
      if (root_ < 0 || heavy[j] > heavy[root_]) root_ = j;
    }
    if (root_ < 0) return;
    std::vector<Link> links(joints_.size());
    for (int added = root_;;) {
      std::erase(roots, added);
      look_for_links(added, roots, links);
      const auto next =
          std::min_element(roots.begin(), roots.end(), [&](int a, int b) { return links[a].cost < links[b].cost; });
      if (next == roots.end()) break;
      added = *next;
      const int parent = links[added].joint;
      joints_[added].parent = parent;
      joints_[parent].children.push_back(added);
      joined_.push_back(fmt::format("\"{}\" to \"{}\"", joints_[added].name, joints_[parent].name));
    }
  }

  /// How far the surface that a joint moves lies from the middle of its bone to another joint; bone lengths.
  double misfit(int joint, int other) const {
    const Vec3 &p = joints_[joint].position, &q = joints_[other].position;
    if (joints_[joint].vertices.empty() || (q - p).norm() < kSameJoint * diagonal_) return 0;
    return (mean_of_vertices(joint) - 0.5 * (p + q)).norm() / (q - p).norm();
  }

  /// Where no joint had a parent: makes the joint the root from which the others move the bones that begin at them.
  void choose_root() {
    std::vector<int> kept;
    for (int j = 0; j < count(); ++j)
      if (is_kept(j)) kept.push_back(j);
    if (joined_.empty() || joined_.size() + 1 < kept.size()) return;  // some had a hierarchy
    std::vector<std::vector<int>> neighbours(joints_.size());
    for (const int j : kept)
      if (joints_[j].parent >= 0)
        neighbours[j].push_back(joints_[j].parent), neighbours[joints_[j].parent].push_back(j);
    std::vector<int> parents, best;
    double least = INFINITY;
    for (const int root : kept) {
      parents.assign(joints_.size(), -1);
      double sum = 0;
      std::vector<int> order{root};
      for (std::size_t i = 0; i < order.size(); ++i)
        for (const int next : neighbours[order[i]]) {
          if (next == parents[order[i]]) continue;
          parents[next] = order[i];
          sum += misfit(order[i], next);
          order.push_back(next);
        }
      if (sum < least) least = sum, best = parents, root_ = root;
    }
    for (const int j : kept) {
      joints_[j].parent = best[j];
      std::erase_if(joints_[j].children, [&](int child) { return is_kept(child); });
    }
    for (const int j : kept)
      if (best[j] >= 0) joints_[best[j]].children.push_back(j);
  }

  /// How far a joint lies beside the way from one to another, of its length; infinite beyond the ends.
  double beside(int j, int from, int to) const {
    const Vec3 way = joints_[to].position - joints_[from].position;
    const Vec3 there = joints_[j].position - joints_[from].position;
    const double length = way.norm();
    if (!(length > 0)) return INFINITY;
    const double share = there.dot(way) / (length * length);
    if (share < 0.02 || share > 0.98) return INFINITY;
    return (there - share * way).norm() / length;
  }

  void merge(int j, int into) {
    joints_[j].merged_into = into;
    for (const int child : joints_[j].children) {
      joints_[child].parent = into;
      joints_[into].children.push_back(child);
    }
    joints_[j].children.clear();
    merged_.push_back(joints_[j].name);
  }

  void merge_twist_joints() {
    for (int j = count() - 1; j >= 0; --j) {
      const int parent = joints_[j].parent;
      if (!is_kept(j) || parent < 0) continue;
      const bool is_named = has_word(joints_[j].name, {"twist", "roll"});
      const std::vector<int> below = kept_children(j);
      if (below.size() == 1 && is_named && beside(j, parent, below[0]) < kBesideBone) merge(j, parent);
      if (!below.empty()) continue;
      bool is_along = false;
      for (const int sibling : kept_children(parent))
        is_along = is_along || (sibling != j && beside(j, parent, sibling) < kBesideBone);
      if (is_named || is_along) merge(j, parent);
    }
  }

  /// Joints in one place become one node of the skeleton: with the joint above, or with one beside.
  void group_joints() {
    if (root_ < 0) return;
    std::vector<int> order{root_};  // parents first
    for (std::size_t i = 0; i < order.size(); ++i)
      for (const int child : kept_children(order[i])) order.push_back(child);
    for (const int j : order) {
      Joint& joint = joints_[j];
      const auto is_here = [&](int other) {
        return joints_[other].group >= 0 && (joints_[other].position - joint.position).norm() < kSameJoint * diagonal_;
      };
      if (joint.parent >= 0 && is_here(joint.parent)) joint.group = joints_[joint.parent].group;
      if (joint.group < 0 && joint.parent >= 0)
        for (const int sibling : joints_[joint.parent].children)
          if (sibling != j && is_kept(sibling) && is_here(sibling)) joint.group = joints_[sibling].group;
      if (joint.group >= 0) continue;
      joint.group = static_cast<int>(result_.skeleton.nodes.size());
      result_.skeleton.nodes.push_back({free_name(joint.name, node_names_), joint.position});
      result_.node_joint.push_back(joint.node);
    }
  }

  void add_bone(int joint, int head, int tail, const std::string& name) {
    Bone bone;
    bone.name = free_name(name, bone_names_);
    bone.head = head;
    bone.tail = tail;
    bones_of_[joint].push_back(static_cast<int>(result_.skeleton.bones.size()));
    result_.skeleton.bones.push_back(bone);
    result_.bone_joint.push_back(joints_[joint].node);
  }

  void add_bones() {
    bones_of_.resize(joints_.size());
    std::vector<std::vector<int>> ends(joints_.size());  // per joint, joints at the far ends of its bones
    std::vector<bool> is_reached(result_.skeleton.nodes.size(), false);
    is_reached[joints_[root_].group] = true;
    for (int j = 0; j < count(); ++j) {
      if (!is_kept(j) || joints_[j].parent < 0 || is_reached[joints_[j].group]) continue;
      is_reached[joints_[j].group] = true;
      ends[joints_[j].parent].push_back(j);
    }
    for (int j = 0; j < count(); ++j)
      for (const int end : ends[j])
        add_bone(j, joints_[j].group, joints_[end].group,
                 ends[j].size() == 1 ? joints_[j].name : fmt::format("{}_{}", joints_[j].name, joints_[end].name));
  }

  /// The joint below that shows where a bone ends, as programs write it: without weight, and named so or alone.
  int end_joint(int j) const {
    int found = -1, unneeded = 0;
    for (const int child : joints_[j].children) {
      if (joints_[child].is_needed || !joints_[child].children.empty()) continue;
      ++unneeded;
      if (has_word(joints_[child].name, {"_end", "tip", "nub", "top"}) || joints_[child].name.ends_with("End"))
        return child;
      found = child;
    }
    return unneeded == 1 ? found : -1;
  }

  /// Where the surface that a joint moves ends, less its own thickness, so that the bone stays inside.
  Vec3 tip_from_vertices(int j) const {
    const Joint& joint = joints_[j];
    Vec3 direction = mean_of_vertices(j) - joint.position;
    if (!(direction.norm() > 1e-6 * diagonal_)) return joint.position;
    direction.normalize();
    double farthest = 0;
    std::vector<double> beside;
    for (const int v : joint.vertices) {
      const Vec3 way = surface_.mesh.positions[v] - joint.position;
      farthest = std::max(farthest, way.dot(direction));
      beside.push_back(way.cross(direction).norm());
    }
    std::nth_element(beside.begin(), beside.begin() + static_cast<std::ptrdiff_t>(beside.size() / 2), beside.end());
    const double thickness = beside[beside.size() / 2];
    return joint.position + std::max(farthest - thickness, 0.5 * farthest) * direction;
  }

  /// The farthest place on the way to a tip that lies in the body, and not just below the surface.
  Vec3 pulled_inside(const Vec3& from, const Vec3& tip) const {
    for (double share = 1; share > 0.25; share -= 0.05) {
      Vec3 place = from + share * (tip - from);
      const std::array<Vec3, 1> places{place};
      if (probe_.winding_numbers(places, false)[0] < 0.5) continue;
      if (probe_.nearest(place).distance >= 0.1 * (tip - from).norm() * share ||
          probe_.nearest(place).distance >= kShortestTip * diagonal_)
        return place;
    }
    return from + 0.5 * (tip - from);
  }

  /// Where the bone of a joint without one below ends; its own place where it should not have one.
  Vec3 tip_of(int j) const {
    const Joint& joint = joints_[j];
    if (const int end = end_joint(j); end >= 0) return joints_[end].position;
    if (joint.vertices.empty()) return joint.position;
    Vec3 tip = tip_from_vertices(j);
    // Of joints in one place, one that moves the surface around another one's bone is a helper of that.
    for (int other = 0; other < count(); ++other) {
      if (other == j || joints_[other].group != joint.group) continue;
      for (const BoneIndex bone : bones_of_[other])
        if (direction_from(result_.skeleton, {bone, BoneEnd::kHead}).dot((tip - joint.position).normalized()) > 0.94)
          return joint.position;
    }
    return tip;
  }

  void add_tips() {
    for (int j = 0; j < count(); ++j) {
      const Joint& joint = joints_[j];
      if (!is_kept(j) || !bones_of_[j].empty() || joint.weight == 0) continue;
      Vec3 tip = tip_of(j);
      if ((tip - joint.position).norm() < kShortestTip * diagonal_) {
        if (joint.parent >= 0) continue;
        tip = joint.position + 0.25 * diagonal_ * Vec3::UnitY();
      }
      result_.skeleton.nodes.push_back(
          {free_name(joint.name + "_tip", node_names_), pulled_inside(joint.position, tip)});
      result_.node_joint.push_back(joint.node);
      add_bone(j, joint.group, static_cast<int>(result_.skeleton.nodes.size()) - 1, joint.name);
    }
  }

  /// The bones that move with a joint, or with the one that stands for it.
  std::vector<int> bones_for(int j) const {
    for (int at = j; at >= 0; at = joints_[at].merged_into >= 0 ? joints_[at].merged_into : joints_[at].parent) {
      if (!bones_of_[at].empty()) return bones_of_[at];
      if (joints_[at].merged_into >= 0 || joints_[at].group < 0) continue;
      for (int other = 0; other < count(); ++other)
        if (other != at && joints_[other].group == joints_[at].group && !bones_of_[other].empty())
          return bones_of_[other];
    }
    return {0};
  }

  void give_weights() {
    result_.bones_of_joint.resize(scene_.nodes.size());
    for (int j = 0; j < count(); ++j)
      if (joints_[j].weight > 0 && !result_.skeleton.bones.empty())
        result_.bones_of_joint[joints_[j].node] = bones_for(j);
  }

  void report() {
    std::vector<std::string> unneeded;
    for (const Joint& joint : joints_)
      if (!joint.is_needed) unneeded.push_back(joint.name);
    const auto list = [](const std::vector<std::string>& names) {
      std::vector<std::string> first(names.begin(), names.begin() + std::min<std::ptrdiff_t>(5, std::ssize(names)));
      return fmt::format("{}{}", fmt::join(first, ", "), names.size() > 5 ? ", ..." : "");
    };
    const auto joints = [](std::size_t count) { return fmt::format("{} joint{}", count, count == 1 ? "" : "s"); };
    if (!unneeded.empty())
      result_.notes.push_back(
          fmt::format("{} without a bone, as nothing moves with them: {}", joints(unneeded.size()), list(unneeded)));
    if (!merged_.empty())
      result_.notes.push_back(
          fmt::format("{} along a bone, merged into it: {}", joints(merged_.size()), list(merged_)));
    if (!joined_.empty())
      result_.notes.push_back(fmt::format("the skeleton has several roots; joined {}", list(joined_)));
  }

  const GltfScene& scene_;
  const GltfSurface& surface_;
  double diagonal_;
  SurfaceProbe probe_;
  std::vector<Joint> joints_;
  std::vector<int> joint_of_node_;
  std::vector<std::vector<int>> bones_of_;  ///< per joint
  std::set<std::string> bone_names_, node_names_;
  std::map<std::pair<int, int>, double> shared_;  ///< per two joints, the lesser weights of vertices that both move
  std::vector<std::string> merged_, joined_;
  int root_ = -1;
  JointSkeleton result_;
};

}  // namespace

JointSkeleton make_joint_skeleton(const GltfScene& scene, const GltfSurface& surface) {
  return SkeletonBuilder(scene, surface).build();
}

}  // namespace skeletex
