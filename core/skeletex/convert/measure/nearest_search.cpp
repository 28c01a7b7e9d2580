// SPDX-License-Identifier: MIT
#include "skeletex/convert/measure/nearest_search.h"

#include <algorithm>
#include <cmath>

#include "metro_structs.h"
#include "skeletex/geometry/parallel.h"

namespace skeletex {
namespace {

constexpr std::size_t kBlock = 1 << 13;
constexpr ClKernelName kFindNearest{"metro.cl", "find_nearest_triangles"};

}  // namespace

NearestSearch::NearestSearch(ClContext& context, const TriangleMesh& mesh, const TriangleTree& tree)
    : context_(context),
      origin_(tree.origin),
      scale_(tree.scale),
      top_level_(tree.top_level()),
      order_(tree.order),
      boxes_(context.upload(tree.boxes)),
      blocks_(context.upload(triangles_of_blocks(mesh, tree))),
      level_begin_(context.upload(tree.level_begin)) {}

void NearestSearch::find(std::span<const Vec3> points, std::span<int> triangles, std::span<float> distances,
                         float enough) {
  const std::size_t count = points.size();
  if (count == 0) return;
  points_.resize(3 * count);
  for_each_index(count, kBlock, [&](std::size_t i) {
    const Vec3 p = (points[i] - origin_) / scale_;
    for (std::size_t axis = 0; axis < 3; ++axis) points_[axis * count + i] = static_cast<float>(p[axis]);
  });
  if (nearest_.size != count)
    nearest_ = context_.allocate<int>(count), nearest_squared_ = context_.allocate<float>(count);
  constexpr int kRun = 16;
  const std::size_t items = block_count(count, kRun);
  const float scaled_enough = enough / static_cast<float>(scale_);
  context_.launch(kFindNearest, ClRange({items, 1}, {context_.work_group_size(kFindNearest, 32), 1}),
                  NearestParameters{static_cast<int>(count), kRun, top_level_, scaled_enough * scaled_enough},
                  context_.upload(points_), boxes_, blocks_, level_begin_, nearest_, nearest_squared_);
  const auto [places, squared] = context_.download(nearest_, nearest_squared_);
  for (std::size_t i = 0; i < count; ++i) triangles[i] = order_[places[i]];
  if (distances.empty()) return;
  for (std::size_t i = 0; i < count; ++i)
    distances[i] = static_cast<float>(scale_) * std::sqrt(std::max(0.0f, squared[i]));
}

}  // namespace skeletex
