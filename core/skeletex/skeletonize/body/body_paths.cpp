// SPDX-License-Identifier: MIT
#include "skeletex/skeletonize/body/body_paths.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <queue>
#include <utility>

#include "skeletex/math/portable.h"

namespace skeletex {

std::vector<double> distances_through(const VoxelBody& body, std::span<const PathSource> sources,
                                      std::span<const double> costs, double bound, std::vector<int>* parents) {
  std::array<double, kVoxelPlaces> lengths{};
  for (int place = 0; place < kVoxelPlaces; ++place) lengths[place] = body.side * place_distance(place);
  std::vector<double> distances(body.size(), std::numeric_limits<double>::infinity());
  if (parents) parents->assign(body.size(), -1);
  using Entry = std::pair<double, int>;
  std::priority_queue<Entry, std::vector<Entry>, std::greater<>> open;
  for (const PathSource& source : sources)
    if (source.distance < distances[source.voxel]) {
      distances[source.voxel] = source.distance;
      open.emplace(source.distance, source.voxel);
    }
  while (!open.empty()) {
    const auto [distance, voxel] = open.top();
    open.pop();
    if (distance > distances[voxel]) continue;
    for (int place = 0; place < kVoxelPlaces; ++place) {
      const int next = body.neighbours[voxel][place];
      if (next < 0 || next == voxel) continue;
      const double reached = distance + lengths[place] * (costs.empty() ? 1 : costs[next]);
      if (reached >= distances[next] || reached > bound) continue;
      distances[next] = reached;
      if (parents) (*parents)[next] = voxel;
      open.emplace(reached, next);
    }
  }
  return distances;
}

std::vector<double> middle_costs(const VoxelBody& body) {
  const double deepest = *std::max_element(body.radii.begin(), body.radii.end());
  std::vector<double> costs;
  for (const double radius : body.radii) {
    const double depth = radius / deepest;
    costs.push_back((1 + 80 * portable::pow(1 - depth, 8)) / std::max(depth, 0.02));
  }
  return costs;
}

std::vector<int> path_between(const VoxelBody& body, std::span<const double> middle_costs, int from, int to) {
  std::vector<int> parents;
  const PathSource source{to, 0};
  distances_through(body, {&source, 1}, middle_costs, std::numeric_limits<double>::infinity(), &parents);
  std::vector<int> path;
  for (int at = from; at >= 0; at = parents[at]) path.push_back(at);
  return path;
}

int deepest_voxel(const VoxelBody& body) {
  return static_cast<int>(std::max_element(body.radii.begin(), body.radii.end()) - body.radii.begin());
}

BodyPaths find_paths(const VoxelBody& body, std::vector<int> roots) {
  BodyPaths paths;
  paths.roots = std::move(roots);
  std::vector<PathSource> sources;
  for (const int root : paths.roots) sources.push_back({root, 0});
  distances_through(body, sources, middle_costs(body), std::numeric_limits<double>::infinity(), &paths.parents);
  paths.distances = distances_through(body, sources);
  return paths;
}

}  // namespace skeletex
