// SPDX-License-Identifier: MIT
#include "skeletex/skeleton/skeleton.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <deque>

#include "skeletex/model/error.h"

namespace skeletex {

Skeleton in_unit_frame(Skeleton skeleton, const UnitFrame& frame) {
  for (Node& node : skeleton.nodes) node.position = frame.rounded_from_user(skeleton.frame.to_user(node.position));
  skeleton.frame = frame;
  return skeleton;
}

Skeleton in_frame(Skeleton skeleton, const UnitFrame& frame) {
  if (frame == skeleton.frame) return skeleton;
  for (Node& node : skeleton.nodes) node.position = frame.from_user(skeleton.frame.to_user(node.position));
  skeleton.frame = frame;
  return skeleton;
}

std::string text_of(const Skeleton& skeleton, const Vec3& point) { return text_of(skeleton.frame.to_user(point)); }

std::vector<std::vector<BoneAtNode>> bones_at_nodes(const Skeleton& skeleton) {
  std::vector<std::vector<BoneAtNode>> at(skeleton.nodes.size());
  for (int i = 0; i < static_cast<int>(skeleton.bones.size()); ++i) {
    at[skeleton.bones[i].head].push_back({i, BoneEnd::kHead});
    at[skeleton.bones[i].tail].push_back({i, BoneEnd::kTail});
  }
  return at;
}

NodeIndex end_node(const Skeleton& skeleton, BoneIndex bone, BoneEnd end) {
  return end == BoneEnd::kHead ? skeleton.bones[bone].head : skeleton.bones[bone].tail;
}

BoneEnd end_at(const Skeleton& skeleton, BoneIndex bone, NodeIndex node) {
  return skeleton.bones[bone].head == node ? BoneEnd::kHead : BoneEnd::kTail;
}

const Vec3& end_position(const Skeleton& skeleton, BoneIndex bone, BoneEnd end) {
  return skeleton.nodes[end_node(skeleton, bone, end)].position;
}

double bone_length(const Skeleton& skeleton, BoneIndex bone) {
  return (end_position(skeleton, bone, BoneEnd::kTail) - end_position(skeleton, bone, BoneEnd::kHead)).norm();
}

Vec3 direction_from(const Skeleton& skeleton, BoneAtNode at) {
  const Vec3 o =
      (end_position(skeleton, at.bone, BoneEnd::kTail) - end_position(skeleton, at.bone, BoneEnd::kHead)).normalized();
  return at.end == BoneEnd::kHead ? o : Vec3(-o);
}

void check_directions(const Skeleton& skeleton) {
  constexpr double kLeast = 1e-3;  // between the ends of two unit vectors
  const auto at_nodes = bones_at_nodes(skeleton);
  for (std::size_t n = 0; n < at_nodes.size(); ++n)
    for (std::size_t i = 0; i < at_nodes[n].size(); ++i)
      for (std::size_t j = i + 1; j < at_nodes[n].size(); ++j) {
        const BoneAtNode &a = at_nodes[n][i], &b = at_nodes[n][j];
        if ((direction_from(skeleton, a) - direction_from(skeleton, b)).norm() >= kLeast) continue;
        throw TopologyError(
            fmt::format("bones \"{}\" and \"{}\" leave node \"{}\" at {} in the same direction, so no plane separates "
                        "them; move the far end of one of them",
                        skeleton.bones[a.bone].name, skeleton.bones[b.bone].name, skeleton.nodes[n].name,
                        text_of(skeleton, skeleton.nodes[n].position)));
      }
}

Vec3 middle_of_nodes(const Skeleton& skeleton) {
  std::vector<Vec3> positions;
  for (const Node& node : skeleton.nodes) positions.push_back(node.position);
  return bounding_box(positions).centre();
}

double distance_to_bone(const Vec3& point, const Vec3& head, const Vec3& tail) {
  const Vec3 axis = tail - head;
  const double t = std::clamp((point - head).dot(axis) / axis.squaredNorm(), 0.0, 1.0);
  return (point - head - t * axis).norm();
}

namespace {

Vec3 least_aligned_axis(const Vec3& o) {
  Vec3::Index smallest;
  o.cwiseAbs().minCoeff(&smallest);
  return Vec3::Unit(smallest);
}

Vec3 orthonormalized(const Vec3& s, const Vec3& o) { return (s - o.dot(s) * o).normalized(); }

/// The bases of bones that give an s, and the axes of all.
/// \param is_known  out: which bones give one
std::vector<BoneBasis> given_bases(const Skeleton& skeleton, std::vector<bool>& is_known) {
  const int count = static_cast<int>(skeleton.bones.size());
  std::vector<BoneBasis> bases(count);
  is_known.assign(count, false);
  for (int i = 0; i < count; ++i) {
    const Vec3 axis = end_position(skeleton, i, BoneEnd::kTail) - end_position(skeleton, i, BoneEnd::kHead);
    if (!(axis.norm() > 0))
      throw InputError(fmt::format("bone \"{}\" has no length; move its head or its tail", skeleton.bones[i].name));
    bases[i].o = axis.normalized();
    if (!skeleton.bones[i].s) continue;
    const Vec3 s = *skeleton.bones[i].s;
    const Vec3 across = s - bases[i].o.dot(s) * bases[i].o;
    if (!(across.norm() > 1e-6 * s.norm()))
      throw InputError(fmt::format("bone \"{}\": its \"s\" is parallel to the bone; give a direction across it",
                                   skeleton.bones[i].name));
    bases[i].s = across.normalized();
    is_known[i] = true;
  }
  return bases;
}

/// The s of a bone, carried to another bone at its end by the reflection in the separation plane between them. The
/// reflection takes one direction away from the node to the other, and leaves what lies in the plane where it is.
Vec3 carried_s(const Skeleton& skeleton, const std::vector<BoneBasis>& bases, BoneAtNode from, BoneAtNode to) {
  const Vec3 n = direction_from(skeleton, from) - direction_from(skeleton, to);
  Vec3 s = bases[from.bone].s;
  if (n.squaredNorm() > 1e-24) s -= 2 * s.dot(n) / n.squaredNorm() * n;
  return orthonormalized(s, bases[to.bone].o);
}

}  // namespace

std::vector<BoneBasis> bone_bases(const Skeleton& skeleton) {
  std::vector<bool> is_known;
  std::vector<BoneBasis> bases = given_bases(skeleton, is_known);
  const int count = static_cast<int>(bases.size());
  const auto at = bones_at_nodes(skeleton);
  std::deque<int> queue;
  const auto add = [&](BoneIndex bone, const Vec3& s) {
    bases[bone].s = s;
    is_known[bone] = true;
    queue.push_back(bone);
  };
  const auto spread = [&] {
    while (!queue.empty()) {
      const int from = queue.front();
      queue.pop_front();
      for (const BoneEnd end : {BoneEnd::kTail, BoneEnd::kHead})
        for (const BoneAtNode to : at[end_node(skeleton, from, end)])
          if (!is_known[to.bone]) add(to.bone, carried_s(skeleton, bases, {from, end}, to));
    }
  };
  for (int i = 0; i < count; ++i)
    if (is_known[i]) queue.push_back(i);
  spread();
  for (int seed = 0; seed < count; ++seed) {
    if (is_known[seed]) continue;
    add(seed, orthonormalized(least_aligned_axis(bases[seed].o), bases[seed].o));
    spread();
  }
  for (BoneBasis& basis : bases) basis.b = basis.o.cross(basis.s);
  return bases;
}

}  // namespace skeletex
