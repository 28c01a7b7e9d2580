// SPDX-License-Identifier: MIT
#include "skeletex/edit/morph/seam_mean.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "skeletex/reconstruct/seam_strip.h"

namespace skeletex {
namespace {

constexpr double kNoWidth = 1e-9;  // turns

class SeamMean {
 public:
  SeamMean(const SkeletexModel& result, const SeparationPlanes& separation, const std::deque<SeamMap>& maps,
           std::span<const double> weights, const SeamMap& layout)
      : skeleton_(result.skeleton),
        patches_(result.patches),
        separation_(separation),
        maps_(maps),
        weights_(weights),
        layout_(layout) {}

  void fill(SeamNetwork& network) {
    for (std::size_t c = 0; c < network.corners.size(); ++c) {
      SeamCorner& corner = network.corners[c];
      for (const BoneIndex bone : corner.bones)
        corner.sample.distance +=
            mean_at(bone, end_at(skeleton_, bone, corner.node), separation_.turn_of(bone, network.directions[c]))
                .distance /
            static_cast<double>(corner.bones.size());
    }
    for (SeamArc& arc : network.arcs) turns_.push_back(fill_arc(network, arc));
  }

  /// The loop around an end as the row follows it; empty at a free end.
  /// \pre fill
  std::vector<LoopPoint> loop(const SeamNetwork& network, BoneIndex bone, BoneEnd end) const {
    std::vector<LoopPoint> points;
    std::vector<Vec3> positions;
    std::vector<double> angles;
    const auto add = [&](int owner, const SeamSample& sample, NodeIndex node, double turn) {
      positions.push_back(separation_.seam_point(owner, end_at(skeleton_, owner, node), sample.turn, sample.distance));
      angles.push_back(owner == bone ? sample.turn
                                     : separation_.turn_of(bone, positions.back() - skeleton_.nodes[node].position));
      if (!points.empty()) turn = std::max(points.back().turn, turn - std::floor(turn - points.back().turn + kNoWidth));
      const double offset = angles.back() - turn;
      points.push_back({turn, 0, offset - std::round(offset), sample.distance});
    };
    for (const ArcUse use : network.ends[bone][static_cast<int>(end)].arcs) {
      const SeamArc& arc = network.arcs[use.arc];
      if (!arc.is_closed()) {
        const int corner = arc.corners[use.is_reversed ? 1 : 0];
        add(network.corners[corner].bones[0], network.corners[corner].sample, arc.node,
            separation_.turn_of(bone, network.directions[corner]));
      }
      for (std::size_t i = 0; i < arc.samples.size(); ++i) {
        const std::size_t at = use.is_reversed ? arc.samples.size() - 1 - i : i;
        const double turn = turns_[use.arc][at];
        add(arc.bones[0], arc.samples[at], arc.node, arc.bones[0] == bone ? turn : turn_about_other(arc, turn));
      }
    }
    if (points.empty()) return points;
    const std::vector<double> v = seam_turns(positions, angles);
    double mean = 0;
    for (std::size_t i = 0; i < points.size(); ++i)
      mean += (points[i].turn - v[i]) / static_cast<double>(points.size());
    for (std::size_t i = 0; i < points.size(); ++i) points[i].v = v[i] + std::round(mean);
    return points;
  }

 private:
  /// The angle about an arc's second bone of a point at an angle about its first.
  double turn_about_other(const SeamArc& arc, double turn) const {
    const BoneBasis& basis = separation_.bases()[arc.bones[0]];
    const BoneEnd end = end_at(skeleton_, arc.bones[0], arc.node);
    return separation_.turn_of(
        arc.bones[1], separation_.radial(arc.bones[0], turn) + separation_.slope(arc.bones[0], end, turn) * basis.o);
  }

  SeamMap::SeamPoint mean_at(BoneIndex bone, BoneEnd end, double turn) const {
    SeamMap::SeamPoint mean;
    for (std::size_t m = 0; m < maps_.size(); ++m) {
      if (weights_[m] == 0) continue;
      const SeamMap::SeamPoint point = maps_[m].seam_at(bone, end, turn);
      mean.turn_offset += weights_[m] * point.turn_offset;
      mean.distance += weights_[m] * point.distance;
    }
    return mean;
  }

  /// The mean of what both bones of an arc read, at an angle about the first.
  SeamMap::SeamPoint mean_on_arc(const SeamArc& arc, double turn) const {
    const BoneEnd end = end_at(skeleton_, arc.bones[0], arc.node),
                  other_end = end_at(skeleton_, arc.bones[1], arc.node);
    const double sign = end == other_end ? -1 : 1;  // of angles about the other bone
    const SeamMap::SeamPoint first = mean_at(arc.bones[0], end, turn),
                             second = mean_at(arc.bones[1], other_end, turn_about_other(arc, turn));
    return {(first.turn_offset + sign * second.turn_offset) / 2, (first.distance + second.distance) / 2};
  }

  /// Where the samples of an arc lie, from 0 to 1: as the layout's, or evenly where it has no such arc.
  /// \param width  of the arc, turns
  std::vector<double> arc_parameters(const SeamArc& arc, double width) const {
    const BoneIndex bone = arc.bones[0];
    const ArcIndex layout_arc = layout_.model_arc(arc.node, bone, arc.bones[1]);
    if (layout_arc >= 0) return layout_.arc_parameters(bone, end_at(skeleton_, bone, arc.node), layout_arc);
    const int columns = std::max(patches_[bone].rectangle.width, patches_[arc.bones[1]].rectangle.width);
    const int intervals = std::max(2, static_cast<int>(std::lround(width * columns)));
    std::vector<double> parameters;
    for (int i = 1; i < intervals; ++i) parameters.push_back(static_cast<double>(i) / intervals);
    return parameters;
  }

  /// Sets the samples of an arc.
  /// \return the angles that they are found by
  std::vector<double> fill_arc(const SeamNetwork& network, SeamArc& arc) const {
    double begin = 0, width = 1;
    std::array<SeamMap::SeamPoint, 2> missing;  // at the corners
    if (!arc.is_closed()) {
      begin = separation_.turn_of(arc.bones[0], network.directions[arc.corners[0]]);
      width = separation_.turn_of(arc.bones[0], network.directions[arc.corners[1]]) - begin;
      width -= std::floor(width + 0.25);  // at most half a turn; rounding may make it negative
      for (const int side : {0, 1}) {
        const SeamMap::SeamPoint mean = mean_on_arc(arc, begin + side * width);
        missing[side] = {-mean.turn_offset, network.corners[arc.corners[side]].sample.distance - mean.distance};
      }
    }
    std::vector<double> turns;
    for (const double place : arc_parameters(arc, width)) {
      const double turn = begin + width * place;
      const SeamMap::SeamPoint mean = mean_on_arc(arc, turn);
      const double angle =
          turn + mean.turn_offset + (1 - place) * missing[0].turn_offset + place * missing[1].turn_offset;
      turns.push_back(turn);
      arc.samples.push_back(
          {angle - std::floor(angle), mean.distance + (1 - place) * missing[0].distance + place * missing[1].distance});
    }
    return turns;
  }

  const Skeleton& skeleton_;
  const std::vector<Patch>& patches_;
  const SeparationPlanes& separation_;
  const std::deque<SeamMap>& maps_;
  std::span<const double> weights_;
  const SeamMap& layout_;
  std::vector<std::vector<double>> turns_;  ///< per arc and sample, the angle about bones[0] that it is found by
};

}  // namespace

SeamNetwork mean_seams(const SkeletexModel& result, const SeparationPlanes& separation, std::deque<SeamMap>& maps,
                       std::span<const double> weights, int layout, bool has_loops) {
  SeamNetwork network = seam_network(result.skeleton, separation);
  for (SeamMap& map : maps) map.set_network(separation, network);
  SeamMean mean(result, separation, maps, weights, maps[layout]);
  mean.fill(network);
  for (BoneIndex bone = 0; has_loops && bone < static_cast<int>(result.patches.size()); ++bone)
    for (const BoneEnd end : {BoneEnd::kHead, BoneEnd::kTail}) {
      const std::vector<LoopPoint> loop = mean.loop(network, bone, end);
      for (SeamMap& map : maps) map.set_target_loop(bone, end, loop);
    }
  return network;
}

}  // namespace skeletex
