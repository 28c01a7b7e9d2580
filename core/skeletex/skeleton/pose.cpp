// SPDX-License-Identifier: MIT
#include "skeletex/skeleton/pose.h"

#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <deque>
#include <numbers>
#include <random>

#include "skeletex/geometry/best_rotation.h"
#include "skeletex/model/error.h"
#include "skeletex/skeleton/separation_planes.h"

namespace skeletex {
namespace {

using Eigen::Matrix3d;
using Eigen::Quaterniond;

/// One bone of the breadth-first order from a root, and the bone that it hangs on.
struct Link {
  BoneIndex bone;
  int before;     ///< -1 at the root
  BoneEnd pivot;  ///< its end nearer to the root
  int depth;      ///< 0 at the root
  bool closes_cycle = false;
};

struct Component {
  std::vector<Link> links;  ///< every bone once
  int nodes = 1;
  bool has_cycle = false;  ///< else a tree
};

int other_end(const Skeleton& skeleton, BoneAtNode at) { return end_node(skeleton, at.bone, opposite(at.end)); }

Component walk_from(const Skeleton& skeleton, const std::vector<std::vector<BoneAtNode>>& at, int root) {
  Component component;
  std::vector<int> entry(skeleton.nodes.size(), -2),
      depth(skeleton.nodes.size(), 0);  // the bone by which a node was reached
  std::vector<bool> is_done(skeleton.bones.size(), false);
  std::deque<int> queue{root};
  entry[root] = -1;
  while (!queue.empty()) {
    const NodeIndex node = queue.front();
    queue.pop_front();
    for (const BoneAtNode bone : at[node]) {
      if (is_done[bone.bone]) continue;
      is_done[bone.bone] = true;
      const int next = other_end(skeleton, bone);
      const bool closes_cycle = entry[next] != -2;
      component.links.push_back({bone.bone, entry[node], bone.end, depth[node], closes_cycle});
      if (closes_cycle) {
        component.has_cycle = true;
        continue;
      }
      ++component.nodes;
      entry[next] = bone.bone;
      depth[next] = depth[node] + 1;
      queue.push_back(next);
    }
  }
  return component;
}

Quaterniond smallest_rotation(const Vec3& from, const Vec3& to) {
  return Quaterniond::FromTwoVectors(from, to).normalized();
}

Vec3 bone_direction(const Skeleton& skeleton, BoneIndex bone) {
  return direction_from(skeleton, {bone, BoneEnd::kHead});
}

void check_lengths(const Skeleton& posed) {
  for (BoneIndex bone = 0; bone < static_cast<int>(posed.bones.size()); ++bone)
    if (!(bone_length(posed, bone) > 0) || !std::isfinite(bone_length(posed, bone)))
      throw InputError(fmt::format("in this pose bone \"{}\" has no length; move node \"{}\" away from node \"{}\"",
                                   posed.bones[bone].name, posed.nodes[posed.bones[bone].tail].name,
                                   posed.nodes[posed.bones[bone].head].name));
}

/// The node of a tree with the shortest ways to all others, in length along bones; unlike the hierarchy's root it does
/// not depend on which ends of the bones are heads.
int central_node(const Skeleton& bind, const std::vector<std::vector<BoneAtNode>>& at, int start) {
  const Component component = walk_from(bind, at, start);
  std::vector<NodeIndex> nodes{start};
  for (const Link& link : component.links) nodes.push_back(other_end(bind, {link.bone, link.pivot}));
  std::sort(nodes.begin(), nodes.end());
  int best = -1;
  double shortest = 0;
  std::vector<double> way(bind.nodes.size());
  for (const NodeIndex node : nodes) {
    way[node] = 0;
    double sum = 0;
    for (const Link& link : walk_from(bind, at, node).links) {
      const int end = other_end(bind, {link.bone, link.pivot});
      way[end] = way[end_node(bind, link.bone, link.pivot)] + bone_length(bind, link.bone);
      sum += way[end];
    }
    if (best < 0 || sum < (1 - 1e-9) * shortest) best = node, shortest = sum;
  }
  return best;
}

/// Rotations of a tree's bones that follow its nodes.
void follow_nodes(const Skeleton& bind, const Skeleton& posed, const Component& component,
                  std::vector<Quaterniond>& rotations) {
  Matrix3d moment = Matrix3d::Zero();
  for (const Link& link : component.links)
    moment +=
        std::pow(0.1, link.depth) * bone_direction(posed, link.bone) * bone_direction(bind, link.bone).transpose();
  const Quaterniond root(best_rotation(moment));
  for (const Link& link : component.links) {
    const Quaterniond before = link.before < 0 ? root : rotations[link.before];
    rotations[link.bone] =
        smallest_rotation(before * bone_direction(bind, link.bone), bone_direction(posed, link.bone)) * before;
  }
}

/// Turn about bone j at which bone i's s arrives through the separation plane between them: v_j = sigma v_i + offset.
double plane_offset(const std::vector<BoneBasis>& bases, BoneAtNode i, BoneAtNode j) {
  const Vec3 d_i = i.end == BoneEnd::kHead ? bases[i.bone].o : Vec3(-bases[i.bone].o);
  const Vec3 d_j = j.end == BoneEnd::kHead ? bases[j.bone].o : Vec3(-bases[j.bone].o);
  const Vec3 n = d_i - d_j;
  Vec3 s = bases[i.bone].s;
  if (n.squaredNorm() > 1e-24) s -= 2 * s.dot(n) / n.squaredNorm() * n;
  return std::atan2(s.dot(bases[j.bone].b), s.dot(bases[j.bone].s));
}

/// The same for a component with cycles.
void spread_twist(const Skeleton& bind, const Skeleton& posed, const std::vector<std::vector<BoneAtNode>>& at,
                  const Component& component, std::vector<Quaterniond>& rotations) {
  Matrix3d moment = Matrix3d::Zero();
  for (const Link& link : component.links)
    moment += bone_direction(posed, link.bone) * bone_direction(bind, link.bone).transpose();
  const Quaterniond fit(best_rotation(moment));
  const std::vector<BoneBasis> bound = bone_bases(bind);
  std::vector<BoneBasis> turned = bound;
  std::vector<int> place(bind.bones.size(), -1);
  for (std::size_t i = 0; i < component.links.size(); ++i) {
    const BoneIndex bone = component.links[i].bone;
    place[bone] = static_cast<int>(i);
    rotations[bone] = smallest_rotation(fit * bone_direction(bind, bone), bone_direction(posed, bone)) * fit;
    turned[bone] = {bone_direction(posed, bone), rotations[bone] * bound[bone].s, rotations[bone] * bound[bone].b};
  }
  // Least squares over the joints: roll_j - sigma roll_i = twist; the small diagonal keeps a turn that no joint sees
  // (all bones of a ring about themselves) at zero.
  const auto count = static_cast<Eigen::Index>(component.links.size());
  Eigen::MatrixXd normal = 1e-6 * Eigen::MatrixXd::Identity(count, count);
  Eigen::VectorXd right = Eigen::VectorXd::Zero(count);
  for (const auto& at_node : at)
    for (std::size_t a = 0; a < at_node.size(); ++a)
      for (std::size_t b = a + 1; b < at_node.size(); ++b) {
        const int i = place[at_node[a].bone], j = place[at_node[b].bone];
        if (i < 0 || j < 0) continue;
        const double sigma = at_node[a].end == at_node[b].end ? -1 : 1;
        const double twist =
            std::remainder(plane_offset(turned, at_node[a], at_node[b]) - plane_offset(bound, at_node[a], at_node[b]),
                           2 * std::numbers::pi);
        normal(i, i) += 1, normal(j, j) += 1;
        normal(i, j) -= sigma, normal(j, i) -= sigma;
        right[j] += twist;
        right[i] -= sigma * twist;
      }
  const Eigen::VectorXd rolls = normal.ldlt().solve(right);
  for (std::size_t i = 0; i < component.links.size(); ++i) {
    const BoneIndex bone = component.links[i].bone;
    rotations[bone] =
        Quaterniond(Eigen::AngleAxisd(rolls[static_cast<Eigen::Index>(i)], turned[bone].o)) * rotations[bone];
  }
}

/// Turns the bones of a hierarchy, each about its end nearer to the root and together with all behind it. Bones of a
/// cycle all follow the bone before it, so that it stays closed.
/// \throw InputError when a bone of a cycle is to be turned
void turn_bones(const Skeleton& bind, const Pose& pose, const Component& component,
                const std::vector<bool>& is_in_cycle, Skeleton& posed, std::vector<Quaterniond>& rotations) {
  for (const Link& link : component.links) {
    if (is_in_cycle[link.bone] && !pose.rotations[link.bone].isApprox(Quaterniond::Identity(), 0))
      throw InputError(
          fmt::format("bone \"{}\" cannot be turned, as it is in a cycle of bones; turn bones outside of it, or give "
                      "node positions",
                      bind.bones[link.bone].name));
    rotations[link.bone] =
        ((link.before < 0 ? Quaterniond::Identity() : rotations[link.before]) * pose.rotations[link.bone]).normalized();
    if (link.closes_cycle) continue;
    const int pivot = end_node(bind, link.bone, link.pivot), moved = other_end(bind, {link.bone, link.pivot});
    posed.nodes[moved].position =
        posed.nodes[pivot].position + rotations[link.bone] * (bind.nodes[moved].position - bind.nodes[pivot].position);
  }
}

template <class T>
void check_size(const std::vector<T>& values, std::size_t size, const char* what) {
  if (!values.empty() && values.size() != size)
    throw InputError(fmt::format("the pose has {} {}, the skeleton {}; it was made for another skeleton", values.size(),
                                 what, size));
}

}  // namespace

std::vector<int> root_nodes(const Skeleton& skeleton) {
  const auto at = bones_at_nodes(skeleton);
  const int count = static_cast<int>(skeleton.nodes.size());
  std::vector<int> best(count, -1), component(count, -1), roots;
  std::vector<std::size_t> most;
  for (NodeIndex node = 0; node < count; ++node) {
    const Component walk = walk_from(skeleton, at, node);
    std::size_t away = 0;
    for (const Link& link : walk.links) away += link.pivot == BoneEnd::kHead;
    if (component[node] < 0) {
      component[node] = static_cast<int>(roots.size());
      for (const Link& link : walk.links)
        component[skeleton.bones[link.bone].head] = component[skeleton.bones[link.bone].tail] = component[node];
      roots.push_back(node);
      most.push_back(away);
    } else if (away > most[component[node]]) {
      roots[component[node]] = node;
      most[component[node]] = away;
    }
  }
  return roots;
}

std::vector<bool> bones_in_cycles(const Skeleton& skeleton) {
  const auto at = bones_at_nodes(skeleton);
  std::vector<bool> is_in_cycle;
  for (int without = 0; without < static_cast<int>(skeleton.bones.size()); ++without) {
    std::vector<bool> is_reached(skeleton.nodes.size(), false);
    std::vector<int> queue{skeleton.bones[without].head};
    is_reached[queue[0]] = true;
    for (std::size_t i = 0; i < queue.size(); ++i)
      for (const BoneAtNode bone : at[queue[i]]) {
        const int next = other_end(skeleton, bone);
        if (bone.bone == without || is_reached[next]) continue;
        is_reached[next] = true;
        queue.push_back(next);
      }
    is_in_cycle.push_back(is_reached[skeleton.bones[without].tail]);
  }
  return is_in_cycle;
}

Skeleton apply_pose(const Skeleton& bind, const Pose& pose) {
  check_size(pose.rotations, bind.bones.size(), "rotations");
  check_size(pose.nodes, bind.nodes.size(), "nodes");
  check_size(pose.rolls, bind.bones.size(), "rolls");
  if (!pose.rotations.empty() && !pose.nodes.empty())
    throw InputError("a pose either turns bones or moves nodes, not both");
  if (pose.translation != Vec3::Zero() && !pose.nodes.empty())
    throw InputError("a pose either moves the whole skeleton or places its nodes, not both");

  Skeleton posed = bind;
  std::vector<Quaterniond> rotations(bind.bones.size(), Quaterniond::Identity());
  const auto at = bones_at_nodes(bind);
  if (!pose.nodes.empty()) {
    for (std::size_t i = 0; i < posed.nodes.size(); ++i) posed.nodes[i].position = pose.nodes[i];
    check_lengths(posed);
    for (const int root : root_nodes(bind)) {
      const Component component = walk_from(bind, at, root);
      if (!component.has_cycle)
        follow_nodes(bind, posed, walk_from(bind, at, central_node(bind, at, root)), rotations);
      else
        spread_twist(bind, posed, at, component, rotations);
    }
  } else if (!pose.rotations.empty()) {
    const std::vector<bool> is_in_cycle = bones_in_cycles(bind);
    for (const int root : root_nodes(bind))
      turn_bones(bind, pose, walk_from(bind, at, root), is_in_cycle, posed, rotations);
  }
  for (Node& node : posed.nodes) node.position += pose.translation;
  const std::vector<BoneBasis> bases = bone_bases(bind);
  for (std::size_t i = 0; i < bind.bones.size(); ++i) {
    Vec3 s = rotations[i] * bases[i].s;
    if (!pose.rolls.empty() && pose.rolls[i] != 0)
      s = Eigen::AngleAxisd(pose.rolls[i], bone_direction(posed, static_cast<int>(i))) * s;
    posed.bones[i].s = s;
  }
  return posed;
}

Pose make_random_pose(const Skeleton& skeleton, double largest, std::uint64_t seed) {
  const std::vector<bool> is_in_cycle = bones_in_cycles(skeleton);
  if (std::find(is_in_cycle.begin(), is_in_cycle.end(), false) == is_in_cycle.end())
    throw InputError("all bones of the skeleton are in cycles, so none can be turned");
  std::mt19937_64 random(seed);
  // The library's distributions differ from system to system: 53 bits in [0, 1).
  const auto uniform = [&] { return static_cast<double>(random() >> 11) * 0x1p-53; };
  const std::vector<int> roots = root_nodes(skeleton);
  const auto is_root = [&](NodeIndex node) { return std::find(roots.begin(), roots.end(), node) != roots.end(); };
  Pose pose;
  for (std::size_t i = 0; i < skeleton.bones.size(); ++i) {
    const Bone& bone = skeleton.bones[i];
    const double z = 2 * uniform() - 1, around = 2 * std::numbers::pi * uniform(), angle = largest * uniform();
    const double radius = std::sqrt(std::max(0.0, 1 - z * z));
    const bool is_still = is_in_cycle[i] || is_root(bone.head) || is_root(bone.tail);
    pose.rotations.push_back(is_still ? Quaterniond::Identity()
                                      : Quaterniond(Eigen::AngleAxisd(
                                            angle, Vec3(radius * std::cos(around), radius * std::sin(around), z))));
  }
  return pose;
}

Pose pose_at(const Skeleton& bind, const PoseAnimation& animation, double time) {
  if (animation.frames.empty()) throw InputError("the animation has no frames");
  const auto after = std::find_if(animation.frames.begin(), animation.frames.end(),
                                  [&](const PoseFrame& frame) { return frame.time >= time; });
  if (after == animation.frames.begin()) return after->pose;
  if (after == animation.frames.end()) return animation.frames.back().pose;
  const PoseFrame &a = *(after - 1), &b = *after;
  const double t = (time - a.time) / (b.time - a.time);
  const auto turns = [](const Pose& pose) { return !pose.rotations.empty() || pose.translation != Vec3::Zero(); };
  if ((turns(a.pose) && !b.pose.nodes.empty()) || (!a.pose.nodes.empty() && turns(b.pose)))
    throw InputError(
        fmt::format("the frames at {} and {} do not mix: one turns bones, the other moves nodes", a.time, b.time));
  Pose pose;
  pose.translation = (1 - t) * a.pose.translation + t * b.pose.translation;
  const auto blend = [&](const auto& from, const auto& to, auto& result, const auto& bound, const auto& between) {
    if (from.empty() && to.empty()) return;
    for (std::size_t i = 0; i < std::max(from.size(), to.size()); ++i)
      result.push_back(between(from.empty() ? bound(i) : from[i], to.empty() ? bound(i) : to[i]));
  };
  blend(
      a.pose.rotations, b.pose.rotations, pose.rotations, [](std::size_t) { return Quaterniond::Identity(); },
      [&](const Quaterniond& p, const Quaterniond& q) { return p.slerp(t, q); });
  blend(
      a.pose.nodes, b.pose.nodes, pose.nodes, [&](std::size_t i) { return bind.nodes[i].position; },
      [&](const Vec3& p, const Vec3& q) -> Vec3 { return (1 - t) * p + t * q; });
  blend(
      a.pose.rolls, b.pose.rolls, pose.rolls, [](std::size_t) { return 0.0; },
      [&](double p, double q) { return (1 - t) * p + t * q; });
  return pose;
}

}  // namespace skeletex
