// SPDX-License-Identifier: MIT
#include "skeletex/convert/segment/cells.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <tuple>

#include "segment_structs.h"
#include "skeletex/model/error.h"

namespace skeletex {

int NodeCells::cell_of(const Vec3& x) const {
  int best = 0;
  double best_value = value(0, x);
  for (int c = 1; c < static_cast<int>(cells.size()); ++c) {
    const double v = value(c, x);
    if (v > best_value) {
      best_value = v;
      best = c;
    }
  }
  return best;
}

namespace {

/// Numbers in [0,1) without any regularity (SplitMix64). Evenly stepped ones would do nothing for four directions that
/// form a rectangle, and an affine function of the directions would only move the node.
double scattered(std::uint64_t index) {
  std::uint64_t x = (index + 1) * 0x9e3779b97f4a7c15u;
  x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9u;
  x = (x ^ (x >> 27)) * 0x94d049bb133111ebu;
  return static_cast<double>((x ^ (x >> 31)) >> 11) * 0x1p-53;
}

}  // namespace

std::vector<NodeCells> node_cells(const Skeleton& skeleton, double perturbation) {
  std::vector<NodeCells> result;
  const auto at_nodes = bones_at_nodes(skeleton);
  check_directions(skeleton);
  for (int n = 0; n < static_cast<int>(at_nodes.size()); ++n) {
    if (at_nodes[n].size() < 2) continue;
    const std::string& node_name = skeleton.nodes[n].name;
    if (at_nodes[n].size() > 250)
      throw TopologyError(
          fmt::format("node \"{}\" has {} bones; at most 250 can meet, split the node", node_name, at_nodes[n].size()));
    NodeCells node;
    node.node = n;
    node.position = skeleton.nodes[n].position;
    for (const BoneAtNode& bone : at_nodes[n]) node.cells.push_back({bone, direction_from(skeleton, bone), 0.0});
    const auto key = [](const Vec3& d) { return std::make_tuple(d.x(), d.y(), d.z()); };
    std::sort(node.cells.begin(), node.cells.end(),
              [&](const Cell& a, const Cell& b) { return key(a.direction) < key(b.direction); });
    for (std::size_t c = 0; c < node.cells.size(); ++c) node.cells[c].offset = perturbation * scattered(c);
    result.push_back(std::move(node));
  }
  return result;
}

ClassifyTables classify_tables(const std::vector<Vec3>& points, const std::vector<NodeCells>& nodes) {
  ClassifyTables tables;
  tables.origin = bounding_box(points).centre();
  tables.points.resize(3 * points.size());
  double radius_squared = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Vec3 p = points[i] - tables.origin;
    radius_squared = std::max(radius_squared, p.squaredNorm());
    for (std::size_t d = 0; d < 3; ++d) tables.points[d * points.size() + i] = static_cast<float>(p[d]);
  }
  tables.cell_begin.push_back(0);
  for (const NodeCells& node : nodes) {
    double largest_offset = 0;
    for (const Cell& cell : node.cells) {
      const double offset = cell.offset - (node.position - tables.origin).dot(cell.direction);
      largest_offset = std::max(largest_offset, std::abs(offset));
      for (int d = 0; d < 3; ++d) tables.cells.push_back(static_cast<float>(cell.direction[d]));
      tables.cells.push_back(static_cast<float>(offset));
    }
    tables.cell_begin.push_back(tables.cell_begin.back() + static_cast<int>(node.cells.size()));
    // A value is a sum of four terms with at most six roundings each (two of the inputs, one product, three sums), so
    // its error is below 7 u (|x| + |offset|), u = 2^-24; the lead is a difference of two values.
    constexpr double kUnit = 1.0 / (1 << 24);
    tables.margin.push_back(static_cast<float>(2 * 7 * kUnit * (std::sqrt(radius_squared) + largest_offset) * 1.001));
  }
  return tables;
}

std::vector<std::uint8_t> classify_on_device(ClContext& context, const ClassifyTables& tables) {
  const std::size_t point_count = tables.points.size() / 3, node_count = tables.margin.size();
  if (point_count == 0 || node_count == 0) return {};
  const ClassifyParameters parameters{static_cast<int>(point_count), static_cast<int>(node_count)};
  const auto points = context.upload(tables.points);
  const auto cell_begin = context.upload(tables.cell_begin);
  const auto cells = context.upload(tables.cells);
  const auto margin = context.upload(tables.margin);
  const auto labels = context.allocate<std::uint8_t>(point_count * node_count);
  context.launch({"segment.cl", "classify_points"}, ClRange(point_count, node_count), parameters, points, cell_begin,
                 cells, margin, labels);
  return context.download(labels);
}

std::vector<std::uint8_t> classify_points(ClContext& context, const std::vector<Vec3>& points,
                                          const std::vector<NodeCells>& nodes) {
  std::vector<std::uint8_t> labels = classify_on_device(context, classify_tables(points, nodes));
  for (std::size_t n = 0; n < nodes.size(); ++n)
    for (std::size_t p = 0; p < points.size(); ++p) {
      std::uint8_t& label = labels[n * points.size() + p];
      if (label == kUncertainCell) label = static_cast<std::uint8_t>(nodes[n].cell_of(points[p]));
    }
  return labels;
}

}  // namespace skeletex
