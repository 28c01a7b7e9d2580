// SPDX-License-Identifier: MIT
#include "skeletex/io/gltf/weld.h"

#include <algorithm>
#include <numeric>

#include "skeletex/geometry/union_find.h"

namespace skeletex {

std::vector<int> weld_targets(const std::vector<Vec3>& points, double tolerance) {
  // Along one axis, so that each point meets only those within the tolerance there.
  std::vector<int> order(points.size());
  std::iota(order.begin(), order.end(), 0);
  // A slanted axis: points of a mesh often share a coordinate, seldom such a sum.
  Vec3 axis(1, 0.618034, 0.381966);
  axis.normalize();
  std::vector<double> along(points.size());
  for (std::size_t i = 0; i < points.size(); ++i) along[i] = axis.dot(points[i]);
  std::stable_sort(order.begin(), order.end(), [&](int a, int b) { return along[a] < along[b]; });
  UnionFind sets(static_cast<int>(points.size()));
  for (std::size_t i = 0; i < order.size(); ++i)
    for (std::size_t j = i + 1; j < order.size(); ++j) {
      if (along[order[j]] - along[order[i]] > tolerance) break;
      if ((points[order[j]] - points[order[i]]).norm() <= tolerance) sets.unite(order[i], order[j]);
    }
  std::vector<int> targets(points.size());
  for (int i = 0; i < static_cast<int>(points.size()); ++i) targets[i] = sets.find(i);
  return targets;
}

}  // namespace skeletex
