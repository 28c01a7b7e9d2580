// SPDX-License-Identifier: MIT
#pragma once
#include <array>
#include <vector>

#include "skeletex/skeleton/skeleton.h"

namespace skeletex {

/// The separation planes of a skeleton (paper 3.1) as they are seen from each bone: with unit directions d_j away from
/// node N, the separation plane between bones i and j holds the x with (x - N).(d_i - d_j) = 0, and the cell of bone i
/// holds the x with (x - N).d_i >= (x - N).d_j for all j: a spherical Voronoi cell.
class SeparationPlanes {
 public:
  explicit SeparationPlanes(const Skeleton& skeleton);

  const std::vector<BoneBasis>& bases() const { return bases_; }

  /// Slope k of the separation plane at one end of a bone at an angle (in turns): the line N + s'(turn) + x o meets the
  /// cell's boundary at x = k (the largest x over the separation planes at the head, the smallest at the tail). 0 at a
  /// free end.
  double slope(BoneIndex bone, BoneEnd end, double turn) const;
  /// The bone on the other side of the separation plane at that angle; -1 at a free end.
  BoneIndex neighbour(BoneIndex bone, BoneEnd end, double turn) const;
  bool is_free(BoneIndex bone, BoneEnd end) const { return normals_[bone][static_cast<int>(end)].empty(); }

  /// s'(turn): s turned about o by 2 pi turn.
  Vec3 radial(BoneIndex bone, double turn) const;
  /// Angle of a point about the bone's axis in turns, in [0,1).
  double turn_of(BoneIndex bone, const Vec3& offset_from_node) const;

  /// The point of a seam: at angle `turn` about the bone, in the separation plane at its `end`, at `distance` from the
  /// half-line that starts at the node and runs along the bone. Every bone that meets there gives the same point.
  Vec3 seam_point(BoneIndex bone, BoneEnd end, double turn, double distance) const;
  /// Distance from a point to the half-line that starts at the node at `end` and runs along the bone.
  double half_line_distance(BoneIndex bone, BoneEnd end, const Vec3& point) const;

 private:
  struct Neighbour {
    BoneIndex bone;
    Vec3 normal;  ///< d_i - d_j
  };
  const Skeleton* skeleton_;  // only read during construction and for node positions; must outlive this
  std::vector<BoneBasis> bases_;
  std::vector<std::array<std::vector<Neighbour>, 2>> normals_;
};

}  // namespace skeletex
