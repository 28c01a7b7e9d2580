// SPDX-License-Identifier: MIT
#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>

#include "skeletex/analysis/findings.h"
#include "skeletex/geometry/union_find.h"
#include "skeletex/model/error.h"
#include "skeletex/skeleton/check_skeleton.h"

namespace skeletex {
namespace {

/// Unit directions that are nearer to each other count as the same: segment_mesh refuses them.
constexpr double kSameDirection = 1e-3;
constexpr double kSmallAngleDegrees = 5;

/// The component of each node; nodes without bones are their own.
std::vector<int> components_of(const Skeleton& skeleton) {
  UnionFind sets(static_cast<int>(skeleton.nodes.size()));
  for (const Bone& bone : skeleton.bones) sets.unite(bone.head, bone.tail);
  std::vector<int> component;
  for (int n = 0; n < static_cast<int>(skeleton.nodes.size()); ++n) component.push_back(sets.find(n));
  return component;
}

std::vector<bool> used_nodes(const Skeleton& skeleton) {
  std::vector<bool> is_used(skeleton.nodes.size(), false);
  for (const Bone& bone : skeleton.bones) is_used[bone.head] = is_used[bone.tail] = true;
  return is_used;
}

void find_parts(const Skeleton& skeleton, std::vector<Finding>& findings) {
  const std::vector<int> component = components_of(skeleton);
  std::map<int, std::vector<int>> bones;
  for (int b = 0; b < static_cast<int>(skeleton.bones.size()); ++b)
    bones[component[skeleton.bones[b].head]].push_back(b);
  if (bones.size() <= 1) return;
  std::string list;
  for (const auto& [root, some] : bones)
    list += fmt::format("{}{} bone{} with {}", list.empty() ? "" : ", ", some.size(), some.size() == 1 ? "" : "s",
                        name_of_bone(skeleton, some.front()));
  // The shortest way from the first part to another.
  double least = std::numeric_limits<double>::infinity();
  std::pair<int, int> nearest{0, 0};
  const std::vector<bool> is_used = used_nodes(skeleton);
  for (std::size_t i = 0; i < skeleton.nodes.size(); ++i)
    for (std::size_t j = 0; j < skeleton.nodes.size(); ++j) {
      if (!is_used[i] || !is_used[j] || component[i] != bones.begin()->first || component[j] == component[i]) continue;
      const double d = (skeleton.nodes[i].position - skeleton.nodes[j].position).norm();
      if (d < least) {
        least = d;
        nearest = {static_cast<int>(i), static_cast<int>(j)};
      }
    }
  findings.push_back(
      {Severity::kError, "connected", fmt::format("the skeleton falls into {} parts: {}", bones.size(), list),
       fmt::format("join them with bones, for example from {} to {}, which are {:.4g} apart",
                   name_of_node(skeleton, nearest.first), name_of_node(skeleton, nearest.second), least)});
}

void find_equal_places(const Skeleton& skeleton, double diagonal, std::vector<Finding>& findings) {
  for (int i = 0; i < static_cast<int>(skeleton.nodes.size()); ++i)
    for (int j = i + 1; j < static_cast<int>(skeleton.nodes.size()); ++j) {
      if ((skeleton.nodes[i].position - skeleton.nodes[j].position).norm() > kSamePlace * diagonal) continue;
      // Told as a bone of no length.
      if (std::any_of(skeleton.bones.begin(), skeleton.bones.end(),
                      [&](const Bone& b) { return (b.head == i && b.tail == j) || (b.head == j && b.tail == i); }))
        continue;
      findings.push_back({Severity::kError, "node-duplicate",
                          fmt::format("{} and {} lie in the same place, {}", name_of_node(skeleton, i),
                                      name_of_node(skeleton, j), text_of(skeleton.nodes[i].position)),
                          fmt::format("let the bones of {} end at {} and remove it, or move them apart",
                                      name_of_node(skeleton, j), name_of_node(skeleton, i))});
      findings.back().node = j;
      findings.back().position = skeleton.nodes[j].position;
    }
}

/// Where two segments are nearest to each other: shares of both, and the distance.
struct Approach {
  double first = 0, second = 0, distance = 0;
};

Approach nearest_of_segments(const Vec3& a, const Vec3& b, const Vec3& c, const Vec3& d) {
  const Vec3 u = b - a, v = d - c, w = a - c;
  const double uu = u.squaredNorm(), uv = u.dot(v), vv = v.squaredNorm(), uw = u.dot(w), vw = v.dot(w);
  const double determinant = uu * vv - uv * uv;
  double s = determinant > 1e-12 * uu * vv ? std::clamp((uv * vw - vv * uw) / determinant, 0.0, 1.0) : 0;
  const double t = std::clamp((uv * s + vw) / vv, 0.0, 1.0);
  s = std::clamp((uv * t - uw) / uu, 0.0, 1.0);
  return {s, t, (w + s * u - t * v).norm()};
}

bool have_same_nodes(const Bone& a, const Bone& b) {
  return (a.head == b.head && a.tail == b.tail) || (a.head == b.tail && a.tail == b.head);
}

/// Two bones that leave a node in about the same direction.
void find_equal_directions(const Skeleton& skeleton, BoneAtNode a, BoneAtNode b, std::vector<Finding>& findings) {
  const double apart = (direction_from(skeleton, a) - direction_from(skeleton, b)).norm();
  const double degrees = 2 * std::asin(std::min(1.0, apart / 2)) * 180 / std::numbers::pi;
  if (degrees >= kSmallAngleDegrees) return;
  const NodeIndex node = end_node(skeleton, a.bone, a.end);
  const bool is_error = apart < kSameDirection;
  const double shift = 2 * std::sin(kSmallAngleDegrees * std::numbers::pi / 360) * bone_length(skeleton, b.bone);
  findings.push_back(
      {is_error ? Severity::kError : Severity::kWarning, "bone-direction",
       fmt::format("{} and {} leave {} at {} in {} direction ({:.3g} degrees apart){}", name_of_bone(skeleton, a.bone),
                   name_of_bone(skeleton, b.bone), name_of_node(skeleton, node), text_of(skeleton.nodes[node].position),
                   is_error ? "the same" : "nearly the same", degrees,
                   is_error ? ", so that no separation plane separates them" : ""),
       fmt::format("move the far end of {} sideways by {:.3g} or more, or let it branch off further along",
                   name_of_bone(skeleton, b.bone), shift)});
  findings.back().bone = b.bone;
  findings.back().node = node;
  findings.back().position = skeleton.nodes[node].position;
}

/// Two bones without a common node that touch.
void find_contact(const Skeleton& skeleton, int i, int j, double diagonal, std::vector<Finding>& findings) {
  const Vec3 &head = end_position(skeleton, i, BoneEnd::kHead), &tail = end_position(skeleton, i, BoneEnd::kTail);
  const Approach near = nearest_of_segments(head, tail, end_position(skeleton, j, BoneEnd::kHead),
                                            end_position(skeleton, j, BoneEnd::kTail));
  const double lengths = bone_length(skeleton, i) + bone_length(skeleton, j);
  const auto is_at_end = [&](double share, BoneIndex bone) {
    return std::min(share, 1 - share) * bone_length(skeleton, bone) <= kSamePlace * diagonal;
  };
  if (near.distance > 1e-6 * lengths || (is_at_end(near.first, i) && is_at_end(near.second, j))) return;
  findings.push_back({Severity::kError, "bone-contact",
                      fmt::format("{} and {} meet at {} without a node there", name_of_bone(skeleton, i),
                                  name_of_bone(skeleton, j), text_of(head + near.first * (tail - head))),
                      "split the bones there, so that they share a node, or move them apart"});
  findings.back().bone = j;
  findings.back().position = head + near.first * (tail - head);
}

void find_between_bones(const Skeleton& skeleton, const std::vector<bool>& has_length, double diagonal,
                        std::vector<Finding>& findings) {
  const int count = static_cast<int>(skeleton.bones.size());
  for (int i = 0; i < count; ++i)
    for (int j = i + 1; j < count; ++j) {
      if (!has_length[i] || !has_length[j]) continue;
      const Bone &a = skeleton.bones[i], &b = skeleton.bones[j];
      if (have_same_nodes(a, b)) {
        findings.push_back(
            {Severity::kError, "bone-duplicate",
             fmt::format("{} and {} both run between {} and {}, on the same straight line", name_of_bone(skeleton, i),
                         name_of_bone(skeleton, j), name_of_node(skeleton, a.head), name_of_node(skeleton, a.tail)),
             "remove one of them; for a ring of bones give one a node on its way, around the hole"});
        findings.back().bone = j;
        continue;
      }
      bool has_common_node = false;
      for (const BoneEnd end_a : {BoneEnd::kHead, BoneEnd::kTail})
        for (const BoneEnd end_b : {BoneEnd::kHead, BoneEnd::kTail})
          if (end_node(skeleton, i, end_a) == end_node(skeleton, j, end_b)) {
            has_common_node = true;
            find_equal_directions(skeleton, {i, end_a}, {j, end_b}, findings);
          }
      if (!has_common_node) find_contact(skeleton, i, j, diagonal, findings);
    }
}

/// Indices and positions that cannot be used.
/// \return whether there are none
bool find_unusable(const Skeleton& skeleton, std::vector<Finding>& findings) {
  const int node_count = static_cast<int>(skeleton.nodes.size());
  const std::size_t before = findings.size();
  for (int b = 0; b < static_cast<int>(skeleton.bones.size()); ++b)
    for (const int n : {skeleton.bones[b].head, skeleton.bones[b].tail})
      if (n < 0 || n >= node_count) {
        findings.push_back(
            {Severity::kError, "bone-node",
             fmt::format("{} ends at node {}, and there are {} nodes", name_of_bone(skeleton, b), n, node_count),
             "let it end at a node that exists"});
        findings.back().bone = b;
      }
  for (int n = 0; n < node_count; ++n)
    if (!skeleton.nodes[n].position.allFinite()) {
      findings.push_back(
          {Severity::kError, "finite",
           fmt::format("{} has no finite position: {}", name_of_node(skeleton, n), text_of(skeleton.nodes[n].position)),
           "give it three finite numbers"});
      findings.back().node = n;
    }
  return findings.size() == before;
}

/// Bones by themselves.
/// \return whether each has a length
std::vector<bool> find_in_bones(const Skeleton& skeleton, double diagonal, std::vector<Finding>& findings) {
  std::vector<bool> has_length(skeleton.bones.size());
  for (int b = 0; b < static_cast<int>(skeleton.bones.size()); ++b) {
    const Bone& bone = skeleton.bones[b];
    has_length[b] = bone_length(skeleton, b) > kSamePlace * diagonal;
    if (!has_length[b]) {
      const std::string what =
          bone.head == bone.tail
              ? fmt::format("{} begins and ends at {}", name_of_bone(skeleton, b), name_of_node(skeleton, bone.head))
              : fmt::format("{} has no length: {} and {} lie in the same place, {}", name_of_bone(skeleton, b),
                            name_of_node(skeleton, bone.head), name_of_node(skeleton, bone.tail),
                            text_of(skeleton.nodes[bone.head].position));
      findings.push_back({Severity::kError, "bone-length", what,
                          "move one of its ends, or remove the bone and let its neighbours share a node"});
      findings.back().bone = b;
      findings.back().position = skeleton.nodes[bone.head].position;
      continue;
    }
    if (!bone.s) continue;
    const Vec3 o = direction_from(skeleton, {b, BoneEnd::kHead}), s = *bone.s;
    if (!s.allFinite() || !((s - o.dot(s) * o).norm() > 1e-6 * s.norm())) {
      findings.push_back(
          {Severity::kError, "bone-angle",
           fmt::format("{}: its \"s\" {} gives no direction across the bone", name_of_bone(skeleton, b), text_of(s)),
           "give a direction across the bone, or leave \"s\" out"});
      findings.back().bone = b;
    }
  }
  return has_length;
}

void find_unused_nodes(const Skeleton& skeleton, std::vector<Finding>& findings) {
  const std::vector<bool> is_used = used_nodes(skeleton);
  for (int n = 0; n < static_cast<int>(skeleton.nodes.size()); ++n)
    if (!is_used[n]) {
      findings.push_back({Severity::kWarning, "node-unused",
                          fmt::format("{} at {} is the end of no bone", name_of_node(skeleton, n),
                                      text_of(skeleton.nodes[n].position)),
                          "remove it, or give it a bone; it is ignored"});
      findings.back().node = n;
      findings.back().position = skeleton.nodes[n].position;
    }
}

}  // namespace

std::string name_of_node(const Skeleton& skeleton, NodeIndex n) {
  const std::string& name = skeleton.nodes[n].name;
  return name.empty() ? fmt::format("node {}", n) : fmt::format("node \"{}\"", name);
}

std::string name_of_bone(const Skeleton& skeleton, BoneIndex b) {
  const std::string& name = skeleton.bones[b].name;
  return name.empty() ? fmt::format("bone {}", b) : fmt::format("bone \"{}\"", name);
}

std::string text_of_distance(double distance, double diagonal) {
  const double percent = diagonal > 0 ? 100 * distance / diagonal : 0;
  const std::string share = percent < 10 ? fmt::format("{:.2g}", percent) : fmt::format("{:.0f}", percent);
  return fmt::format("{:.4g} ({} % of the diagonal)", distance, share);
}

int count_cycles(const Skeleton& skeleton) {
  const std::vector<int> component = components_of(skeleton);
  const std::vector<bool> is_used = used_nodes(skeleton);
  int nodes = 0, parts = 0;
  for (int n = 0; n < static_cast<int>(skeleton.nodes.size()); ++n) {
    nodes += is_used[n];
    parts += is_used[n] && component[n] == n;
  }
  return static_cast<int>(skeleton.bones.size()) - nodes + parts;
}

bool find_in_skeleton(const Skeleton& skeleton, double diagonal, std::vector<Finding>& findings) {
  if (skeleton.bones.empty()) {
    findings.push_back({Severity::kError, "empty", "the skeleton has no bones", "give it at least one"});
    return false;
  }
  try {
    check_size(skeleton.nodes.size(), skeleton.bones.size());
  } catch (const InputError& error) {
    findings.push_back({Severity::kError, "size", error.what(), "take a coarser skeleton"});
    return false;
  }
  if (!find_unusable(skeleton, findings)) return false;
  double unit = diagonal;
  if (!(unit > 0))
    for (const Node& node : skeleton.nodes)
      unit = std::max(unit, (node.position - skeleton.nodes.front().position).norm());
  const std::vector<bool> has_length = find_in_bones(skeleton, unit, findings);
  find_unused_nodes(skeleton, findings);
  find_parts(skeleton, findings);
  find_equal_places(skeleton, unit, findings);
  find_between_bones(skeleton, has_length, unit, findings);
  return true;
}

}  // namespace skeletex
