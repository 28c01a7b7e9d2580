// SPDX-License-Identifier: MIT
#include "skeletex/geometry/triangle_tree.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <utility>

#include "skeletex/geometry/hilbert_order.h"
#include "skeletex/geometry/parallel.h"
#include "skeletex/geometry/point_triangle.h"

namespace skeletex {
namespace {

constexpr int kWidth = TriangleTree::kWidth;
constexpr float kFarAway = 1e15f;  // its square and the products of squares stay finite
/// Boxes grow by this much: more than what rounding to float32 moves a corner, in units of the scale.
constexpr float kMargin = 1.5e-7f;

using Box = std::array<float, 6>;
constexpr Box kNoBox{kFarAway, kFarAway, kFarAway, -kFarAway, -kFarAway, -kFarAway};

Box joined(const Box& a, const Box& b) {
  Box box;
  for (int d = 0; d < 3; ++d) {
    box[d] = std::min(a[d], b[d]);
    box[d + 3] = std::max(a[d + 3], b[d + 3]);
  }
  return box;
}

Eigen::Vector3f point_of(const TriangleTree& tree, const Vec3& position) {
  return ((position - tree.origin) / tree.scale).cast<float>();
}

/// Around a block's triangles.
Box box_of_block(const TriangleMesh& mesh, std::size_t block, const TriangleTree& tree) {
  Box around = kNoBox;
  const std::size_t end = std::min((block + 1) * kWidth, tree.order.size());
  for (std::size_t place = block * kWidth; place < end; ++place)
    for (const VertexIndex vertex : mesh.triangles[tree.order[place]]) {
      const Eigen::Vector3f& p = tree.points[vertex];
      around = joined(around, {p[0] - kMargin, p[1] - kMargin, p[2] - kMargin,  //
                               p[0] + kMargin, p[1] + kMargin, p[2] + kMargin});
    }
  return around;
}

/// Writes the box of a node or block into its parent.
void set_box(int level, std::size_t index, const Box& box, TriangleTree& tree) {
  float* planes = tree.boxes.data() + (tree.level_begin[level + 1] + index / kWidth) * 6 * kWidth + index % kWidth;
  for (int d = 0; d < 6; ++d) planes[d * kWidth] = box[d];
}

/// Around a node's children. A missing one is a point far away: an inverted box would look near from everywhere inside.
Box box_of_node(int level, std::size_t node, const TriangleTree& tree) {
  const float* planes = tree.boxes.data() + (tree.level_begin[level] + node) * 6 * kWidth;
  Box around = kNoBox;
  for (int k = 0; k < kWidth && planes[k] < kFarAway; ++k)
    around = joined(around, {planes[k], planes[kWidth + k], planes[2 * kWidth + k], planes[3 * kWidth + k],
                             planes[4 * kWidth + k], planes[5 * kWidth + k]});
  return around;
}

}  // namespace

TriangleTree build_triangle_tree(const TriangleMesh& mesh) {
  std::vector<Vec3> centres(mesh.triangles.size());
  for_each_index(centres.size(), 1 << 14, [&](std::size_t t) {
    const auto [a, b, c] = mesh.triangles[t];
    centres[t] = (mesh.positions[a] + mesh.positions[b] + mesh.positions[c]) / 3;
  });
  return build_triangle_tree(mesh, hilbert_order(centres));
}

TriangleTree build_triangle_tree(const TriangleMesh& mesh, std::vector<int> order) {
  TriangleTree tree;
  tree.order = std::move(order);
  const std::size_t count = tree.order.size();
  const BoundingBox box = bounding_box(mesh);
  tree.origin = box.centre();
  tree.scale = box.diagonal() > 0 ? box.diagonal() : 1;

  // Sizes of the levels: blocks, then an eighth each until one node is left. Level 0 has no boxes of its own.
  tree.level_begin = {0};
  std::vector<std::size_t> sizes{block_count(count, kWidth)};
  std::size_t nodes = 0;
  do {
    tree.level_begin.push_back(static_cast<int>(nodes));
    sizes.push_back(block_count(sizes.back(), kWidth));
    nodes += sizes.back();
  } while (sizes.back() > 1);

  tree.points.resize(mesh.positions.size());
  for_each_index(tree.points.size(), 1 << 14,
                 [&](std::size_t v) { tree.points[v] = point_of(tree, mesh.positions[v]); });
  tree.boxes.assign(nodes * 6 * kWidth, kFarAway);
  for_each_block(sizes[0], 1 << 12, [&](std::size_t, std::size_t begin, std::size_t end) {
    for (std::size_t block = begin; block < end; ++block) set_box(0, block, box_of_block(mesh, block, tree), tree);
  });
  for (int level = 1; level < tree.top_level(); ++level)
    for (std::size_t node = 0; node < sizes[level]; ++node) set_box(level, node, box_of_node(level, node, tree), tree);
  return tree;
}

std::vector<float> triangles_of_blocks(const TriangleMesh& mesh, const TriangleTree& tree) {
  const std::size_t blocks = block_count(tree.order.size(), kWidth);
  std::vector<float> values(blocks * 9 * kWidth);
  for_each_index(blocks * kWidth, 1 << 14, [&](std::size_t place) {
    float* const planes = values.data() + place / kWidth * 9 * kWidth + place % kWidth;
    const bool is_past_end = place >= tree.order.size();
    const Triangle triangle = is_past_end ? Triangle{} : mesh.triangles[tree.order[place]];
    const Vec3 a = (mesh.positions[triangle[0]] - tree.origin) / tree.scale,
               b = (mesh.positions[triangle[1]] - tree.origin) / tree.scale,
               c = (mesh.positions[triangle[2]] - tree.origin) / tree.scale;
    for (int d = 0; d < 3; ++d) {
      planes[d * kWidth] = is_past_end ? kFarAway : static_cast<float>(a[d]);
      planes[(3 + d) * kWidth] = static_cast<float>(b[d] - a[d]);
      planes[(6 + d) * kWidth] = static_cast<float>(c[d] - a[d]);
    }
  });
  return values;
}

void update_triangle_tree(const TriangleMesh& mesh, std::span<const int> places, TriangleTree& tree) {
  std::vector<std::size_t> nodes;
  for (const int place : places) {
    nodes.push_back(static_cast<std::size_t>(place) / kWidth);
    for (const VertexIndex vertex : mesh.triangles[tree.order[place]])
      tree.points[vertex] = point_of(tree, mesh.positions[vertex]);
  }
  for (int level = 0; level < tree.top_level(); ++level) {
    std::sort(nodes.begin(), nodes.end());
    nodes.erase(std::unique(nodes.begin(), nodes.end()), nodes.end());
    for (std::size_t& node : nodes) {
      set_box(level, node, level == 0 ? box_of_block(mesh, node, tree) : box_of_node(level, node, tree), tree);
      node /= kWidth;
    }
  }
}

namespace {

/// A node or block of a tree that is still to be looked at, and how far it is at least, in the tree's units.
struct OpenNode {
  int level;
  std::size_t index;
  float squared;
};

/// Adds the children of a node that are nearer than a distance, the nearest last.
void open_children(const TriangleTree& tree, const OpenNode& node, const Eigen::Vector3f& point, float least_squared,
                   std::vector<OpenNode>& open) {
  const float* planes = tree.boxes.data() + (tree.level_begin[node.level] + node.index) * 6 * kWidth;
  std::array<float, kWidth> squared{};
  for (int d = 0; d < 3; ++d)
    for (int k = 0; k < kWidth; ++k) {
      const float gap =
          std::max(0.0f, std::max(planes[d * kWidth + k] - point[d], point[d] - planes[(3 + d) * kWidth + k]));
      squared[k] += gap * gap;
    }
  const std::size_t begin = open.size();
  for (int k = 0; k < kWidth; ++k)
    if (squared[k] < least_squared) open.push_back({node.level - 1, kWidth * node.index + k, squared[k]});
  std::sort(open.begin() + static_cast<std::ptrdiff_t>(begin), open.end(),
            [](const OpenNode& a, const OpenNode& b) { return a.squared > b.squared; });
}

}  // namespace

NearestTriangle find_nearest_triangle(const TriangleMesh& mesh, const TriangleTree& tree, const Vec3& point,
                                      double bound, const std::function<bool(TriangleIndex triangle)>& counts) {
  constexpr double kRounding = 1e-6;  // of the tree's units: more than what rounding to float32 moves a point or box
  const Eigen::Vector3f place = point_of(tree, point);
  NearestTriangle nearest{-1, bound};
  const auto least_squared = [&] {
    const double scaled = std::min(1e9, nearest.distance / tree.scale) + kRounding;
    return static_cast<float>(scaled * scaled);
  };
  std::vector<OpenNode> open{{tree.top_level(), 0, 0}};
  while (!open.empty()) {
    const OpenNode node = open.back();
    open.pop_back();
    if (node.squared >= least_squared()) continue;
    if (node.level > 0) {
      open_children(tree, node, place, least_squared(), open);
      continue;
    }
    const std::size_t begin = node.index * kWidth, end = std::min(begin + kWidth, tree.order.size());
    for (std::size_t at = begin; at < end; ++at) {
      const Triangle& t = mesh.triangles[tree.order[at]];
      const Vec3 &a = mesh.positions[t[0]], &b = mesh.positions[t[1]], &c = mesh.positions[t[2]];
      const Vec3 gap = (a.cwiseMin(b).cwiseMin(c) - point).cwiseMax(point - a.cwiseMax(b).cwiseMax(c)).cwiseMax(0);
      if (gap.squaredNorm() > nearest.distance * nearest.distance) continue;
      const double distance = offset_from_triangle(point, a, b, c).norm();
      if (distance < nearest.distance && (!counts || counts(tree.order[at]))) nearest = {tree.order[at], distance};
    }
  }
  return nearest;
}

void for_each_triangle_near(const TriangleTree& tree, const Vec3& lower, const Vec3& upper,
                            const std::function<void(TriangleIndex triangle)>& visit) {
  constexpr double kRounding = 1e-6;  // of the tree's units, as above
  const Eigen::Vector3f least = ((lower - tree.origin) / tree.scale - Vec3::Constant(kRounding)).cast<float>(),
                        greatest = ((upper - tree.origin) / tree.scale + Vec3::Constant(kRounding)).cast<float>();
  std::vector<std::pair<int, std::size_t>> open{{tree.top_level(), 0}};
  while (!open.empty()) {
    const auto [level, index] = open.back();
    open.pop_back();
    if (level == 0) {
      const std::size_t begin = index * kWidth, end = std::min(begin + kWidth, tree.order.size());
      for (std::size_t at = begin; at < end; ++at) visit(tree.order[at]);
      continue;
    }
    const float* planes = tree.boxes.data() + (tree.level_begin[level] + index) * 6 * kWidth;
    for (int k = 0; k < kWidth; ++k) {
      bool is_met = true;
      for (int d = 0; d < 3; ++d)
        is_met = is_met && planes[d * kWidth + k] <= greatest[d] && planes[(3 + d) * kWidth + k] >= least[d];
      if (is_met) open.emplace_back(level - 1, kWidth * index + k);
    }
  }
}

namespace {

/// A ray in the tree's units.
struct TreeRay {
  std::array<float, 3> origin, direction, inverse;
};

/// Shares at which a ray enters the children of a node; past `limit` where it does not meet them.
std::array<float, kWidth> enter_children(const TriangleTree& tree, int level, std::size_t index, const TreeRay& ray,
                                         float limit) {
  const float* planes = tree.boxes.data() + (tree.level_begin[level] + index) * 6 * kWidth;
  std::array<float, kWidth> enter{}, leave;
  leave.fill(limit);
  for (int d = 0; d < 3; ++d)
    for (int k = 0; k < kWidth; ++k) {
      const float a = (planes[d * kWidth + k] - ray.origin[d]) * ray.inverse[d],
                  b = (planes[(3 + d) * kWidth + k] - ray.origin[d]) * ray.inverse[d];
      enter[k] = std::max(enter[k], std::min(a, b));
      leave[k] = std::min(leave[k], std::max(a, b));
    }
  for (int k = 0; k < kWidth; ++k)
    if (enter[k] > leave[k]) enter[k] = 2 * kFarAway;
  return enter;
}

/// The least share at which a ray meets a triangle of a block (Moeller and Trumbore 1997); `limit` without any.
/// Triangles are a little larger than they are, so that no ray slips between two.
float hit_block(const TriangleMesh& mesh, const TriangleTree& tree, std::size_t block, const TreeRay& ray, float limit,
                int skipped) {
  constexpr float kOver = 1e-6f;
  const std::size_t begin = block * kWidth, last = tree.order.size() - 1;
  // By corner and coordinate, so that the compiler vectorises what follows.
  std::array<std::array<std::array<float, kWidth>, 3>, 3> corners;
  for (int k = 0; k < kWidth; ++k) {
    const Triangle& t = mesh.triangles[tree.order[std::min(begin + k, last)]];
    for (int c = 0; c < 3; ++c)
      for (int d = 0; d < 3; ++d) corners[c][d][k] = tree.points[t[c]][d];
  }
  const auto& [x, y, z] = corners[0];
  const auto [ex, ey, ez] = ray.direction;
  std::array<float, kWidth> shares;
  for (int k = 0; k < kWidth; ++k) {
    const float ax = corners[1][0][k] - x[k], ay = corners[1][1][k] - y[k], az = corners[1][2][k] - z[k];
    const float bx = corners[2][0][k] - x[k], by = corners[2][1][k] - y[k], bz = corners[2][2][k] - z[k];
    const float sx = ray.origin[0] - x[k], sy = ray.origin[1] - y[k], sz = ray.origin[2] - z[k];
    const float px = ey * bz - ez * by, py = ez * bx - ex * bz, pz = ex * by - ey * bx;
    const float qx = sy * az - sz * ay, qy = sz * ax - sx * az, qz = sx * ay - sy * ax;
    const float inverse = 1 / (ax * px + ay * py + az * pz);
    const float u = (sx * px + sy * py + sz * pz) * inverse, v = (ex * qx + ey * qy + ez * qz) * inverse,
                share = (bx * qx + by * qy + bz * qz) * inverse;
    // A determinant of 0 makes u infinite or no number, which fails.
    const bool is_met = (u >= -kOver) & (v >= -kOver) & (u + v <= 1 + kOver) & (share >= 0);
    shares[k] = is_met ? share : kFarAway;
  }
  for (int k = 0; k < kWidth; ++k)
    if (shares[k] < limit && tree.order[std::min(begin + k, last)] != skipped) limit = shares[k];
  return limit;
}

}  // namespace

double find_first_hit(const TriangleMesh& mesh, const TriangleTree& tree, const Vec3& origin, const Vec3& direction,
                      double limit, int skipped) {
  TreeRay ray;
  for (int d = 0; d < 3; ++d) {
    ray.origin[d] = static_cast<float>((origin[d] - tree.origin[d]) / tree.scale);
    ray.direction[d] = static_cast<float>(direction[d] / tree.scale);
    ray.inverse[d] = 1 / (std::abs(ray.direction[d]) < 1e-20f ? 1e-20f : ray.direction[d]);
  }
  float least = static_cast<float>(std::min(limit, static_cast<double>(kFarAway)));
  const float bound = least;
  struct Open {
    int level;
    std::size_t index;
    float enter;
  };
  std::array<Open, 128> open;  // at most 7 more a level than are taken
  int count = 0;
  open[count++] = {tree.top_level(), 0, 0};
  while (count > 0) {
    const Open node = open[--count];
    if (node.enter >= least) continue;
    if (node.level == 0) {
      least = hit_block(mesh, tree, node.index, ray, least, skipped);
      continue;
    }
    const std::array<float, kWidth> enter = enter_children(tree, node.level, node.index, ray, least);
    const int begin = count;
    for (int k = 0; k < kWidth; ++k) {
      if (enter[k] >= least) continue;
      int at = count++;
      for (; at > begin && open[at - 1].enter < enter[k]; --at) open[at] = open[at - 1];
      open[at] = {node.level - 1, kWidth * node.index + k, enter[k]};
    }
  }
  return least < bound ? least : std::numeric_limits<double>::infinity();
}

}  // namespace skeletex
