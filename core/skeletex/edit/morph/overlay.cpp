// SPDX-License-Identifier: MIT
#include "skeletex/edit/morph/overlay.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>

#include "skeletex/geometry/loop_turns.h"
#include "skeletex/skeleton/frame.h"
#include "skeletex/skeleton/pose.h"

namespace skeletex {
namespace {

constexpr double kNoWidth = 1e-9;  // turns

/// y at x of a map that grows by a turn per turn, linear between its bounds.
template <class Bound>
double along_bounds(const std::vector<Bound>& bounds, double Bound::*x_of, double Bound::*y_of, double x) {
  const double first = bounds.front().*x_of, whole = std::floor(x - first);
  const double local = x - whole;
  std::size_t i = bounds.size() - 1;
  while (i > 0 && bounds[i].*x_of > local) --i;
  const bool is_last = i + 1 == bounds.size();
  const double begin = bounds[i].*x_of, width = (is_last ? first + 1 : bounds[i + 1].*x_of) - begin;
  const double y = bounds[i].*y_of, height = (is_last ? bounds.front().*y_of + 1 : bounds[i + 1].*y_of) - y;
  return whole + y + (width > 0 ? (local - begin) / width * height : height / 2);
}

/// The point of a loop at an angle or at a v.
Overlay::LoopPoint point_at(const std::vector<Overlay::LoopPoint>& points, double Overlay::LoopPoint::*key,
                            double value) {
  const double first = points.front().*key, whole = std::floor(value - first), local = std::max(first, value - whole);
  const auto after = std::upper_bound(points.begin(), points.end(), local,
                                      [&](double x, const Overlay::LoopPoint& point) { return x < point.*key; });
  const Overlay::LoopPoint& p = *(after - 1);
  Overlay::LoopPoint q = after == points.end() ? points.front() : *after;
  if (after == points.end()) ++q.turn, ++q.v;
  const double width = q.*key - p.*key, share = width > 0 ? (local - p.*key) / width : 0;
  const auto mix = [&](double x, double y) { return (1 - share) * x + share * y; };
  return {whole + mix(p.turn, q.turn), whole + mix(p.v, q.v), mix(p.turn_offset, q.turn_offset),
          mix(p.distance, q.distance)};
}

/// Bounds of equal neighbours of two loops, both in the direction of growing angle. Neighbours that follow each other
/// in another order than the rest are left out, the thinnest first; so are those that only one loop has.
template <class Bound, class Interval>
std::vector<Bound> paired_bounds(const std::vector<Interval>& here, std::vector<Interval> model) {
  const auto find = [](const std::vector<Interval>& loop, int neighbour) {
    return std::find_if(loop.begin(), loop.end(),
                        [&](const Interval& interval) { return interval.neighbour == neighbour; });
  };
  std::erase_if(model, [&](const Interval& interval) { return find(here, interval.neighbour) == here.end(); });
  std::vector<Interval> common;
  for (bool is_ordered = false; !is_ordered;) {
    if (model.empty()) return {};
    common.clear();
    // The loop here from the model's first neighbour on.
    const auto first = find(here, model[0].neighbour);
    for (std::size_t i = 0; i < here.size(); ++i) {
      const std::size_t at = (static_cast<std::size_t>(first - here.begin()) + i) % here.size();
      const double lift = at < static_cast<std::size_t>(first - here.begin()) ? 1 : 0;
      if (find(model, here[at].neighbour) != model.end())
        common.push_back({here[at].neighbour, here[at].begin + lift, here[at].end + lift});
    }
    is_ordered = std::equal(common.begin(), common.end(), model.begin(), model.end(),
                            [](const Interval& p, const Interval& q) { return p.neighbour == q.neighbour; });
    if (!is_ordered)
      model.erase(std::min_element(model.begin(), model.end(), [](const Interval& p, const Interval& q) {
        return p.end - p.begin < q.end - q.begin;
      }));
  }
  std::vector<Bound> bounds;
  for (std::size_t i = 0; i < model.size(); ++i) {
    const bool is_last = i + 1 == model.size();
    const double next_here = is_last ? common[0].begin + 1 : common[i + 1].begin,
                 next_model = is_last ? model[0].begin + 1 : model[i + 1].begin;
    if (i == 0) bounds.push_back({model[0].begin, common[0].begin});
    bounds.push_back({(model[i].end + next_model) / 2, (common[i].end + next_here) / 2});
  }
  // The last bound is the first one, a turn later; the first one's middle is known only now.
  bounds[0] = {bounds.back().turn - 1, bounds.back().here - 1};
  bounds.pop_back();
  return bounds;
}

/// The texel in an end's row of a point of its seam.
Vec3 seam_texel(const Skeleton& skeleton, const SeparationPlanes& separation, int bone, BoneEnd end,
                const Overlay::LoopPoint& point) {
  const TangentFrame frame = tangent_frame(skeleton, separation, bone, end == BoneEnd::kHead ? 0 : 1, point.v);
  return encode_texel(frame, separation.seam_point(bone, end, point.turn + point.turn_offset, point.distance),
                      end_position(skeleton, bone, BoneEnd::kHead), end_position(skeleton, bone, BoneEnd::kTail));
}

}  // namespace

Skeleton posed_to(const Skeleton& model, const Skeleton& here, const Correspondence& to_model) {
  Pose pose;
  pose.nodes.resize(model.nodes.size());
  for (std::size_t n = 0; n < here.nodes.size(); ++n) pose.nodes[to_model.nodes[n]] = here.nodes[n].position;
  return apply_pose(model, pose);
}

TracedSeams trace_seams(const SkeletexModel& model) {
  const SeparationPlanes separation(model.skeleton);
  TracedSeams traced;
  traced.ends.resize(model.patches.size());
  for (int bone = 0; bone < static_cast<int>(traced.ends.size()); ++bone)
    for (const BoneEnd at : {BoneEnd::kHead, BoneEnd::kTail}) {
      TracedSeams::End& end = traced.ends[bone][static_cast<int>(at)];
      const std::vector<ArcUse>& uses = model.ends[bone][static_cast<int>(at)].arcs;
      if (uses.empty()) continue;
      const int node = end_node(model.skeleton, bone, at);
      std::vector<Vec3> positions;
      const auto add = [&](int owner, const SeamSample& sample, int arc) {
        positions.push_back(
            separation.seam_point(owner, end_at(model.skeleton, owner, node), sample.turn, sample.distance));
        end.turns.push_back(owner == bone
                                ? sample.turn
                                : separation.turn_of(bone, positions.back() - model.skeleton.nodes[node].position));
        end.distances.push_back(sample.distance);
        end.arcs.push_back(arc);
      };
      for (const ArcUse use : uses) {
        const SeamArc& arc = model.arcs[use.arc];
        end.arc_begins.push_back(static_cast<int>(positions.size()));
        if (!arc.is_closed()) {
          const SeamCorner& corner = model.corners[arc.corners[use.is_reversed ? 1 : 0]];
          add(corner.bones[0], corner.sample, -1);
        }
        for (std::size_t i = 0; i < arc.samples.size(); ++i)
          add(arc.bones[0], arc.samples[use.is_reversed ? arc.samples.size() - 1 - i : i], use.arc);
      }
      const int count = static_cast<int>(positions.size());
      end.arc_begins.push_back(count);
      // Angles are made to grow where the seam turns back about its bone; corners belong where the separation planes
      // meet, so that each arc fills its interval.
      if (std::optional<std::vector<double>> found = loop_turns(positions, end.turns)) end.v = std::move(*found);
      if (model.arcs[uses[0].arc].is_closed()) continue;
      for (std::size_t a = 0; a < uses.size(); ++a) {
        const int begin = end.arc_begins[a], end_of_arc = end.arc_begins[a + 1];
        std::vector<Vec3> arc_positions(positions.begin() + begin, positions.begin() + end_of_arc);
        std::vector<double> arc_turns(end.turns.begin() + begin, end.turns.begin() + end_of_arc);
        arc_positions.push_back(positions[end_of_arc % count]);
        arc_turns.push_back(end.turns[end_of_arc % count]);
        const std::vector<double> shares = arc_shares(arc_positions, arc_turns);
        end.shares.insert(end.shares.end(), shares.begin(), shares.begin() + (end_of_arc - begin));
      }
    }
  return traced;
}

Overlay::Overlay(const SkeletexModel& model, const Skeleton& here, Correspondence to_model, const TracedSeams& traced)
    : model_(&model),
      to_model_(std::move(to_model)),
      posed_(posed_to(model.skeleton, here, to_model_)),
      separation_(model.skeleton),
      posed_planes_(model, posed_),
      bones_here_(model.skeleton.bones.size(), -1),
      loops_(here.bones.size()),
      loops_here_(here.bones.size()) {
  for (int bone = 0; bone < static_cast<int>(loops_.size()); ++bone) bones_here_[model_bone(bone)] = bone;
  for (int bone = 0; bone < static_cast<int>(loops_.size()); ++bone)
    for (const BoneEnd end : {BoneEnd::kHead, BoneEnd::kTail})
      place_points(bone, end, traced.ends[model_bone(bone)][static_cast<int>(model_end(bone, end))]);
}

std::vector<Overlay::Interval> Overlay::intervals_here(int bone, BoneEnd end, const SeparationPlanes& separation,
                                                       const SeamNetwork& network) const {
  std::vector<Interval> intervals;
  for (const ArcUse use : network.ends[bone][static_cast<int>(end)].arcs) {
    const SeamArc& arc = network.arcs[use.arc];
    double begin = separation.turn_of(bone, network.directions[arc.corners[use.is_reversed ? 1 : 0]]);
    if (!intervals.empty()) {
      const double step = begin - intervals.back().begin;
      begin -= std::floor(step + kNoWidth);  // rounding may turn a sliver's bounds round
      begin = std::max(begin, intervals.back().begin);
    }
    intervals.push_back({arc.bones[0] == bone ? arc.bones[1] : arc.bones[0], begin, 0});
  }
  for (std::size_t i = 0; i < intervals.size(); ++i)
    intervals[i].end = i + 1 < intervals.size() ? intervals[i + 1].begin : intervals[0].begin + 1;
  if (!is_reversed(bone)) return intervals;
  std::reverse(intervals.begin(), intervals.end());
  for (Interval& interval : intervals) interval = {interval.neighbour, -interval.end, -interval.begin};
  return intervals;
}

std::vector<Overlay::Interval> Overlay::intervals_of_model(int bone, BoneEnd end) const {
  const int own = model_bone(bone);
  const BoneEnd own_end = model_end(bone, end);
  const std::vector<PosedBound> bounds = posed_planes_.bounds(own, own_end);
  std::vector<Interval> intervals;
  for (std::size_t i = 0; i < bounds.size(); ++i) {
    const SeamArc& arc = model_->arcs[model_->ends[own][static_cast<int>(own_end)].arcs[i].arc];
    intervals.push_back({bones_here_[arc.bones[0] == own ? arc.bones[1] : arc.bones[0]], bounds[i].turn,
                         i + 1 < bounds.size() ? bounds[i + 1].turn : bounds[0].turn + 1});
  }
  return intervals;
}

void Overlay::set_seams(const SeparationPlanes& separation, const SeamNetwork& network) {
  for (int bone = 0; bone < static_cast<int>(loops_.size()); ++bone)
    for (const BoneEnd end : {BoneEnd::kHead, BoneEnd::kTail}) {
      std::vector<Bound>& bounds = loops_[bone][static_cast<int>(end)].bounds;
      bounds.clear();
      const std::vector<ArcUse>& uses = network.ends[bone][static_cast<int>(end)].arcs;
      if (!uses.empty() && !network.arcs[uses[0].arc].is_closed())
        bounds = paired_bounds<Bound>(intervals_here(bone, end, separation, network), intervals_of_model(bone, end));
      if (!bounds.empty()) continue;
      // A rotation: that of the posed frame, in a separation plane between two bones with its roll.
      const BoneBasis& posed = posed_planes_.bases()[model_bone(bone)];
      const Vec3& s = separation.bases()[bone].s;
      const double zero = std::atan2(s.dot(posed.b), s.dot(posed.s)) / (2 * std::numbers::pi);
      const std::vector<PosedBound> rolls = posed_planes_.bounds(model_bone(bone), model_end(bone, end));
      bounds.push_back({0, (rolls.size() == 1 ? rolls[0].roll : 0) - zero});
    }
}

void Overlay::place_points(int bone, BoneEnd end, const TracedSeams::End& traced) {
  if (traced.turns.empty()) return;
  Loop& loop = loops_[bone][static_cast<int>(end)];
  const std::vector<Interval> intervals = intervals_of_model(bone, end);
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

double Overlay::model_turn(int bone, BoneEnd end, double turn) const {
  const Loop& at = loop(bone, end);
  return along_bounds(at.bounds, &Bound::here, &Bound::turn, is_reversed(bone) ? -turn : turn);
}

double Overlay::turn_here(int bone, BoneEnd end, double model_turn) const {
  const Loop& at = loop(bone, end);
  const double here = along_bounds(at.bounds, &Bound::turn, &Bound::here, model_turn);
  return is_reversed(bone) ? -here : here;
}

Overlay::SeamPoint Overlay::seam_at(int bone, BoneEnd end, double turn) const {
  const LoopPoint point = point_at(loop(bone, end).points, &LoopPoint::turn, model_turn(bone, end, turn));
  return {is_reversed(bone) ? -point.turn_offset : point.turn_offset, point.distance};
}

double Overlay::model_v(int bone, BoneEnd end, double v) const {
  const std::vector<LoopPoint>& here = loops_here_[bone][static_cast<int>(end)];
  if (here.empty()) return model_turn(bone, end, v);
  return point_at(loop(bone, end).points, &LoopPoint::turn,
                  model_turn(bone, end, point_at(here, &LoopPoint::v, v).turn))
      .v;
}

double Overlay::slope_at(int bone, BoneEnd end, double model_turn) const {
  const double slope = separation_.slope(model_bone(bone), model_end(bone, end), model_turn);
  return is_reversed(bone) ? -slope : slope;
}

Vec3 Overlay::end_texel(int bone, BoneEnd end, double v) const {
  const std::vector<LoopPoint>& here = loops_here_[bone][static_cast<int>(end)];
  const LoopPoint point =
      point_at(loop(bone, end).points, &LoopPoint::turn, model_turn(bone, end, point_at(here, &LoopPoint::v, v).turn));
  Vec3 texel = seam_texel(model_->skeleton, separation_, model_bone(bone), model_end(bone, end), point);
  if (is_reversed(bone)) texel.head<2>() = -texel.head<2>();
  return texel;
}

Vec3 Overlay::end_texel_here(const Skeleton& here, const SeparationPlanes& separation, int bone, BoneEnd end,
                             double v) const {
  return seam_texel(here, separation, bone, end, point_at(loops_here_[bone][static_cast<int>(end)], &LoopPoint::v, v));
}

std::vector<double> Overlay::arc_places(int bone, BoneEnd end, int arc) const {
  const Loop& at = loop(bone, end);
  const int count = static_cast<int>(at.points.size());
  int first = 0, samples = 0;
  while (at.arcs[first] != arc) ++first;
  while (first + samples < count && at.arcs[first + samples] == arc) ++samples;
  const bool is_closed = model_->arcs[arc].is_closed();
  const int last = first + samples;
  const double begin = is_closed ? 0 : at.points[first - 1].turn,
               width = is_closed ? 1 : (last < count ? at.points[last].turn : at.points[0].turn + 1) - begin;
  std::vector<double> places;
  for (int i = 0; i < samples; ++i) {
    const double share = width > kNoWidth ? (at.points[first + i].turn - begin) / width : (i + 1.0) / (samples + 1.0);
    places.push_back(is_closed           ? turn_here(bone, end, at.points[first + i].turn)
                     : is_reversed(bone) ? 1 - share
                                         : share);
  }
  if (is_reversed(bone)) std::reverse(places.begin(), places.end());
  return places;
}

std::vector<double> Overlay::own_turns(int bone, BoneEnd end, int arc) const {
  const Loop& at = loop(bone, end);
  std::vector<double> turns;
  for (std::size_t i = 0; i < at.points.size(); ++i)
    if (at.arcs[i] == arc) turns.push_back(at.points[i].turn);
  return turns;
}

int Overlay::model_arc(int node, int first_bone, int second_bone) const {
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
