// SPDX-License-Identifier: MIT
#pragma once
#include <cstdint>
#include <vector>

#include "skeletex/device/context.h"
#include "skeletex/skeleton/skeleton.h"

namespace skeletex {

/// The cell of one bone at a node.
struct Cell {
  BoneAtNode bone;
  Vec3 direction;     ///< unit, away from the node
  double offset = 0;  ///< the perturbation that makes ties unambiguous, world units
};

/// The spherical Voronoi cells of the bone directions at a node with two bones or more (design section 2). A point x
/// lies in the cell c with the largest (x - node) . direction_c + offset_c. Cells are ordered by direction, so that
/// neither order nor offsets depend on how bones and nodes are numbered.
struct NodeCells {
  NodeIndex node;
  Vec3 position;
  std::vector<Cell> cells;

  double value(int cell, const Vec3& x) const { return (x - position).dot(cells[cell].direction) + cells[cell].offset; }
  /// The cell that holds x; of equal ones the first.
  int cell_of(const Vec3& x) const;
};

/// The cells of all nodes that have at least two bones, in the order of the nodes.
/// \param perturbation  length of the largest offset
/// \throw TopologyError when two bones leave a node in the same direction, or a node has more than 250 bones
std::vector<NodeCells> node_cells(const Skeleton& skeleton, double perturbation);

/// Cells of all points at all of the nodes: entry [n * points + p] is that of point p at nodes[n]. Runs on the device
/// in single precision; points too close to a separation plane for that are done again in double, so that the result is
/// cell_of().
std::vector<std::uint8_t> classify_points(ClContext& context, const std::vector<Vec3>& points,
                                          const std::vector<NodeCells>& nodes);

/// What the device reads.
struct ClassifyTables {
  Vec3 origin;                  ///< device coordinates are relative to it
  std::vector<float> points;    ///< planes of x, y, z
  std::vector<int> cell_begin;  ///< per node and one more: first of its cells
  std::vector<float> cells;     ///< per cell: direction, offset, so that value = x . direction + offset
  std::vector<float> margin;    ///< per node: at or below this lead over the second the cell is not certain
};
inline constexpr std::uint8_t kUncertainCell = 255;
ClassifyTables classify_tables(const std::vector<Vec3>& points, const std::vector<NodeCells>& nodes);
/// The device's part of classify_points: kUncertainCell where the lead is not above the margin.
std::vector<std::uint8_t> classify_on_device(ClContext& context, const ClassifyTables& tables);

}  // namespace skeletex
