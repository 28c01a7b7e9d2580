// SPDX-License-Identifier: MIT
#pragma once
#include <cstdint>
#include <limits>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "skeletex/analysis/bone_margin.h"
#include "skeletex/skeletonize/body/surface.h"
#include "skeletex/skeletonize/limbs.h"

namespace skeletex {

/// Numbers that look random and are the same on every machine (splitmix64, Steele et al. 2014).
class RandomNumbers {
 public:
  explicit RandomNumbers(std::uint64_t seed) : state_(seed) {}
  double uniform();  ///< in [0, 1)
  Vec3 in_ball(double radius);

 private:
  std::uint64_t state_;
};

/// A skeleton that is being changed so that no separation planes cross inside the body. Its nodes and bones are inside
/// at the beginning and stay so. Bones and nodes keep their names.
class Repair {
 public:
  /// \param original  nodes of the same names stay near their places in it
  Repair(const Surface& surface, Skeleton skeleton, const Skeleton& original = {});

  /// Moves the nodes around the bone of the least margin, over and over; contracts it where that does not help, unless
  /// it may not.
  /// \return whether all margins are enough now, or so nearly that the segmentation may accept them
  bool run(bool may_contract = true);
  /// Moves a node to a place near by that costs little, whatever the margins are: for what the margins do not see.
  void shake(NodeIndex node);
  /// Takes a bone away: its ends become one node, or an end between two bones is left out. Where that is not possible,
  /// a bone next to it, else a free end.
  /// \return whether a bone went
  bool contract(BoneIndex bone);
  /// Puts a new node on a bone, unless margins would not be enough any more. Both parts of the bone have its name.
  /// \return whether it was put there
  bool split(BoneIndex bone, const Vec3& place, const std::string& name);
  /// Takes a node between two bones away, which become one, unless margins would not be enough any more.
  /// \return whether it went
  bool straighten(NodeIndex node);
  /// Takes the bones of a limb away, and its nodes but the first.
  void drop(const SkeletonLimb& limb);
  /// The bone whose loss does the least to margins and shape.
  bool contract_cheapest();
  /// Contracts the cheapest bones as long as all margins stay enough.
  void thin_out();

  /// Takes limbs that are hardly any away where they crowd a node, as the bones of a face do, until its margins gain
  /// little by it.
  void drop_minor_limbs();

  /// Moves all nodes at once, down the gradient of what margins lack, and contracts bones near the worst one as long as
  /// that helps. What is left is for run(), which looks at one bone after the other.
  void relax();

  /// Moves nodes back towards their original places as far as all margins stay enough.
  void move_back();

  const Skeleton& skeleton() const { return skeleton_; }
  const std::vector<BoneMargin>& margins() const { return margins_; }
  long measured() const { return measured_; }  ///< margins of bones, while nodes were moved

 private:
  static constexpr double kGoodMargin = 0.25;  ///< more earns nothing
  static constexpr int kAngles = 16;           ///< of rays while nodes are moved
  static constexpr int kFinalAngles = 32;      ///< to accept
  static constexpr double kNoLimit = std::numeric_limits<double>::infinity();
  struct Merge {
    BoneIndex bone;
    Vec3 place = Vec3::Zero();
    double cost = 0;
  };
  void prepare();
  std::vector<BoneIndex> bones_around(const std::vector<NodeIndex>& nodes) const;
  double cost(const Skeleton& skeleton, const std::vector<std::vector<BoneAtNode>>& at_nodes,
              const std::vector<BoneIndex>& bones, double limit) const;
  bool is_placed_well(const Skeleton& skeleton, NodeIndex node, double least_radius) const;
  double displacement_cost(const Skeleton& skeleton, NodeIndex node) const;
  double total_cost() const;
  std::vector<Vec3> gradient() const;
  void descend(int steps);
  bool merge_near(BoneIndex bone);
  bool move_node(NodeIndex node, double step, int trials);
  bool improve(BoneIndex bone);
  int worst_bone() const;
  std::vector<Vec3> merge_places(BoneIndex bone);
  bool try_merge(BoneIndex bone, const Vec3& place, Merge& best) const;
  Skeleton merged(BoneIndex bone, const Vec3& place) const;
  bool is_ring_kept(BoneIndex bone) const;
  void remove_node(NodeIndex node);
  void merge_at(const Merge& merge);
  bool try_skeleton(Skeleton changed, std::vector<double> radii);
  bool drop_free_end(BoneIndex bone);
  bool drop_beyond(BoneIndex bone);
  double length_of(const SkeletonLimb& limb) const;
  bool is_minor(const SkeletonLimb& limb) const;
  double cost_without(int hub, const std::set<int>& gone) const;

  const Surface& surface_;
  Skeleton skeleton_;
  std::vector<std::vector<BoneAtNode>> at_nodes_;
  std::vector<double> radii_;                    ///< per node, of the ball there before it was moved
  std::map<std::string, Vec3> original_places_;  ///< by the names of nodes
  std::vector<BoneMargin> margins_;
  std::vector<int> failures_;  ///< per bone, how often moves did not help
  RandomNumbers random_{1};
  long measured_ = 0;  ///< bones
};

}  // namespace skeletex
