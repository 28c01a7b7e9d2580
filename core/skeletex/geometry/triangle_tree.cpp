// SPDX-License-Identifier: MIT
#include "skeletex/geometry/triangle_tree.h"

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

/// Writes a block's triangles into the tree.
/// \return their box
Box fill_block(const TriangleMesh& mesh, std::size_t block, TriangleTree& tree) {
  float* planes = tree.blocks.data() + block * 9 * kWidth;
  Box around = kNoBox;
  for (std::size_t k = 0; k < kWidth; ++k) {
    const std::size_t place = block * kWidth + k;
    if (place >= tree.order.size()) {
      for (std::size_t plane = 0; plane < 9; ++plane) planes[plane * kWidth + k] = plane < 3 ? kFarAway : 0.0f;
      continue;
    }
    const Triangle& triangle = mesh.triangles[tree.order[place]];
    std::array<Vec3, 3> p;
    for (int v = 0; v < 3; ++v) {
      p[v] = (mesh.positions[triangle[v]] - tree.origin) / tree.scale;
      const Eigen::Vector3f rounded = p[v].cast<float>();
      around = joined(around, {rounded[0] - kMargin, rounded[1] - kMargin, rounded[2] - kMargin,  //
                               rounded[0] + kMargin, rounded[1] + kMargin, rounded[2] + kMargin});
    }
    for (int d = 0; d < 3; ++d) {
      planes[d * kWidth + k] = static_cast<float>(p[0][d]);
      planes[(3 + d) * kWidth + k] = static_cast<float>(p[1][d] - p[0][d]);
      planes[(6 + d) * kWidth + k] = static_cast<float>(p[2][d] - p[0][d]);
    }
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
  for_each_block(centres.size(), 1 << 14, [&](std::size_t, std::size_t begin, std::size_t end) {
    for (std::size_t t = begin; t < end; ++t) {
      const auto [a, b, c] = mesh.triangles[t];
      centres[t] = (mesh.positions[a] + mesh.positions[b] + mesh.positions[c]) / 3;
    }
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

  tree.blocks.resize(sizes[0] * 9 * kWidth);
  tree.boxes.assign(nodes * 6 * kWidth, kFarAway);
  for_each_block(sizes[0], 1 << 12, [&](std::size_t, std::size_t begin, std::size_t end) {
    for (std::size_t block = begin; block < end; ++block) set_box(0, block, fill_block(mesh, block, tree), tree);
  });
  for (int level = 1; level < tree.top_level(); ++level)
    for (std::size_t node = 0; node < sizes[level]; ++node) set_box(level, node, box_of_node(level, node, tree), tree);
  return tree;
}

void update_triangle_tree(const TriangleMesh& mesh, std::span<const int> places, TriangleTree& tree) {
  std::vector<std::size_t> nodes;
  for (const int place : places) nodes.push_back(static_cast<std::size_t>(place) / kWidth);
  for (int level = 0; level < tree.top_level(); ++level) {
    std::sort(nodes.begin(), nodes.end());
    nodes.erase(std::unique(nodes.begin(), nodes.end()), nodes.end());
    for (std::size_t& node : nodes) {
      set_box(level, node, level == 0 ? fill_block(mesh, node, tree) : box_of_node(level, node, tree), tree);
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
                                      double bound, const std::function<bool(int triangle)>& counts) {
  constexpr double kRounding = 1e-6;  // of the tree's units: more than what rounding to float32 moves a point or box
  const Eigen::Vector3f place = ((point - tree.origin) / tree.scale).cast<float>();
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
      const double distance =
          offset_from_triangle(point, mesh.positions[t[0]], mesh.positions[t[1]], mesh.positions[t[2]]).norm();
      if (distance < nearest.distance && (!counts || counts(tree.order[at]))) nearest = {tree.order[at], distance};
    }
  }
  return nearest;
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
float hit_block(const float* planes, const TreeRay& ray, float limit) {
  constexpr float kOver = 1e-6f;
  const auto plane = [&](int i, int k) { return planes[i * kWidth + k]; };
  std::array<float, kWidth> shares{};
  for (int k = 0; k < kWidth; ++k) {
    const float ax = plane(3, k), ay = plane(4, k), az = plane(5, k);
    const float bx = plane(6, k), by = plane(7, k), bz = plane(8, k);
    const float px = ray.direction[1] * bz - ray.direction[2] * by, py = ray.direction[2] * bx - ray.direction[0] * bz,
                pz = ray.direction[0] * by - ray.direction[1] * bx;
    const float determinant = ax * px + ay * py + az * pz, inverse = 1 / determinant;
    const float x = ray.origin[0] - plane(0, k), y = ray.origin[1] - plane(1, k), z = ray.origin[2] - plane(2, k);
    const float u = (x * px + y * py + z * pz) * inverse;
    const float qx = y * az - z * ay, qy = z * ax - x * az, qz = x * ay - y * ax;
    const float v = (ray.direction[0] * qx + ray.direction[1] * qy + ray.direction[2] * qz) * inverse;
    const float share = (bx * qx + by * qy + bz * qz) * inverse;
    // A determinant of 0 makes u infinite or no number, which fails.
    const bool is_hit = (u >= -kOver) & (v >= -kOver) & (u + v <= 1 + kOver) & (share >= 0);
    shares[k] = is_hit ? share : limit;
  }
  return std::min(limit, *std::min_element(shares.begin(), shares.end()));
}

}  // namespace

double find_first_hit(const TriangleTree& tree, const Vec3& origin, const Vec3& direction, double limit) {
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
      least = hit_block(tree.blocks.data() + node.index * 9 * kWidth, ray, least);
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
