// SPDX-License-Identifier: MIT
#include "skeletex/edit/morph/seam_map.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>

#include "skeletex/geometry/loop_turns.h"
#include "skeletex/model/frame.h"
#include "skeletex/skeleton/pose.h"

namespace skeletex {
namespace {

constexpr double kNoWidth = 1e-9;  // turns

/// The point of a loop at an angle or at a v.
LoopPoint point_at(const std::vector<LoopPoint>& points, double LoopPoint::*key, double value) {
  const double first = points.front().*key, whole = std::floor(value - first), local = std::max(first, value - whole);
  const auto after = std::upper_bound(points.begin(), points.end(), local,
                                      [&](double x, const LoopPoint& point) { return x < point.*key; });
  const LoopPoint& p = *(after - 1);
  LoopPoint q = after == points.end() ? points.front() : *after;
  if (after == points.end()) ++q.turn, ++q.v;
  const double width = q.*key - p.*key, share = width > 0 ? (local - p.*key) / width : 0;
  const auto mix = [&](double x, double y) { return (1 - share) * x + share * y; };
  return {whole + mix(p.turn, q.turn), whole + mix(p.v, q.v), mix(p.turn_offset, q.turn_offset),
          mix(p.distance, q.distance)};
}

/// The texel of a point of a seam in the row at the patch's end.
Vec3 seam_texel(const Skeleton& skeleton, const SeparationPlanes& separation, BoneIndex bone, BoneEnd end,
                const LoopPoint& point) {
  const TangentFrame frame = tangent_frame(skeleton, separation, bone, end == BoneEnd::kHead ? 0 : 1, point.v);
  return encode_texel(frame, separation.seam_point(bone, end, point.turn + point.turn_offset, point.distance),
                      end_position(skeleton, bone, BoneEnd::kHead), end_position(skeleton, bone, BoneEnd::kTail));
}

/// The model's skeleton, posed to the target's nodes.
Skeleton posed_to(const Skeleton& model, const Skeleton& target, const Correspondence& to_model) {
  Pose pose;
  pose.nodes.resize(model.nodes.size());
  for (std::size_t n = 0; n < target.nodes.size(); ++n) pose.nodes[to_model.nodes[n]] = target.nodes[n].position;
  return apply_pose(model, pose);
}

/// Appends the points of all arcs of an end to a loop.
/// \return their positions
std::vector<Vec3> append_points(const SkeletexModel& model, const SeparationPlanes& separation, BoneIndex bone,
                                const std::vector<ArcUse>& uses, SeamLoop& loop) {
  std::vector<Vec3> positions;
  const auto append = [&](int owner, NodeIndex node, const SeamSample& sample, ArcIndex arc) {
    positions.push_back(
        separation.seam_point(owner, end_at(model.skeleton, owner, node), sample.turn, sample.distance));
    loop.turns.push_back(
        owner == bone ? sample.turn : separation.turn_of(bone, positions.back() - model.skeleton.nodes[node].position));
    loop.distances.push_back(sample.distance);
    loop.arcs.push_back(arc);
  };
  for (const ArcUse use : uses) {
    const SeamArc& arc = model.arcs[use.arc];
    loop.arc_begins.push_back(static_cast<int>(positions.size()));
    if (!arc.is_closed()) {
      const SeamCorner& corner = model.corners[arc.corners[use.is_reversed ? 1 : 0]];
      append(corner.bones[0], arc.node, corner.sample, -1);
    }
    for (std::size_t i = 0; i < arc.samples.size(); ++i)
      append(arc.bones[0], arc.node, arc.samples[use.is_reversed ? arc.samples.size() - 1 - i : i], use.arc);
  }
  loop.arc_begins.push_back(static_cast<int>(positions.size()));
  return positions;
}

/// Sets the parameters of the points of each arc, from corner to corner.
void set_shares(const std::vector<Vec3>& positions, SeamLoop& loop) {
  const std::size_t count = positions.size();
  for (std::size_t a = 0; a + 1 < loop.arc_begins.size(); ++a) {
    const int begin = loop.arc_begins[a], end = loop.arc_begins[a + 1];
    std::vector<Vec3> arc_positions(positions.begin() + begin, positions.begin() + end);
    std::vector<double> arc_turns(loop.turns.begin() + begin, loop.turns.begin() + end);
    arc_positions.push_back(positions[end % count]);
    arc_turns.push_back(loop.turns[end % count]);
    const std::vector<double> shares = arc_shares(arc_positions, arc_turns);
    loop.shares.insert(loop.shares.end(), shares.begin(), shares.begin() + (end - begin));
  }
}

}  // namespace

SeamLoops trace_seams(const SkeletexModel& model) {
  const SeparationPlanes separation(model.skeleton);
  SeamLoops loops(model.patches.size());
  for (BoneIndex bone = 0; bone < static_cast<int>(loops.size()); ++bone)
    for (const int end : {0, 1}) {
      const std::vector<ArcUse>& uses = model.ends[bone][end].arcs;
      if (uses.empty()) continue;
      SeamLoop& loop = loops[bone][end];
      const std::vector<Vec3> positions = append_points(model, separation, bone, uses, loop);
      if (std::optional<std::vector<double>> v = loop_turns(positions, loop.turns)) loop.v = std::move(*v);
      // Corners belong where the separation planes meet, so that each arc fills its interval of angles.
      if (!model.arcs[uses[0].arc].is_closed()) set_shares(positions, loop);
    }
  return loops;
}

SeamMap::SeamMap(const SkeletexModel& model, const Skeleton& target, Correspondence to_model, const SeamLoops& loops)
    : model_(&model),
      to_model_(std::move(to_model)),
      posed_(posed_to(model.skeleton, target, to_model_)),
      separation_(model.skeleton),
      posed_planes_(model, posed_),
      target_bones_(model.skeleton.bones.size(), -1),
      loops_(target.bones.size()),
      target_loops_(target.bones.size()) {
  for (BoneIndex bone = 0; bone < static_cast<int>(loops_.size()); ++bone) target_bones_[model_bone(bone)] = bone;
  for (BoneIndex bone = 0; bone < static_cast<int>(loops_.size()); ++bone)
    for (const BoneEnd end : {BoneEnd::kHead, BoneEnd::kTail})
      set_model_loop(bone, end, loops[model_bone(bone)][static_cast<int>(model_end(bone, end))]);
}

std::vector<AngleInterval> SeamMap::target_intervals(BoneIndex bone, BoneEnd end, const SeparationPlanes& separation,
                                                     const SeamNetwork& network) const {
  std::vector<AngleInterval> intervals;
  for (const ArcUse use : network.ends[bone][static_cast<int>(end)].arcs) {
    const SeamArc& arc = network.arcs[use.arc];
    double begin = separation.turn_of(bone, network.directions[arc.corners[use.is_reversed ? 1 : 0]]);
    if (!intervals.empty()) {
      const double step = begin - intervals.back().begin;
      begin -= std::floor(step + kNoWidth);  // rounding may swap the bounds of an interval without width
      begin = std::max(begin, intervals.back().begin);
    }
    intervals.push_back({arc.bones[0] == bone ? arc.bones[1] : arc.bones[0], begin, 0});
  }
  for (std::size_t i = 0; i < intervals.size(); ++i)
    intervals[i].end = i + 1 < intervals.size() ? intervals[i + 1].begin : intervals[0].begin + 1;
  if (!is_reversed(bone)) return intervals;
  std::reverse(intervals.begin(), intervals.end());
  for (AngleInterval& interval : intervals) interval = {interval.neighbour, -interval.end, -interval.begin};
  return intervals;
}

std::vector<AngleInterval> SeamMap::model_intervals(BoneIndex bone, BoneEnd end) const {
  const int own = model_bone(bone);
  const BoneEnd own_end = model_end(bone, end);
  const std::vector<PosedBound> bounds = posed_planes_.bounds(own, own_end);
  std::vector<AngleInterval> intervals;
  for (std::size_t i = 0; i < bounds.size(); ++i) {
    const SeamArc& arc = model_->arcs[model_->ends[own][static_cast<int>(own_end)].arcs[i].arc];
    intervals.push_back({target_bones_[arc.bones[0] == own ? arc.bones[1] : arc.bones[0]], bounds[i].turn,
                         i + 1 < bounds.size() ? bounds[i + 1].turn : bounds[0].turn + 1});
  }
  return intervals;
}

void SeamMap::set_network(const SeparationPlanes& separation, const SeamNetwork& network) {
  for (BoneIndex bone = 0; bone < static_cast<int>(loops_.size()); ++bone)
    for (const BoneEnd end : {BoneEnd::kHead, BoneEnd::kTail}) {
      std::vector<AnglePair>& pairs = loops_[bone][static_cast<int>(end)].pairs;
      pairs.clear();
      const std::vector<ArcUse>& uses = network.ends[bone][static_cast<int>(end)].arcs;
      if (!uses.empty() && !network.arcs[uses[0].arc].is_closed())
        pairs = pair_bounds(target_intervals(bone, end, separation, network), model_intervals(bone, end));
      if (!pairs.empty()) continue;
      // The rotation of the posed frame; in the separation plane of two bones with its roll.
      const BoneBasis& posed = posed_planes_.bases()[model_bone(bone)];
      const Vec3& s = separation.bases()[bone].s;
      const double zero = std::atan2(s.dot(posed.b), s.dot(posed.s)) / (2 * std::numbers::pi);
      const std::vector<PosedBound> rolls = posed_planes_.bounds(model_bone(bone), model_end(bone, end));
      pairs.push_back({0, (rolls.size() == 1 ? rolls[0].roll : 0) - zero});
    }
}

void SeamMap::set_model_loop(BoneIndex bone, BoneEnd end, const SeamLoop& traced) {
  if (traced.turns.empty()) return;
  Loop& loop = loops_[bone][static_cast<int>(end)];
  const std::vector<AngleInterval> intervals = model_intervals(bone, end);
  const int count = static_cast<int>(traced.turns.size());
  loop.arcs = traced.arcs;
  for (std::size_t a = 0; a + 1 < traced.arc_begins.size(); ++a)
    for (int i = traced.arc_begins[a]; i < traced.arc_begins[a + 1]; ++i) {
      LoopPoint point{0, traced.v.empty() ? intervals[0].begin + static_cast<double>(i) / count : traced.v[i], 0,
                      traced.distances[i]};
      point.turn = traced.shares.empty()
                       ? point.v
                       : (1 - traced.shares[i]) * intervals[a].begin + traced.shares[i] * intervals[a].end;
      const double offset = traced.turns[i] - point.turn;
      point.turn_offset = traced.arcs[i] < 0 ? 0 : offset - std::round(offset);
      loop.points.push_back(point);
    }
}

double SeamMap::model_turn(BoneIndex bone, BoneEnd end, double turn) const {
  return map_angle(loop(bone, end).pairs, &AnglePair::target, &AnglePair::model, is_reversed(bone) ? -turn : turn);
}

double SeamMap::target_turn(BoneIndex bone, BoneEnd end, double model_turn) const {
  const double turn = map_angle(loop(bone, end).pairs, &AnglePair::model, &AnglePair::target, model_turn);
  return is_reversed(bone) ? -turn : turn;
}

SeamMap::SeamPoint SeamMap::seam_at(BoneIndex bone, BoneEnd end, double turn) const {
  const LoopPoint point = point_at(loop(bone, end).points, &LoopPoint::turn, model_turn(bone, end, turn));
  return {is_reversed(bone) ? -point.turn_offset : point.turn_offset, point.distance};
}

LoopPoint SeamMap::model_point(BoneIndex bone, BoneEnd end, double v) const {
  const LoopPoint target = point_at(target_loops_[bone][static_cast<int>(end)], &LoopPoint::v, v);
  return point_at(loop(bone, end).points, &LoopPoint::turn, model_turn(bone, end, target.turn));
}

double SeamMap::model_v(BoneIndex bone, BoneEnd end, double v) const {
  if (target_loops_[bone][static_cast<int>(end)].empty()) return model_turn(bone, end, v);
  return model_point(bone, end, v).v;
}

double SeamMap::model_slope(BoneIndex bone, BoneEnd end, double model_turn) const {
  const double slope = separation_.slope(model_bone(bone), model_end(bone, end), model_turn);
  return is_reversed(bone) ? -slope : slope;
}

Vec3 SeamMap::model_end_texel(BoneIndex bone, BoneEnd end, double v) const {
  Vec3 texel =
      seam_texel(model_->skeleton, separation_, model_bone(bone), model_end(bone, end), model_point(bone, end, v));
  if (is_reversed(bone)) texel.head<2>() = -texel.head<2>();
  return texel;
}

Vec3 SeamMap::target_end_texel(const Skeleton& target, const SeparationPlanes& separation, BoneIndex bone, BoneEnd end,
                               double v) const {
  return seam_texel(target, separation, bone, end,
                    point_at(target_loops_[bone][static_cast<int>(end)], &LoopPoint::v, v));
}

std::vector<double> SeamMap::arc_parameters(BoneIndex bone, BoneEnd end, ArcIndex model_arc) const {
  const Loop& at = loop(bone, end);
  const int count = static_cast<int>(at.points.size());
  const auto first_sample = std::find(at.arcs.begin(), at.arcs.end(), model_arc);
  const int first = static_cast<int>(first_sample - at.arcs.begin());
  const int samples = static_cast<int>(
      std::find_if(first_sample, at.arcs.end(), [&](ArcIndex arc) { return arc != model_arc; }) - first_sample);
  const bool is_closed = model_->arcs[model_arc].is_closed();
  const int last = first + samples;
  const double begin = is_closed ? 0 : at.points[first - 1].turn,
               width = is_closed ? 1 : (last < count ? at.points[last].turn : at.points[0].turn + 1) - begin;
  std::vector<double> parameters;
  for (int i = 0; i < samples; ++i) {
    const double share = width > kNoWidth ? (at.points[first + i].turn - begin) / width : (i + 1.0) / (samples + 1.0);
    parameters.push_back(is_closed           ? target_turn(bone, end, at.points[first + i].turn)
                         : is_reversed(bone) ? 1 - share
                                             : share);
  }
  if (is_reversed(bone)) std::reverse(parameters.begin(), parameters.end());
  return parameters;
}

std::vector<double> SeamMap::sample_turns(BoneIndex bone, BoneEnd end, ArcIndex model_arc) const {
  const Loop& at = loop(bone, end);
  std::vector<double> turns;
  for (std::size_t i = 0; i < at.points.size(); ++i)
    if (at.arcs[i] == model_arc) turns.push_back(at.points[i].turn);
  return turns;
}

ArcIndex SeamMap::model_arc(NodeIndex node, BoneIndex first_bone, BoneIndex second_bone) const {
  const int a = model_bone(first_bone), b = model_bone(second_bone);
  for (int i = 0; i < static_cast<int>(model_->arcs.size()); ++i) {
    const SeamArc& arc = model_->arcs[i];
    if (arc.node == to_model_.nodes[node] &&
        ((arc.bones[0] == a && arc.bones[1] == b) || (arc.bones[0] == b && arc.bones[1] == a)))
      return i;
  }
  return -1;
}

}  // namespace skeletex
