// SPDX-License-Identifier: MIT
#include "skeletex/skeletonize/body/tips.h"

#include <algorithm>

namespace skeletex {

std::vector<int> find_tips(const VoxelBody& body, const BodyPaths& paths, const TipRule& rule, double diagonal) {
  std::vector<int> order(body.size());
  for (int v = 0; v < body.size(); ++v) order[v] = v;
  std::sort(order.begin(), order.end(), [&](int a, int b) {
    return paths.distances[a] != paths.distances[b] ? paths.distances[a] > paths.distances[b] : a < b;
  });
  std::vector<char> is_covered(body.size(), 0), is_on_path(body.size(), 0);
  for (const int root : paths.roots) is_on_path[root] = 1;
  std::vector<int> tips, path = paths.roots;
  const auto cover = [&] {
    std::vector<PathSource> sources;
    for (const int v : path)
      sources.push_back(
          {v, -(std::max(rule.covered_radii * body.radii[v], rule.least_covered * diagonal) + 2 * body.side)});
    const std::vector<double> reached = distances_through(body, sources, {}, 0);
    for (int v = 0; v < body.size(); ++v) is_covered[v] |= reached[v] <= 0;
  };
  cover();
  for (const int tip : order) {
    if (is_covered[tip]) continue;
    path.clear();
    double length = 0;
    int at = tip;
    for (; !is_on_path[at]; at = paths.parents[at]) {
      path.push_back(at);
      length += (body.centres[at] - body.centres[paths.parents[at]]).norm();
    }
    const double radius = body.radii[at];
    if (length > rule.longer_than_wide * radius + 2 * body.side && length - radius > rule.least_length * diagonal) {
      tips.push_back(tip);
      for (const int v : path) is_on_path[v] = 1;
    }
    if (static_cast<int>(tips.size()) == kMostTips) break;
    cover();
  }
  return tips;
}

/// A way through the body may be longer than the straight one by so much: limbs are bent, and ways go from voxel to
/// voxel.
constexpr double kDetour = 1.5;

std::vector<LimbTip> places_near(const VoxelBody& body, const std::vector<int>& tips, double reach) {
  std::vector<LimbTip> result;
  for (const int tip : tips) {
    const PathSource source{tip, 0};
    result.push_back({body.centres[tip], reach + body.radii[tip], {}, body.side});
    const double longest = kDetour * result.back().reach;
    const std::vector<double> distances = distances_through(body, {&source, 1}, {}, longest);
    for (int v = 0; v < body.size(); ++v)
      if (distances[v] <= longest) result.back().places.push_back(body.centres[v]);
  }
  return result;
}

int count_reached(const std::vector<LimbTip>& tips, const Skeleton& skeleton) {
  constexpr double kSidesAround = 1.5;  // the voxel around a node, or one beside it, has its centre so near
  const auto is_near = [&](const LimbTip& tip, const Vec3& node) {
    return (node - tip.position).norm() < tip.reach &&
           std::any_of(tip.places.begin(), tip.places.end(),
                       [&](const Vec3& place) { return (node - place).norm() < kSidesAround * tip.voxel_side; });
  };
  return static_cast<int>(std::count_if(tips.begin(), tips.end(), [&](const LimbTip& tip) {
    return std::any_of(skeleton.nodes.begin(), skeleton.nodes.end(),
                       [&](const Node& node) { return is_near(tip, node.position); });
  }));
}

std::vector<int> find_ends(const VoxelBody& body) {
  const auto farthest_from = [&](int voxel) {
    const PathSource source{voxel, 0};
    const std::vector<double> distances = distances_through(body, {&source, 1});
    return static_cast<int>(std::max_element(distances.begin(), distances.end()) - distances.begin());
  };
  const int first = farthest_from(0);
  return {first, farthest_from(first)};
}

}  // namespace skeletex
