// SPDX-License-Identifier: MIT
#pragma once
#include <array>
#include <vector>

#include "skeletex/model/texture.h"
#include "skeletex/skeleton/separation_planes.h"

namespace skeletex {

/// What a pose keeps of a texel.
enum class DistanceRule {
  kFromBone,  ///< its distance to the bone segment (paper 3.6.1)
  kFromFoot,  ///< its distance to its foot, as in the bind pose: nothing is restored (Figure 10, left)
};

/// How the separation planes of a model meet a bone in a pose, at one of its ends and one bind angle.
struct PosedRadial {
  double roll = 0;   ///< turns, to be added to the bind angle; 0 at a free end
  double slope = 0;  ///< of the separation plane there, at the rolled angle (see SeparationPlanes::slope)
};

/// Where an arc around a bone's end begins, and what holds along it. The slope of the arc's separation plane in the
/// pose is slope_s cos a + slope_b sin a at angle a about the posed bone.
struct PosedBound {
  double turn = 0;      ///< angle in the bind pose, turns
  double roll = 0;      ///< turns, to be added to the angle where the arc begins
  double end_roll = 0;  ///< the same where it ends; rolls are linear in between
  double slope_s = 0, slope_b = 0;
};

/// The seams of a model in a pose (paper 3.3 and 3.4.1). On the sphere around a node, corners are directions, arcs are
/// curves between them, and the end of every bone is the loop of arcs around it. In the bind pose this is the Voronoi
/// diagram of the bones' directions. In a pose
///   - a corner is equally far from the same three bones, on the side that continues the bind pose's,
///   - an arc stays in the separation plane of its two bones and runs between its corners; angles move linearly along
///     it, so that both bones see the same,
///   - the separation plane of a node with two bones is one closed curve, and both bones turn by half of the twist.
/// At a node of three bones every arc is half a turn in every pose. At one of more, directions can move so far that two
/// corners pass each other. The arc between them then runs backwards, and the surface overlaps itself there; distances
/// still hold, and seams stay closed.
class PosedPlanes {
 public:
  /// \param model  its skeleton is the bind pose; texels are not looked at. Must outlive this
  /// \param posed  the same skeleton in a pose, every bone with its s (see apply_pose). Must outlive this
  PosedPlanes(const SkeletexModel& model, const Skeleton& posed);

  const Skeleton& skeleton() const { return *posed_; }
  const std::vector<BoneBasis>& bases() const { return bases_; }

  /// \param turn  angle about the bone in the bind pose, turns
  PosedRadial radial(BoneIndex bone, BoneEnd end, double turn) const;
  /// Where the arcs at an end begin, in the order of SkeletexModel::ends; angles grow by less than a turn in all, rolls
  /// run on from arc to arc. A closed arc begins anywhere. Empty at a free end.
  std::vector<PosedBound> bounds(BoneIndex bone, BoneEnd end) const;

  /// Length of the longest bone at a node, in the bind pose and in this one; world units. All bones there count as this
  /// long where they meet, so that they restore distances alike.
  double bind_longest_at(NodeIndex node) const { return bind_longest_[node]; }
  double longest_at(NodeIndex node) const { return longest_[node]; }

  /// Points of the seams, world. Every bone at a seam gives the same point; `side` chooses the one to compute it from.
  Vec3 sample_point(ArcIndex arc, int sample, DistanceRule rule, int side = 0) const;
  Vec3 corner_point(int corner, DistanceRule rule) const;

 private:
  /// An arc as one of its bones sees it. Parameter t runs along the arc from its first corner (0) to its last (1).
  struct Side {
    BoneIndex bone;
    BoneEnd end = BoneEnd::kHead;
    double sign = 1;                    ///< +1: v grows with t, -1: it falls
    double begin = 0;                   ///< bind angle at t = 0, turns
    std::array<double, 2> rolls{0, 0};  ///< at t = 0 and 1, turns
  };
  struct Arc {
    bool is_closed = false;
    double bind_turns = 1, posed_turns = 1;  ///< length; negative: its corners have passed each other
    std::array<Side, 2> sides;
    Vec3 bind_normal = Vec3::Zero(),
         normal = Vec3::Zero();  ///< of the separation plane, unit, from bones[1] to bones[0]
  };
  /// One bone's end: the loop of arcs around it.
  struct Interval {
    double start = 0;  ///< bind angle from the loop's base, growing
    ArcIndex arc;
    int side = 0;
  };
  struct Loop {
    double base = 0;
    std::vector<Interval> intervals;
  };

  /// The directions of the bones at a node, and what is drawn on the sphere around it.
  struct NodeSphere {
    std::vector<int> arcs, corners;  ///< their numbers
    std::vector<Vec3> bind, posed;   ///< directions of the bones there
    std::vector<int> place_of;       ///< per bone its place in bind and posed; -1 for others
  };
  /// A corner lies on the axis that is equally far from three bones.
  struct Triple {
    std::array<int, 3> bones{0, 0, 0};  ///< places in NodeSphere
    double sign = 1;                    ///< side of the axis
  };

  void join_linear(Arc& arc);
  NodeSphere sphere_of(NodeIndex node, const std::vector<int>& arcs) const;
  Triple triple_of(const NodeSphere& sphere, int corner) const;
  void track_arcs(const NodeSphere& sphere, const std::vector<Triple>& triples);
  void build_node(NodeIndex node, const std::vector<int>& arcs);
  void wind_loop(BoneIndex bone, BoneEnd end);
  const Interval* interval_at(BoneIndex bone, BoneEnd end, double turn, double& t) const;
  PosedRadial radial_on(const Arc& arc, int side, double t, double turn) const;
  double radius_at(NodeIndex node, BoneIndex bone, double distance, const Vec3& bind_direction, const Vec3& direction,
                   DistanceRule rule) const;
  Vec3 bind_direction(BoneIndex bone, NodeIndex node) const;
  Vec3 posed_direction(BoneIndex bone, NodeIndex node) const;

  const SkeletexModel* model_;
  const Skeleton* posed_;
  std::vector<BoneBasis> bind_bases_, bases_;
  std::vector<double> bind_longest_, longest_;  ///< length of a bone, per node
  std::vector<Arc> arcs_;
  std::vector<Vec3> bind_corners_, corners_;  ///< unit directions from their node
  std::vector<std::array<Loop, 2>> loops_;    ///< per bone and end
};

}  // namespace skeletex
