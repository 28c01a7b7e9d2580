// SPDX-License-Identifier: MIT
#pragma once
#include <Eigen/Core>
#include <array>
#include <vector>

#include "skeletex/compact/compact_model.h"
#include "skeletex/model/texture.h"
#include "skeletex/skeleton/separation_planes.h"

namespace skeletex {

using Vec2 = Eigen::Vector2d;

/// Coordinates of a separation plane around its node.
struct ArcPlane {
  Vec3 node, x, y;
  Vec3 point(const Vec2& p) const { return node + p[0] * x + p[1] * y; }
  Vec2 coordinates(const Vec3& p) const { return {(p - node).dot(x), (p - node).dot(y)}; }
};
ArcPlane arc_plane(const Skeleton& skeleton, const SeparationPlanes& separation, NodeIndex node,
                   const std::array<BoneIndex, 2>& bones);

/// Step of seams and corners, from q.
inline double seam_step(double q) { return q; }

/// Where a step expects a new point of a curve: halfway between two others.
struct CurveSite {
  std::array<int, 2> parents{};
  Vec2 predicted, normal, side;  ///< unit directions
};
std::vector<CurveSite> curve_sites(const std::vector<Vec2>& points, bool is_closed);
/// The curve with new points between the old ones.
std::vector<Vec2> refined_curve(const std::vector<Vec2>& points, const std::vector<Vec2>& added);

/// All seams in space.
struct SeamCurves {
  std::vector<Vec3> corners;
  std::vector<std::vector<Vec3>> arcs;  ///< without the corners
};
Vec3 corner_point(const CompactModel& model, const SeparationPlanes& separation, const CompactCorner& corner);
/// An open arc's two ends, or a closed one's coarse points, in its plane.
std::vector<Vec2> coarse_curve(const CompactModel& model, const CompactArc& arc, const ArcPlane& plane,
                               const std::vector<Vec3>& corners);
/// \param octaves  halvings of the intervals beyond those of the model; may be negative
SeamCurves decode_seams(const CompactModel& model, const SeparationPlanes& separation, int octaves);

/// How the patches' ends run through the arcs.
/// \throw IoError when they do not close up
std::vector<std::array<PatchEnd, 2>> ends_of(const CompactModel& model);

/// The points of an end's first or last row.
std::vector<Vec3> end_row(const CompactModel& model, const SeparationPlanes& separation,
                          const std::vector<std::array<PatchEnd, 2>>& ends, const SeamCurves& seams, BoneIndex bone,
                          BoneEnd end, int columns);

}  // namespace skeletex
