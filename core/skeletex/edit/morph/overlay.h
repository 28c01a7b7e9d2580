// SPDX-License-Identifier: MIT
#pragma once
#include <array>
#include <utility>
#include <vector>

#include "skeletex/edit/morph/seam_network.h"
#include "skeletex/skeleton/correspondence.h"
#include "skeletex/skeleton/posed_planes.h"

namespace skeletex {

/// A model's seams as its ends' rows run through them: what all overlays of the model share.
struct TracedSeams {
  /// Per point, corners included, in the direction of growing angle. \see Overlay
  struct End {
    std::vector<double> turns;  ///< angles about the bone
    std::vector<double> v;      ///< made to grow; empty where that cannot be
    std::vector<double> distances;
    std::vector<int> arcs;        ///< -1: a corner
    std::vector<double> shares;   ///< of the way through the arc, by angle; of closed arcs no entry
    std::vector<int> arc_begins;  ///< per arc of the end, and the number of points
  };
  std::vector<std::array<End, 2>> ends;  ///< per bone
};
TracedSeams trace_seams(const SkeletexModel& model);

/// A model laid over another skeleton of the same branching: the roll correction of morphs and transfers (paper 5).
/// Angles about a bone of the one become angles about a bone of the other: where bones meet, linearly between the
/// bounds of equal neighbours; in a linear node's separation plane turned as a whole, and at a free end as they are,
/// after the model was posed so that its nodes lie where the other skeleton has them. A sliver between neighbours that
/// only the other skeleton has is a point of the model; one that only the model has is left out from its middle to both
/// sides.
///
/// Bones, ends and angles are those of the other skeleton ("here") unless they are called the model's.
class Overlay {
 public:
  /// \param model  its texels are not looked at. Must outlive this
  /// \param here   s is not looked at (see set_seams)
  /// \param to_model  from the bones here to those of the model
  /// \param traced  trace_seams(model)
  Overlay(const SkeletexModel& model, const Skeleton& here, Correspondence to_model, const TracedSeams& traced);
  Overlay(const SkeletexModel& model, const Skeleton& here, Correspondence to_model)
      : Overlay(model, here, std::move(to_model), trace_seams(model)) {}
  Overlay(const Overlay&) = delete;
  Overlay& operator=(const Overlay&) = delete;

  const SkeletexModel& model() const { return *model_; }
  int model_bone(int bone) const { return to_model_.bones[bone]; }
  bool is_reversed(int bone) const { return to_model_.is_reversed[bone]; }
  BoneEnd model_end(int bone, BoneEnd end) const {
    return is_reversed(bone) == (end == BoneEnd::kHead) ? BoneEnd::kTail : BoneEnd::kHead;
  }
  /// The model's direction of angle 0, carried here.
  const Vec3& carried_s(int bone) const { return posed_planes_.bases()[model_bone(bone)].s; }

  /// Says what angles here are counted from and where the seams run; before any angle is asked for.
  void set_seams(const SeparationPlanes& separation, const SeamNetwork& network);

  /// The model's angle at an angle here, in turns; one grows with the other, or falls where the bone is reversed, by a
  /// turn per turn.
  double model_turn(int bone, BoneEnd end, double turn) const;
  /// The inverse.
  double turn_here(int bone, BoneEnd end, double model_turn) const;

  /// A point of the model's seam: its distance from the bone's half-line, and how far its angle lies from the one that
  /// it is found by (not at all, but where a seam turns back about its bone), turns here.
  struct SeamPoint {
    double turn_offset = 0;
    double distance = 0;
  };
  SeamPoint seam_at(int bone, BoneEnd end, double turn) const;
  /// The samples of one of the model's arcs in the direction of growing angles here: each one's share of the way
  /// between the arc's corners (of a closed arc: its angle here).
  std::vector<double> arc_places(int bone, BoneEnd end, int arc) const;
  /// The model's arc between two bones; -1 when it has none.
  int model_arc(int node, int first_bone, int second_bone) const;

  /// A point of a seam as an end's row follows it.
  struct LoopPoint {
    double turn = 0;         ///< the angle that it is found by; growing
    double v = 0;            ///< of the row (seam_turns); growing
    double turn_offset = 0;  ///< its angle lies so far from `turn`
    double distance = 0;
  };
  /// Says how the ends' rows here run along their seams. \pre set_seams
  void set_loop(int bone, BoneEnd end, std::vector<LoopPoint> points) {
    loops_here_[bone][static_cast<int>(end)] = std::move(points);
  }
  /// v of the model's end row where it passes the same point of the seam as the row here at v; without a loop,
  /// model_turn.
  double model_v(int bone, BoneEnd end, double v) const;
  /// The slope of the model's separation plane at an angle of its own (Separation planes::slope), along the bone here.
  double slope_at(int bone, BoneEnd end, double model_turn) const;
  /// The texel of the model's seam there, in the directions of the bone here.
  Vec3 end_texel(int bone, BoneEnd end, double v) const;
  /// The texel of the seam here. \pre set_loop
  Vec3 end_texel_here(const Skeleton& here, const SeparationPlanes& separation, int bone, BoneEnd end, double v) const;
  /// The model's own seam as a loop, and the angles that one of its arcs' samples are found by. \pre the skeleton here
  /// is the model's
  const std::vector<LoopPoint>& own_loop(int bone, BoneEnd end) const { return loop(bone, end).points; }
  std::vector<double> own_turns(int bone, BoneEnd end, int arc) const;

 private:
  /// An arc as one end runs through it: the bone beyond, here, and the angles where it begins and ends.
  struct Interval {
    int neighbour;
    double begin, end;
  };
  struct Bound {
    double turn = 0;  ///< the model's
    double here = 0;  ///< in the model's direction of turning
  };
  struct Loop {
    std::vector<Bound> bounds;      ///< both growing; one is enough for a rotation
    std::vector<LoopPoint> points;  ///< angles are the model's
    std::vector<int> arcs;          ///< of the points; -1: a corner
  };
  void place_points(int bone, BoneEnd end, const TracedSeams::End& traced);
  std::vector<Interval> intervals_here(int bone, BoneEnd end, const SeparationPlanes& separation,
                                       const SeamNetwork& network) const;
  std::vector<Interval> intervals_of_model(int bone, BoneEnd end) const;
  const Loop& loop(int bone, BoneEnd end) const { return loops_[bone][static_cast<int>(end)]; }

  const SkeletexModel* model_;
  Correspondence to_model_;
  Skeleton posed_;
  SeparationPlanes separation_;
  PosedPlanes posed_planes_;
  std::vector<int> bones_here_;             ///< per bone of the model
  std::vector<std::array<Loop, 2>> loops_;  ///< per bone here
  std::vector<std::array<std::vector<LoopPoint>, 2>> loops_here_;
};

/// The skeleton of the model posed to the nodes of another one.
Skeleton posed_to(const Skeleton& model, const Skeleton& here, const Correspondence& to_model);

}  // namespace skeletex
