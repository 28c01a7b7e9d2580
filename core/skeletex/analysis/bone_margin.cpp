// SPDX-License-Identifier: MIT
#include "skeletex/analysis/bone_margin.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "skeletex/geometry/parallel.h"

namespace skeletex {
namespace {

constexpr double kLeastMargin = -8;  // rays need not go further

/// Directions of the other bones at an end of a bone.
std::vector<Vec3> other_directions(const Skeleton& skeleton, const std::vector<std::vector<BoneAtNode>>& at_nodes,
                                   BoneIndex bone, BoneEnd end) {
  std::vector<Vec3> directions;
  for (const BoneAtNode& other : at_nodes[end_node(skeleton, bone, end)])
    if (other.bone != bone) directions.push_back(direction_from(skeleton, other));
  return directions;
}

/// The slope of the nearest separation plane, seen along the bone away from the node (see SeparationPlanes::slope).
double slope_of(const std::vector<Vec3>& others, const Vec3& away, const Vec3& radial) {
  double slope = -1e9;
  for (const Vec3& d : others) slope = std::max(slope, radial.dot(d) / std::max(1e-9, 1 - away.dot(d)));
  return slope;
}

/// Where the first of the rays along both planes leaves the body.
struct Exit {
  double rho = 0;
  int end = 0;
};
/// \param limit  what is farther counts as this far
/// \param least  below, it does not matter where
Exit first_exit(const TriangleMesh& mesh, const TriangleTree& tree, const std::array<Vec3, 2>& from,
                const std::array<Vec3, 2>& along, double limit, double least) {
  Exit exit{limit, 0};
  for (int e = 0; e < 2 && exit.rho > least; ++e) {
    exit.rho = std::min(exit.rho, 4 * tree.scale / along[e].norm());
    const double rho = find_first_hit(mesh, tree, from[e], along[e], exit.rho);
    if (rho < exit.rho) exit = {rho, e};
  }
  return exit;
}

}  // namespace

BoneMargin margin_of_bone(const TriangleMesh& mesh, const TriangleTree& tree, const Skeleton& skeleton,
                          const std::vector<std::vector<BoneAtNode>>& at_nodes, BoneIndex bone, int angles,
                          double stop_below) {
  BoneMargin result;
  const std::array<Vec3, 2> ends{end_position(skeleton, bone, BoneEnd::kHead),
                                 end_position(skeleton, bone, BoneEnd::kTail)};
  const double length = (ends[1] - ends[0]).norm();
  const Vec3 o = (ends[1] - ends[0]) / length, s = o.unitOrthogonal(), b = o.cross(s);
  const std::array<std::vector<Vec3>, 2> others{other_directions(skeleton, at_nodes, bone, BoneEnd::kHead),
                                                other_directions(skeleton, at_nodes, bone, BoneEnd::kTail)};
  double lean = 0;
  for (int i = 0; i < angles; ++i) {
    const double angle = 2 * std::numbers::pi * i / angles;
    const Vec3 radial = std::cos(angle) * s + std::sin(angle) * b;
    std::array<double, 2> slopes{0, 0};  // towards the other end
    for (int e = 0; e < 2; ++e) {
      if (!others[e].empty()) slopes[e] = slope_of(others[e], e == 0 ? o : Vec3(-o), radial);
      lean += std::hypot(1, slopes[e]) / (2 * angles);
    }
    const double closing = (slopes[0] + slopes[1]) / length;
    if (closing <= 0 || others[0].empty() || others[1].empty()) continue;
    const std::array<Vec3, 2> along{radial + slopes[0] * o, radial - slopes[1] * o};
    const Exit exit = first_exit(mesh, tree, ends, along, (1 - kLeastMargin) / closing, (1 - result.margin) / closing);
    if (1 - exit.rho * closing >= result.margin) continue;
    result.margin = 1 - exit.rho * closing;
    result.end = exit.end == 0 ? BoneEnd::kHead : BoneEnd::kTail;
    result.point = ends[exit.end] + exit.rho * along[exit.end];
    if (result.margin < stop_below) break;
  }
  result.lean = lean;
  return result;
}

std::vector<BoneMargin> bone_margins(const TriangleMesh& mesh, const TriangleTree& tree, const Skeleton& skeleton,
                                     int angles) {
  const auto at_nodes = bones_at_nodes(skeleton);
  std::vector<BoneMargin> margins(skeleton.bones.size());
  for_each_index(margins.size(), 8, [&](std::size_t b) {
    margins[b] = margin_of_bone(mesh, tree, skeleton, at_nodes, static_cast<int>(b), angles);
  });
  return margins;
}

}  // namespace skeletex
