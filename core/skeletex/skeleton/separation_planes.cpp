// SPDX-License-Identifier: MIT
#include "skeletex/skeleton/separation_planes.h"

#include <Eigen/Geometry>
#include <cmath>
#include <numbers>

#include "skeletex/math/portable.h"

namespace skeletex {

SeparationPlanes::SeparationPlanes(const Skeleton& skeleton)
    : skeleton_(&skeleton), bases_(bone_bases(skeleton)), normals_(skeleton.bones.size()) {
  for (const auto& at_node : bones_at_nodes(skeleton))
    for (const BoneAtNode& i : at_node)
      for (const BoneAtNode& j : at_node)
        if (i.bone != j.bone)
          normals_[i.bone][static_cast<int>(i.end)].push_back(
              {j.bone, direction_from(skeleton, i) - direction_from(skeleton, j)});
}

Vec3 SeparationPlanes::radial(BoneIndex bone, double turn) const {
  const double angle = 2 * std::numbers::pi * turn;
  return portable::cos(angle) * bases_[bone].s + portable::sin(angle) * bases_[bone].b;
}

double SeparationPlanes::turn_of(BoneIndex bone, const Vec3& offset) const {
  const double turn = portable::atan2(offset.dot(bases_[bone].b), offset.dot(bases_[bone].s)) / (2 * std::numbers::pi);
  const double fraction = turn - std::floor(turn);
  return fraction < 1 ? fraction : 0;
}

namespace {

/// x of the separation plane with normal n at the radial direction; the separation plane's n.o is > 0 at the head and <
/// 0 at the tail.
double meet(const Vec3& normal, const Vec3& radial, const Vec3& o) { return -radial.dot(normal) / o.dot(normal); }

}  // namespace

double SeparationPlanes::slope(BoneIndex bone, BoneEnd end, double turn) const {
  const auto& neighbours = normals_[bone][static_cast<int>(end)];
  if (neighbours.empty()) return 0;
  const Vec3 direction = radial(bone, turn);
  double best = meet(neighbours[0].normal, direction, bases_[bone].o);
  for (const Neighbour& neighbour : neighbours) {
    const double x = meet(neighbour.normal, direction, bases_[bone].o);
    best = end == BoneEnd::kHead ? std::max(best, x) : std::min(best, x);
  }
  return best;
}

BoneIndex SeparationPlanes::neighbour(BoneIndex bone, BoneEnd end, double turn) const {
  const auto& neighbours = normals_[bone][static_cast<int>(end)];
  const Vec3 direction = radial(bone, turn);
  int found = -1;
  double best = 0;
  for (const Neighbour& neighbour : neighbours) {
    const double x = meet(neighbour.normal, direction, bases_[bone].o);
    if (found < 0 || (end == BoneEnd::kHead ? x > best : x < best)) {
      best = x;
      found = neighbour.bone;
    }
  }
  return found;
}

Vec3 SeparationPlanes::seam_point(BoneIndex bone, BoneEnd end, double turn, double distance) const {
  // With |s'| = 1 and s' orthogonal to o, sin(phi) = 1 / |s' + k o|, and phi < 90 degrees where k points into the bone.
  const double k = slope(bone, end, turn);
  const double length = std::hypot(1, k);
  const bool is_beside_bone = end == BoneEnd::kHead ? k > 0 : k < 0;
  const Vec3 f = (radial(bone, turn) + k * bases_[bone].o) / length;
  const double r = is_beside_bone ? distance * length : distance;
  return end_position(*skeleton_, bone, end) + r * f;
}

double SeparationPlanes::half_line_distance(BoneIndex bone, BoneEnd end, const Vec3& point) const {
  const Vec3 offset = point - end_position(*skeleton_, bone, end);
  const Vec3 direction = end == BoneEnd::kHead ? bases_[bone].o : Vec3(-bases_[bone].o);
  return (offset - std::max(0.0, offset.dot(direction)) * direction).norm();
}

}  // namespace skeletex
