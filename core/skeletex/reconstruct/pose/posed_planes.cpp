// SPDX-License-Identifier: MIT
#include "skeletex/reconstruct/pose/posed_planes.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "skeletex/geometry/best_rotation.h"
#include "skeletex/model/frame.h"

namespace skeletex {
namespace {

constexpr double kTwoPi = 2 * std::numbers::pi;
constexpr int kTrackingSteps = 64;  // three bones at a node need no tracking: their arcs are always half a turn
constexpr double kThinArc = 1e-3;   // turns; samples on thinner arcs are spread by their number, not by their angle

/// Into [-1/2, 1/2).
double wrapped(double turns) { return turns - std::floor(turns + 0.5); }

/// Into [0, 1).
double folded(double turns) { return turns - std::floor(turns); }

double turn_about(const BoneBasis& basis, const Vec3& direction) {
  return std::atan2(direction.dot(basis.b), direction.dot(basis.s)) / kTwoPi;
}

Vec3 radial_of(const BoneBasis& basis, double turn) {
  return std::cos(kTwoPi * turn) * basis.s + std::sin(kTwoPi * turn) * basis.b;
}

/// x at which the line radial direction + x o meets the plane through the node with that normal. Bones that lie on each
/// other have no separation plane; the bound keeps the result finite.
double meet(const BoneBasis& basis, const Vec3& radial, const Vec3& normal) {
  const double across = basis.o.dot(normal);
  return -radial.dot(normal) / (std::abs(across) > 1e-6 ? across : std::copysign(1e-6, across));
}

Vec3 plane_normal(const Vec3& from_first, const Vec3& from_second) {
  const Vec3 n = from_first - from_second;
  return n.norm() > 1e-12 ? Vec3(n.normalized()) : from_first.unitOrthogonal();
}

Vec3 triple_axis(const Vec3& a, const Vec3& b, const Vec3& c) { return (a - b).cross(a - c); }

/// Angle from one direction to another about an axis, turns.
double turns_between(const Vec3& axis, const Vec3& from, const Vec3& to) {
  const Vec3 p = from - axis.dot(from) * axis, q = to - axis.dot(to) * axis;
  return std::atan2(axis.dot(p.cross(q)), p.dot(q)) / kTwoPi;
}

}  // namespace

PosedPlanes::PosedPlanes(const SkeletexModel& model, const Skeleton& posed)
    : model_(&model),
      posed_(&posed),
      bind_bases_(bone_bases(model.skeleton)),
      bases_(bone_bases(posed)),
      bind_longest_(model.skeleton.nodes.size(), 0),
      longest_(model.skeleton.nodes.size(), 0),
      arcs_(model.arcs.size()),
      bind_corners_(model.corners.size(), Vec3::Zero()),
      corners_(model.corners.size(), Vec3::Zero()),
      loops_(model.skeleton.bones.size()) {
  for (BoneIndex bone = 0; bone < static_cast<int>(model.skeleton.bones.size()); ++bone)
    for (const NodeIndex node : {model.skeleton.bones[bone].head, model.skeleton.bones[bone].tail}) {
      bind_longest_[node] = std::max(bind_longest_[node], bone_length(model.skeleton, bone));
      longest_[node] = std::max(longest_[node], bone_length(posed, bone));
    }
  std::vector<std::vector<int>> arcs_at(model.skeleton.nodes.size());
  for (int a = 0; a < static_cast<int>(arcs_.size()); ++a) {
    const SeamArc& seam = model.arcs[a];
    Arc& arc = arcs_[a];
    arc.is_closed = seam.is_closed();
    arc.bind_normal = plane_normal(bind_direction(seam.bones[0], seam.node), bind_direction(seam.bones[1], seam.node));
    arc.normal = plane_normal(posed_direction(seam.bones[0], seam.node), posed_direction(seam.bones[1], seam.node));
    for (const int side : {0, 1}) {
      arc.sides[side].bone = seam.bones[side];
      arc.sides[side].end = end_at(model.skeleton, seam.bones[side], seam.node);
    }
    // The separation plane reflects: seen from the other bone the angle runs on where a tail meets a head, back where
    // two heads meet.
    arc.sides[1].sign = arc.sides[0].end == arc.sides[1].end ? -1 : 1;
    if (arc.is_closed)
      join_linear(arc);
    else
      arcs_at[seam.node].push_back(a);
  }
  for (NodeIndex node = 0; node < static_cast<int>(arcs_at.size()); ++node)
    if (!arcs_at[node].empty()) build_node(node, arcs_at[node]);
  for (BoneIndex bone = 0; bone < static_cast<int>(loops_.size()); ++bone)
    for (const BoneEnd end : {BoneEnd::kHead, BoneEnd::kTail}) wind_loop(bone, end);
}

Vec3 PosedPlanes::bind_direction(BoneIndex bone, NodeIndex node) const {
  return model_->skeleton.bones[bone].head == node ? bind_bases_[bone].o : Vec3(-bind_bases_[bone].o);
}

Vec3 PosedPlanes::posed_direction(BoneIndex bone, NodeIndex node) const {
  return posed_->bones[bone].head == node ? bases_[bone].o : Vec3(-bases_[bone].o);
}

void PosedPlanes::join_linear(Arc& arc) {
  // v_1 = sign v_0 + offset; both bones take half of what the offset changes by.
  const auto offset = [&](const std::vector<BoneBasis>& bases, const Vec3& normal) {
    const Vec3& s = bases[arc.sides[0].bone].s;
    return turn_about(bases[arc.sides[1].bone], s - 2 * s.dot(normal) * normal);
  };
  arc.sides[1].begin = offset(bind_bases_, arc.bind_normal);
  const double twist = wrapped(offset(bases_, arc.normal) - arc.sides[1].begin);
  arc.sides[0].rolls.fill(-arc.sides[1].sign * twist / 2);
  arc.sides[1].rolls.fill(twist / 2);
}

PosedPlanes::NodeSphere PosedPlanes::sphere_of(NodeIndex node, const std::vector<int>& arcs) const {
  NodeSphere sphere;
  sphere.arcs = arcs;
  for (const int a : arcs)
    for (const int c : model_->arcs[a].corners)
      if (std::find(sphere.corners.begin(), sphere.corners.end(), c) == sphere.corners.end())
        sphere.corners.push_back(c);
  sphere.place_of.assign(loops_.size(), -1);
  const auto add_bone = [&](BoneIndex bone) {
    if (sphere.place_of[bone] >= 0) return;
    sphere.place_of[bone] = static_cast<int>(sphere.bind.size());
    sphere.bind.push_back(bind_direction(bone, node));
    sphere.posed.push_back(posed_direction(bone, node));
  };
  for (const int a : arcs)
    for (const BoneIndex bone : model_->arcs[a].bones) add_bone(bone);
  for (const int c : sphere.corners)
    for (const BoneIndex bone : model_->corners[c].bones) add_bone(bone);
  return sphere;
}

/// The three bones of a corner whose axis is best defined, and the side where the corner's stored angle lies.
PosedPlanes::Triple PosedPlanes::triple_of(const NodeSphere& sphere, int c) const {
  const SeamCorner& corner = model_->corners[c];
  std::vector<int> places;
  for (const BoneIndex bone : corner.bones) places.push_back(sphere.place_of[bone]);
  const auto axis_of = [&](const std::array<int, 3>& bones) {
    return triple_axis(sphere.bind[bones[0]], sphere.bind[bones[1]], sphere.bind[bones[2]]);
  };
  Triple best;
  double longest = -1;
  for (std::size_t i = 0; i < places.size(); ++i)
    for (std::size_t j = i + 1; j < places.size(); ++j)
      for (std::size_t k = j + 1; k < places.size(); ++k) {
        const std::array<int, 3> bones{places[i], places[j], places[k]};
        const double length = axis_of(bones).norm();
        if (length > longest) longest = length, best.bones = bones;
      }
  if (axis_of(best.bones).dot(radial_of(bind_bases_[corner.bones[0]], corner.sample.turn)) < 0) best.sign = -1;
  return best;
}

/// Follows the lengths of arcs on the way from the bind directions to the posed ones, so that whole turns and signs are
/// those of a continuous motion: around every bone they keep adding up to one turn.
void PosedPlanes::track_arcs(const NodeSphere& sphere, const std::vector<Triple>& triples) {
  const std::vector<Vec3>&bind = sphere.bind, &posed = sphere.posed;
  Eigen::Matrix3d moment = Eigen::Matrix3d::Zero();
  for (std::size_t i = 0; i < bind.size(); ++i) moment += posed[i] * bind[i].transpose();
  const Eigen::Quaterniond turned_back(Eigen::Matrix3d(best_rotation(moment).transpose()));
  std::vector<Eigen::Quaterniond> motions;
  for (std::size_t i = 0; i < bind.size(); ++i)
    motions.push_back(Eigen::Quaterniond::FromTwoVectors(bind[i], turned_back * posed[i]));
  std::vector<Vec3> at;  // the corners on the way
  std::vector<int> corner_place(corners_.size(), -1);
  for (const int c : sphere.corners) {
    corner_place[c] = static_cast<int>(at.size());
    at.push_back(bind_corners_[c]);
  }
  const auto turns_of = [&](int a, const std::vector<Vec3>& directions) {
    const SeamArc& seam = model_->arcs[a];
    const double sign = arcs_[a].sides[0].end == BoneEnd::kHead ? 1 : -1;
    return turns_between(sign * directions[sphere.place_of[seam.bones[0]]], at[corner_place[seam.corners[0]]],
                         at[corner_place[seam.corners[1]]]);
  };
  for (const int a : sphere.arcs) {
    const double turns = turns_of(a, bind);
    arcs_[a].bind_turns = turns < -0.25 ? turns + 1 : turns;  // cells are convex: half a turn at most
    arcs_[a].posed_turns = arcs_[a].bind_turns;
  }
  std::vector<Vec3> directions = bind;
  const int steps = bind.size() > 3 ? kTrackingSteps : 1;
  for (int step = 1; step <= steps; ++step) {
    for (std::size_t i = 0; i < bind.size(); ++i)
      directions[i] =
          step == steps
              ? Vec3(turned_back * posed[i])
              : Vec3(Eigen::Quaterniond::Identity().slerp(static_cast<double>(step) / steps, motions[i]) * bind[i]);
    for (std::size_t i = 0; i < at.size(); ++i) {
      const Vec3 axis = triple_axis(directions[triples[i].bones[0]], directions[triples[i].bones[1]],
                                    directions[triples[i].bones[2]]);
      if (axis.norm() > 1e-9) at[i] = triples[i].sign * axis.normalized();
    }
    for (const int a : sphere.arcs) arcs_[a].posed_turns += wrapped(turns_of(a, directions) - arcs_[a].posed_turns);
  }
  for (std::size_t i = 0; i < at.size(); ++i) corners_[sphere.corners[i]] = turned_back.conjugate() * at[i];
}

void PosedPlanes::build_node(NodeIndex node, const std::vector<int>& arcs) {
  const NodeSphere sphere = sphere_of(node, arcs);
  std::vector<Triple> triples;
  for (const int c : sphere.corners) {
    const auto& [bones, sign] = triples.emplace_back(triple_of(sphere, c));
    bind_corners_[c] =
        sign * triple_axis(sphere.bind[bones[0]], sphere.bind[bones[1]], sphere.bind[bones[2]]).normalized();
  }
  track_arcs(sphere, triples);
  for (const int a : arcs)
    for (Side& side : arcs_[a].sides) {
      const int first = model_->arcs[a].corners[0];
      side.begin = folded(turn_about(bind_bases_[side.bone], bind_corners_[first]));
      side.rolls[0] = wrapped(turn_about(bases_[side.bone], corners_[first]) - side.begin);
      side.rolls[1] = side.rolls[0] + side.sign * (arcs_[a].posed_turns - arcs_[a].bind_turns);
    }
}

void PosedPlanes::wind_loop(BoneIndex bone, BoneEnd end) {
  Loop& loop = loops_[bone][static_cast<int>(end)];
  double start = 0, length = 0, winding = 0, mean = 0;
  for (const ArcUse use : model_->ends[bone][static_cast<int>(end)].arcs) {
    Arc& arc = arcs_[use.arc];
    const int s = arc.sides[0].bone == bone && arc.sides[0].end == end ? 0 : 1;
    Side& side = arc.sides[s];
    const int first = side.sign > 0 ? 0 : 1;
    if (loop.intervals.empty()) {
      loop.base = folded(side.begin + (first == 0 ? 0 : side.sign * arc.bind_turns));
      winding = side.rolls[first];
    }
    // Whole turns: the roll runs on from arc to arc.
    const double shift = std::round(winding - side.rolls[first]);
    for (double& roll : side.rolls) roll += shift;
    winding = side.rolls[1 - first];
    mean += std::max(0.0, arc.bind_turns) * (side.rolls[0] + side.rolls[1]) / 2;
    loop.intervals.push_back({std::min(start, 1.0), use.arc, s});
    length += arc.bind_turns;
    start = std::max(start, length);
  }
  const double shift = std::round(mean);
  if (shift != 0)
    for (const Interval& interval : loop.intervals)
      for (double& roll : arcs_[interval.arc].sides[interval.side].rolls) roll -= shift;
}

const PosedPlanes::Interval* PosedPlanes::interval_at(BoneIndex bone, BoneEnd end, double turn, double& t) const {
  const Loop& loop = loops_[bone][static_cast<int>(end)];
  if (loop.intervals.empty()) return nullptr;
  const double x = folded(turn - loop.base);
  std::size_t i = loop.intervals.size() - 1;
  while (i > 0 && loop.intervals[i].start > x) --i;
  const Interval& interval = loop.intervals[i];
  const double length = (i + 1 < loop.intervals.size() ? loop.intervals[i + 1].start : 1) - interval.start;
  t = length > 0 ? std::clamp((x - interval.start) / length, 0.0, 1.0) : 0.5;
  if (arcs_[interval.arc].sides[interval.side].sign < 0) t = 1 - t;
  return &interval;
}

std::vector<PosedBound> PosedPlanes::bounds(BoneIndex bone, BoneEnd end) const {
  const Loop& loop = loops_[bone][static_cast<int>(end)];
  std::vector<PosedBound> bounds;
  for (const Interval& interval : loop.intervals) {
    const Arc& arc = arcs_[interval.arc];
    const Side& side = arc.sides[interval.side];
    const BoneBasis& basis = bases_[bone];
    const int first = side.sign > 0 ? 0 : 1;
    bounds.push_back({loop.base + interval.start, side.rolls[first], side.rolls[1 - first],
                      meet(basis, basis.s, arc.normal), meet(basis, basis.b, arc.normal)});
  }
  return bounds;
}

PosedRadial PosedPlanes::radial_on(const Arc& arc, int s, double t, double turn) const {
  const Side& side = arc.sides[s];
  PosedRadial result;
  result.roll = (1 - t) * side.rolls[0] + t * side.rolls[1];
  result.slope = meet(bases_[side.bone], radial_of(bases_[side.bone], turn + result.roll), arc.normal);
  return result;
}

PosedRadial PosedPlanes::radial(BoneIndex bone, BoneEnd end, double turn) const {
  double t = 0;
  const Interval* interval = interval_at(bone, end, turn, t);
  return interval ? radial_on(arcs_[interval->arc], interval->side, t, turn) : PosedRadial{};
}

Vec3 PosedPlanes::sample_point(ArcIndex a, int sample, DistanceRule rule, int s) const {
  const SeamArc& seam = model_->arcs[a];
  const Arc& arc = arcs_[a];
  const Side& side = arc.sides[s];
  const SeamSample& stored = seam.samples[sample];
  double t = 0, turn = stored.turn;
  if (arc.is_closed) {
    if (s == 1) turn = side.sign * turn + side.begin;
  } else {
    const double passed = wrapped(turn - arc.sides[0].begin - arc.bind_turns / 2) + arc.bind_turns / 2;
    t = arc.bind_turns > kThinArc ? std::clamp(passed / arc.bind_turns, 0.0, 1.0)
                                  : (sample + 1.0) / (static_cast<double>(seam.samples.size()) + 1);
    if (s == 1) turn = side.begin + side.sign * passed;
  }
  const auto in_separation_plane = [&](const BoneBasis& basis, double angle, const Vec3& normal) -> Vec3 {
    const Vec3 radial = radial_of(basis, angle);
    return (radial + meet(basis, radial, normal) * basis.o).normalized();
  };
  const Vec3 bound = in_separation_plane(bind_bases_[side.bone], turn, arc.bind_normal);
  const Vec3 direction = in_separation_plane(bases_[side.bone], turn + radial_on(arc, s, t, turn).roll, arc.normal);
  return posed_->nodes[seam.node].position +
         radius_at(seam.node, side.bone, stored.distance, bound, direction, rule) * direction;
}

Vec3 PosedPlanes::corner_point(int c, DistanceRule rule) const {
  const SeamCorner& corner = model_->corners[c];
  const double radius =
      radius_at(corner.node, corner.bones[0], corner.sample.distance, bind_corners_[c], corners_[c], rule);
  return posed_->nodes[corner.node].position + radius * corners_[c];
}

double PosedPlanes::radius_at(NodeIndex node, BoneIndex bone, double distance, const Vec3& bound, const Vec3& direction,
                              DistanceRule rule) const {
  // The bind point from the half-line's distance, its distance to the bone as extended, and out of the posed capsule.
  const double cosine = bound.dot(bind_direction(bone, node));
  const double bind_radius = cosine > 0 ? distance / std::sqrt(std::max(1e-12, 1 - cosine * cosine)) : distance;
  if (rule == DistanceRule::kFromFoot) return bind_radius;
  const double past = bind_radius * cosine - bind_longest_[node];
  const double along = direction.dot(posed_direction(bone, node));
  return leave_capsule(0, along, std::sqrt(std::max(0.0, 1 - along * along)),
                       past > 0 ? std::hypot(distance, past) : distance, 0, longest_[node]);
}

}  // namespace skeletex
