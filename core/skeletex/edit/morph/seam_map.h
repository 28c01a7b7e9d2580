// SPDX-License-Identifier: MIT
#pragma once
#include <array>
#include <utility>
#include <vector>

#include "skeletex/edit/morph/angle_map.h"
#include "skeletex/edit/morph/seam_network.h"
#include "skeletex/reconstruct/pose/posed_planes.h"
#include "skeletex/skeleton/correspondence.h"

namespace skeletex {

/// The end of a bone that lies at a node.

/// The seams around one end of a patch, once around in the direction of growing angle, corners included.
struct SeamLoop {
  std::vector<double> turns;      ///< per point, its angle about the bone
  std::vector<double> v;          ///< per point, the angle made to grow; empty if the loop does not wind once
  std::vector<double> distances;  ///< per point, from the bone's half-line, world units
  std::vector<int> arcs;          ///< per point; -1: a corner
  std::vector<double> shares;     ///< per point, its parameter on its arc, 0 to 1; empty if the arc is closed
  std::vector<int> arc_begins;    ///< per arc of the end, its first point; then the number of points
};
using SeamLoops = std::vector<std::array<SeamLoop, 2>>;  ///< per bone: head, tail
SeamLoops trace_seams(const SkeletexModel& model);

/// A point of a loop as the row at a patch's end follows it.
struct LoopPoint {
  double turn = 0;         ///< the angle that the point is found by; grows along the loop
  double v = 0;            ///< v of the row there (seam_turns); grows along the loop
  double turn_offset = 0;  ///< the point's own angle minus `turn`; 0 unless the seam turns back about its bone
  double distance = 0;     ///< from the bone's half-line, world units
};

/// A map from angles about the bones of a target skeleton to angles about the bones of a model of the same branching:
/// the roll correction of morphs and transfers (paper 5).
///
/// The model is posed so that its nodes lie at the target's. Then angles correspond as follows. Where bones meet, the
/// map is linear between the bounds of equal neighbours. In the separation plane of a node of two bones it is a
/// rotation. At a free end it is the identity. An arc between two neighbours that only the target has becomes a point;
/// an arc that only the model has is divided at its middle between its neighbours.
///
/// Bones, ends and angles are those of the target, unless a name says `model`.
class SeamMap {
 public:
  /// \param model     only its skeleton, patches and seams are read. Must outlive this
  /// \param target    its bones' s are not read: see set_network
  /// \param to_model  from the target's bones to the model's
  /// \param loops     trace_seams(model)
  SeamMap(const SkeletexModel& model, const Skeleton& target, Correspondence to_model, const SeamLoops& loops);
  SeamMap(const SkeletexModel& model, const Skeleton& target, Correspondence to_model)
      : SeamMap(model, target, std::move(to_model), trace_seams(model)) {}
  SeamMap(const SeamMap&) = delete;
  SeamMap& operator=(const SeamMap&) = delete;

  const SkeletexModel& model() const { return *model_; }
  BoneIndex model_bone(BoneIndex bone) const { return to_model_.bones[bone]; }
  bool is_reversed(BoneIndex bone) const { return to_model_.is_reversed[bone]; }
  /// -1 where the model's bone is reversed, else 1.
  double sign(BoneIndex bone) const { return is_reversed(bone) ? -1 : 1; }
  BoneEnd model_end(BoneIndex bone, BoneEnd end) const { return is_reversed(bone) ? opposite(end) : end; }
  /// The model's direction of angle 0, in its pose at the target's nodes.
  const Vec3& posed_s(BoneIndex bone) const { return posed_planes_.bases()[model_bone(bone)].s; }

  /// Sets the target's directions of angle 0 and its seams. All functions below need them.
  void set_network(const SeparationPlanes& separation, const SeamNetwork& network);

  /// The model's angle at an angle of the target, in turns. It grows by a turn per turn, or falls where the bone is
  /// reversed.
  double model_turn(BoneIndex bone, BoneEnd end, double turn) const;
  /// The inverse of model_turn.
  double target_turn(BoneIndex bone, BoneEnd end, double model_turn) const;

  /// A point of the model's seam: how far its angle lies from the one it is found by, turns of the target, and its
  /// distance from the bone's half-line.
  struct SeamPoint {
    double turn_offset = 0;
    double distance = 0;
  };
  SeamPoint seam_at(BoneIndex bone, BoneEnd end, double turn) const;
  /// The parameters, 0 to 1, of the samples on an arc of the model, in the direction of the target's growing angles. Of
  /// a closed arc, their angles about the target's bone.
  std::vector<double> arc_parameters(BoneIndex bone, BoneEnd end, ArcIndex model_arc) const;
  /// The model's arc between two bones at a node; -1 when it has none.
  ArcIndex model_arc(NodeIndex node, BoneIndex first_bone, BoneIndex second_bone) const;

  /// Sets how the row at an end of a target's patch runs along its seam.
  void set_target_loop(BoneIndex bone, BoneEnd end, std::vector<LoopPoint> points) {
    target_loops_[bone][static_cast<int>(end)] = std::move(points);
  }
  /// v of the model's end row where it passes the point of the seam that the target's row passes at v. Without a target
  /// loop, model_turn.
  double model_v(BoneIndex bone, BoneEnd end, double v) const;
  /// The slope of the model's separation plane at one of its own angles (SeparationPlanes::slope), along the target's
  /// bone.
  double model_slope(BoneIndex bone, BoneEnd end, double model_turn) const;
  /// The texel of the model's seam at a target's v, in the directions of the target's bone.
  /// \pre set_target_loop
  Vec3 model_end_texel(BoneIndex bone, BoneEnd end, double v) const;
  /// The texel of the target's own seam.
  /// \pre set_target_loop
  Vec3 target_end_texel(const Skeleton& target, const SeparationPlanes& separation, BoneIndex bone, BoneEnd end,
                        double v) const;
  /// The model's own loop, with the model's angles.
  const std::vector<LoopPoint>& model_loop(BoneIndex bone, BoneEnd end) const { return loop(bone, end).points; }
  /// The angles that the samples of one of the model's arcs are found by, the model's.
  std::vector<double> sample_turns(BoneIndex bone, BoneEnd end, ArcIndex model_arc) const;

 private:
  struct Loop {
    std::vector<AnglePair> pairs;
    std::vector<LoopPoint> points;  ///< angles are the model's
    std::vector<int> arcs;          ///< per point; -1: a corner
  };
  std::vector<AngleInterval> target_intervals(BoneIndex bone, BoneEnd end, const SeparationPlanes& separation,
                                              const SeamNetwork& network) const;
  std::vector<AngleInterval> model_intervals(BoneIndex bone, BoneEnd end) const;
  void set_model_loop(BoneIndex bone, BoneEnd end, const SeamLoop& traced);
  LoopPoint model_point(BoneIndex bone, BoneEnd end, double v) const;
  const Loop& loop(BoneIndex bone, BoneEnd end) const { return loops_[bone][static_cast<int>(end)]; }

  const SkeletexModel* model_;
  Correspondence to_model_;
  Skeleton posed_;  ///< the model's, at the target's nodes
  SeparationPlanes separation_;
  PosedPlanes posed_planes_;
  std::vector<int> target_bones_;           ///< per bone of the model
  std::vector<std::array<Loop, 2>> loops_;  ///< per bone of the target
  std::vector<std::array<std::vector<LoopPoint>, 2>> target_loops_;
};

}  // namespace skeletex
