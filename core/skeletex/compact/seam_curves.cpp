// SPDX-License-Identifier: MIT
#include "skeletex/compact/seam_curves.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "skeletex/compact/refine.h"
#include "skeletex/geometry/loop_turns.h"
#include "skeletex/model/error.h"

namespace skeletex {

ArcPlane arc_plane(const Skeleton& skeleton, const SeparationPlanes& separation, NodeIndex node,
                   const std::array<BoneIndex, 2>& bones) {
  const auto away = [&](BoneIndex bone) { return direction_from(skeleton, {bone, end_at(skeleton, bone, node)}); };
  const Vec3 normal = (away(bones[0]) - away(bones[1])).normalized();
  const BoneBasis& basis = separation.bases()[bones[0]];
  const Vec3 s = basis.s - basis.s.dot(normal) * normal, b = basis.b - basis.b.dot(normal) * normal;
  ArcPlane plane;
  plane.node = skeleton.nodes[node].position;
  plane.x = s.squaredNorm() >= 0.25 ? s.normalized() : b.normalized();
  plane.y = normal.cross(plane.x);
  return plane;
}

std::vector<CurveSite> curve_sites(const std::vector<Vec2>& points, bool is_closed) {
  const int count = static_cast<int>(points.size()), intervals = is_closed ? count : count - 1;
  std::vector<CurveSite> sites(intervals);
  for (int i = 0; i < intervals; ++i) {
    const auto at = [&](int k) -> const Vec2& { return points[((i + k) % count + count) % count]; };
    const int before = is_closed ? 3 : std::min(3, i + 1), after = is_closed ? 3 : std::min(3, count - 1 - i);
    CurveSite& site = sites[i];
    site.parents = {i, (i + 1) % count};
    site.predicted = halfway<Vec2>(at, before, after);
    const Vec2 chord = at(1) - at(0);
    const double length = chord.norm();
    site.side = length > 0 ? Vec2(chord / length) : Vec2(1, 0);
    site.normal = {-site.side[1], site.side[0]};
  }
  return sites;
}

std::vector<Vec2> refined_curve(const std::vector<Vec2>& points, const std::vector<Vec2>& added) {
  std::vector<Vec2> fine;
  for (std::size_t i = 0; i < points.size(); ++i) {
    fine.push_back(points[i]);
    if (i < added.size()) fine.push_back(added[i]);
  }
  return fine;
}

Vec3 corner_point(const CompactModel& model, const SeparationPlanes& separation, const CompactCorner& corner) {
  const BoneIndex bone = corner.bones[0];
  return separation.seam_point(bone, end_at(model.skeleton, bone, corner.node), corner.turn / 65536.0,
                               corner.distance * seam_step(model.step));
}

std::vector<Vec2> coarse_curve(const CompactModel& model, const CompactArc& arc, const ArcPlane& plane,
                               const std::vector<Vec3>& corners) {
  if (!arc.is_closed()) return {plane.coordinates(corners[arc.corners[0]]), plane.coordinates(corners[arc.corners[1]])};
  std::vector<Vec2> points;
  for (std::size_t i = 0; i < arc.base.size(); i += 2)
    points.push_back(seam_step(model.step) * Vec2(arc.base[i], arc.base[i + 1]));
  return points;
}

namespace {

/// A curve's next step.
/// \param residuals  null: it is its prediction alone
std::vector<Vec2> added_points(const std::vector<Vec2>& curve, bool is_closed, double q,
                               const StepResiduals* residuals) {
  std::vector<Vec2> added;
  for (const CurveSite& site : curve_sites(curve, is_closed)) {
    added.push_back(site.predicted);
    if (residuals == nullptr) continue;
    const std::size_t i = added.size() - 1;
    added[i] += q * residuals->normal[i] * site.normal;
    if (!residuals->side.empty()) added[i] += 8 * q * residuals->side[i] * site.side;
  }
  return added;
}

}  // namespace

SeamCurves decode_seams(const CompactModel& model, const SeparationPlanes& separation, int octaves) {
  SeamCurves seams;
  const double q = seam_step(model.step);
  for (const CompactCorner& corner : model.corners) seams.corners.push_back(corner_point(model, separation, corner));
  for (const CompactArc& arc : model.arcs) {
    const ArcPlane plane = arc_plane(model.skeleton, separation, arc.node, arc.bones);
    std::vector<Vec2> curve = coarse_curve(model, arc, plane, seams.corners);
    const int steps = std::max(arc.is_closed() ? 0 : 1, arc.step_count + octaves);
    for (int step = 0; step < steps; ++step) {
      const StepResiduals* residuals = step < static_cast<int>(arc.steps.size()) ? &arc.steps[step] : nullptr;
      curve = refined_curve(curve, added_points(curve, arc.is_closed(), q, residuals));
    }
    std::vector<Vec3>& points = seams.arcs.emplace_back();
    for (std::size_t i = arc.is_closed() ? 0 : 1; i + (arc.is_closed() ? 0 : 1) < curve.size(); ++i)
      points.push_back(plane.point(curve[i]));
  }
  return seams;
}

namespace {

/// An arc of an end, with the corners that it runs between as that end sees it.
struct Use {
  ArcUse use;
  int from, to;
};

/// The arcs of an end one after the other.
std::vector<ArcUse> chained(std::vector<Use> open, std::size_t bone) {
  std::vector<ArcUse> loop;
  if (open.empty()) return loop;
  const int first = open.front().from;
  int corner = first;
  do {
    const auto next = std::find_if(open.begin(), open.end(), [&](const Use& use) { return use.from == corner; });
    if (next == open.end()) throw IoError(fmt::format("the seams around bone {} do not close up", bone));
    loop.push_back(next->use);
    corner = next->to;
    open.erase(next);
  } while (corner != first && corner >= 0);
  if (!open.empty()) throw IoError(fmt::format("bone {} has several loops of seams at one end", bone));
  return loop;
}

}  // namespace

std::vector<std::array<PatchEnd, 2>> ends_of(const CompactModel& model) {
  std::vector<std::array<PatchEnd, 2>> ends(model.skeleton.bones.size());
  std::vector<std::array<std::vector<Use>, 2>> uses(ends.size());
  for (std::size_t i = 0; i < model.arcs.size(); ++i) {
    const CompactArc& arc = model.arcs[i];
    for (const std::size_t side : {0u, 1u}) {
      const auto end_of = [&](BoneIndex bone) { return static_cast<int>(end_at(model.skeleton, bone, arc.node)); };
      const int end = end_of(arc.bones[side]);
      // Angles about two bones run against each other when both begin, or both end, at the node.
      const bool is_reversed = side == 1 && end_of(arc.bones[0]) == end;
      uses[arc.bones[side]][end].push_back(
          {{static_cast<int>(i), is_reversed}, arc.corners[is_reversed ? 1 : 0], arc.corners[is_reversed ? 0 : 1]});
    }
  }
  for (std::size_t bone = 0; bone < ends.size(); ++bone)
    for (const int end : {0, 1}) ends[bone][end].arcs = chained(std::move(uses[bone][end]), bone);
  return ends;
}

std::vector<Vec3> end_row(const CompactModel& model, const SeparationPlanes& separation,
                          const std::vector<std::array<PatchEnd, 2>>& ends, const SeamCurves& seams, BoneIndex bone,
                          BoneEnd end, int columns) {
  const Vec3& node = end_position(model.skeleton, bone, end);
  const int side = static_cast<int>(end);
  if (ends[bone][side].arcs.empty()) {
    const BoneBasis& basis = separation.bases()[bone];
    const std::array<int, 3>& pole = model.patches[bone].poles[side];
    return std::vector<Vec3>(columns, node + model.step * (pole[0] * basis.s + pole[1] * basis.b + pole[2] * basis.o));
  }
  std::vector<Vec3> points;
  for (const ArcUse& use : ends[bone][side].arcs) {
    const CompactArc& arc = model.arcs[use.arc];
    const std::vector<Vec3>& inner = seams.arcs[use.arc];
    if (!arc.is_closed()) points.push_back(seams.corners[arc.corners[use.is_reversed ? 1 : 0]]);
    if (use.is_reversed)
      points.insert(points.end(), inner.rbegin(), inner.rend());
    else
      points.insert(points.end(), inner.begin(), inner.end());
  }
  std::vector<double> turns;
  for (const Vec3& point : points) turns.push_back(separation.turn_of(bone, point - node));
  std::vector<double> grown;
  if (const auto along = loop_turns(points, turns)) {
    grown = *along;
  } else {
    for (std::size_t i = 0; i < points.size(); ++i)
      grown.push_back(turns[0] + static_cast<double>(i) / static_cast<double>(points.size()));
  }
  return points_at_columns(points, grown, columns);
}

}  // namespace skeletex
