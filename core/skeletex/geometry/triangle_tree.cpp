// SPDX-License-Identifier: MIT
#include "skeletex/geometry/triangle_tree.h"

#include <algorithm>
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

/// Writes one triangle of a block. \return its box
Box place_triangle(const TriangleMesh& mesh, const TriangleTree& tree, const Triangle& triangle, float* planes) {
  std::array<Vec3, 3> p;
  Box around = kNoBox;
  for (int v = 0; v < 3; ++v) {
    p[v] = (mesh.positions[triangle[v]] - tree.origin) / tree.scale;
    const Eigen::Vector3f rounded = p[v].cast<float>();
    around = joined(around, {rounded[0] - kMargin, rounded[1] - kMargin, rounded[2] - kMargin,  //
                             rounded[0] + kMargin, rounded[1] + kMargin, rounded[2] + kMargin});
  }
  for (int d = 0; d < 3; ++d) {
    planes[d * kWidth] = static_cast<float>(p[0][d]);
    planes[(3 + d) * kWidth] = static_cast<float>(p[1][d] - p[0][d]);
    planes[(6 + d) * kWidth] = static_cast<float>(p[2][d] - p[0][d]);
  }
  return around;
}

/// Fills the blocks of level 0. \return their boxes
std::vector<Box> fill_blocks(const TriangleMesh& mesh, TriangleTree& tree) {
  const std::size_t count = tree.order.size(), blocks = block_count(count, kWidth);
  tree.blocks.resize(blocks * 9 * kWidth);
  std::vector<Box> boxes(blocks, kNoBox);
  for_each_block(blocks, 1 << 12, [&](std::size_t, std::size_t begin, std::size_t end) {
    for (std::size_t block = begin; block < end; ++block)
      for (std::size_t k = 0; k < kWidth; ++k) {
        const std::size_t place = block * kWidth + k;
        float* planes = tree.blocks.data() + block * 9 * kWidth + k;
        if (place < count)
          boxes[block] = joined(boxes[block], place_triangle(mesh, tree, mesh.triangles[tree.order[place]], planes));
        else
          for (int plane = 0; plane < 9; ++plane) planes[plane * kWidth] = plane < 3 ? kFarAway : 0.0f;
      }
  });
  return boxes;
}

/// Fills the nodes of a level from the boxes of their children. \return their own boxes
std::vector<Box> fill_level(TriangleTree& tree, int level, const std::vector<Box>& children) {
  std::vector<Box> boxes(block_count(children.size(), kWidth), kNoBox);
  for (std::size_t node = 0; node < boxes.size(); ++node) {
    float* planes = tree.boxes.data() + (tree.level_begin[level] + node) * 6 * kWidth;
    for (std::size_t k = 0; k < kWidth; ++k) {
      const std::size_t child = node * kWidth + k;
      const bool is_there = child < children.size();
      // A missing child is a point far away: an inverted box would look near from everywhere inside it.
      for (int d = 0; d < 6; ++d) planes[d * kWidth + k] = is_there ? children[child][d] : kFarAway;
      if (is_there) boxes[node] = joined(boxes[node], children[child]);
    }
  }
  return boxes;
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
  const BoundingBox box = bounding_box(mesh);
  tree.origin = box.centre();
  tree.scale = box.diagonal() > 0 ? box.diagonal() : 1;

  // Sizes of the levels: blocks, then an eighth each until one node is left. Level 0 has no boxes of its own.
  tree.level_begin = {0};
  std::size_t size = block_count(tree.order.size(), kWidth), nodes = 0;
  do {
    tree.level_begin.push_back(static_cast<int>(nodes));
    size = block_count(size, kWidth);
    nodes += size;
  } while (size > 1);
  tree.boxes.resize(nodes * 6 * kWidth);
  std::vector<Box> boxes = fill_blocks(mesh, tree);
  for (int level = 1; level <= tree.top_level(); ++level) boxes = fill_level(tree, level, boxes);
  return tree;
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
                                      double bound) {
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
      if (distance < nearest.distance) nearest = {tree.order[at], distance};
    }
  }
  return nearest;
}

}  // namespace skeletex
