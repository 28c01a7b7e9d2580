// SPDX-License-Identifier: MIT
#include "skeletex/compact/encode/encode_seams.h"

#include <algorithm>
#include <cmath>

#include "skeletex/compact/encode/rounding.h"
#include "skeletex/compact/skeleton_code.h"

namespace skeletex {
namespace {

/// A polyline with a place for each of its points: 0 to their number less 1, or round and round.
struct Curve {
  std::vector<Vec2> points;
  bool is_closed = false;
  const Vec2& vertex(int i) const {
    const int count = static_cast<int>(points.size());
    return points[is_closed ? (i % count + count) % count : std::clamp(i, 0, count - 1)];
  }
  Vec2 at(double place) const {
    const int i = static_cast<int>(std::floor(place));
    return vertex(i) + (place - i) * (vertex(i + 1) - vertex(i));
  }
};

/// Where a line meets the curve nearest to a place, and how far along the line.
struct CurveMeeting {
  double place = 0, distance = 0;
  bool is_found = false;
};
CurveMeeting meet_line(const Curve& curve, double start, double reach, const Vec2& origin, const Vec2& direction) {
  CurveMeeting best;
  for (int i = static_cast<int>(std::floor(start - reach)); i <= static_cast<int>(std::floor(start + reach)); ++i) {
    const Vec2 a = curve.vertex(i) - origin, edge = curve.vertex(i + 1) - curve.vertex(i);
    const double across = direction[0] * edge[1] - direction[1] * edge[0];
    if (across == 0) continue;
    const double t = -(direction[0] * a[1] - direction[1] * a[0]) / across, place = i + t;
    if (t < 0 || t > 1 || std::abs(place - start) > reach) continue;
    if (!best.is_found || std::abs(place - start) < std::abs(best.place - start))
      best = {place, (a + t * edge).dot(direction), true};
  }
  return best;
}

void encode_arc(const CompactModel& compact, CompactArc& arc, const ArcPlane& plane, const Curve& curve,
                const std::vector<Vec3>& corners, int bare_steps, double rounding) {
  const double q = seam_step(compact.step), period = static_cast<double>(curve.points.size());
  std::vector<double> places{0, period - 1};
  arc.base.clear();
  if (arc.is_closed()) {
    places.clear();
    for (int k = 0; k < 4; ++k) {
      places.push_back(k / 4.0 * period);
      for (int axis = 0; axis < 2; ++axis) arc.base.push_back(rounded(curve.at(places[k])[axis] / q));
    }
  }
  std::vector<Vec2> decoded = coarse_curve(compact, arc, plane, corners);
  arc.steps.clear();
  for (int step = 0; step < arc.step_count - bare_steps; ++step) {
    StepResiduals residuals;
    std::vector<Vec2> added;
    std::vector<double> fine_places;
    bool has_side = false;
    for (const CurveSite& site : curve_sites(decoded, arc.is_closed())) {
      const double from = places[site.parents[0]];
      double to = places[site.parents[1]];
      if (to <= from) to += period;
      double place = (from + to) / 2, distance = 0;
      const double reach = 0.25 * (to - from);
      auto found = meet_line(curve, place, reach, site.predicted, site.normal);
      int side = 0;
      if (!found.is_found || step == 0) {
        const Vec2 offset = curve.at(place) - site.predicted;
        side = rounded(offset.dot(site.side) / (8 * q));
        distance = offset.dot(site.normal);
        found = meet_line(curve, place, reach, site.predicted + 8 * q * side * site.side, site.normal);
      }
      if (found.is_found) {
        place = found.place;
        distance = found.distance;
      }
      const int normal = rounded_towards_zero(distance / q, rounding);
      residuals.normal.push_back(normal);
      residuals.side.push_back(side);
      has_side = has_side || side != 0;
      added.push_back(site.predicted + q * normal * site.normal + 8 * q * side * site.side);
      fine_places.push_back(from);
      fine_places.push_back(place);
    }
    if (!arc.is_closed()) fine_places.push_back(places.back());
    if (!has_side) residuals.side.clear();
    decoded = refined_curve(decoded, added);
    places = std::move(fine_places);
    arc.steps.push_back(std::move(residuals));
  }
}

}  // namespace

void encode_seams(CompactModel& compact, const SeparationPlanes& separation, const SourceSurface& source,
                  int bare_steps, double rounding) {
  std::vector<Vec3> corners;
  for (std::size_t i = 0; i < compact.corners.size(); ++i) {
    CompactCorner& corner = compact.corners[i];
    const BoneIndex bone = corner.bones[0];
    const BoneEnd end = end_at(compact.skeleton, bone, corner.node);
    const Vec3& point = source.corners[i];
    corner.turn =
        rounded(separation.turn_of(bone, point - compact.skeleton.nodes[corner.node].position) * kAngleSteps) %
        kAngleSteps;
    corner.distance = rounded(separation.half_line_distance(bone, end, point) / seam_step(compact.step));
    corners.push_back(corner_point(compact, separation, corner));
  }
  for (std::size_t i = 0; i < compact.arcs.size(); ++i) {
    CompactArc& arc = compact.arcs[i];
    const ArcPlane plane = arc_plane(compact.skeleton, separation, arc.node, arc.bones);
    Curve curve{{}, arc.is_closed()};
    for (const Vec3& point : source.arcs[i]) curve.points.push_back(plane.coordinates(point));
    encode_arc(compact, arc, plane, curve, corners, bare_steps, rounding);
  }
}

}  // namespace skeletex
