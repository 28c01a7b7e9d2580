// SPDX-License-Identifier: MIT
#include "skeletex/edit/morph/seam_network.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <random>

#include "skeletex/convert/segment/cells.h"
#include "skeletex/model/error.h"

namespace skeletex {
namespace {

constexpr double kPerturbation = 1e-7;  // of a unit direction; decides ties only

/// A corner of the cells on the unit sphere around a node.
struct CellCorner {
  std::array<int, 3> cells;
  Vec3 direction;
};

/// All corners where three cells or more meet. Ties are decided by slightly perturbed directions, so that exactly three
/// cells meet in each corner and no two cells meet in more than one arc.
std::vector<CellCorner> cell_corners(const std::vector<Vec3>& directions) {
  std::vector<Vec3> perturbed;
  std::mt19937 random(1);
  std::uniform_real_distribution<double> unit(-1, 1);
  for (const Vec3& direction : directions) {
    const double x = unit(random), y = unit(random), z = unit(random);
    perturbed.push_back(direction + kPerturbation * Vec3(x, y, z));
  }
  const auto axis = [](const std::vector<Vec3>& d, int i, int j, int k) {
    return Vec3((d[i] - d[j]).cross(d[i] - d[k]).normalized());
  };
  // Whether no other cell is nearer to x than cells i, j and k.
  const auto is_nearest = [&](const Vec3& x, int i, int j, int k) {
    for (int other = 0; other < static_cast<int>(perturbed.size()); ++other)
      if (other != i && other != j && other != k && !(x.dot(perturbed[other]) <= x.dot(perturbed[i]))) return false;
    return true;
  };
  std::vector<CellCorner> corners;
  const int count = static_cast<int>(directions.size());
  for (int i = 0; i < count; ++i)
    for (int j = i + 1; j < count; ++j)
      for (int k = j + 1; k < count; ++k)
        for (const double sign : {1.0, -1.0})
          if (is_nearest(sign * axis(perturbed, i, j, k), i, j, k))
            corners.push_back({{i, j, k}, sign * axis(directions, i, j, k)});
  return corners;
}

/// Whether the arc between two cells leaves this corner in the direction of growing v about the first one's bone.
bool leaves(const NodeCells& node, const CellCorner& corner, int first, int second) {
  const int third = corner.cells[0] + corner.cells[1] + corner.cells[2] - first - second;
  const auto direction = [&](int cell) -> const Vec3& { return node.cells[cell].direction; };
  Vec3 tangent = corner.direction.cross(direction(first) - direction(second));
  if (tangent.dot(direction(first) - direction(third)) < 0) tangent = -tangent;
  const double sign = node.cells[first].bone.end == BoneEnd::kHead ? 1 : -1;
  return sign * tangent.dot(direction(first).cross(corner.direction)) > 0;
}

bool contains(const CellCorner& corner, int cell) {
  return std::find(corner.cells.begin(), corner.cells.end(), cell) != corner.cells.end();
}

std::vector<ArcUse>& arcs_of(SeamNetwork& network, BoneAtNode bone) {
  return network.ends[bone.bone][static_cast<int>(bone.end)].arcs;
}

/// A node of two bones: one closed arc.
void append_closed_arc(const NodeCells& node, SeamNetwork& network) {
  const BoneAtNode a = node.cells[0].bone, b = node.cells[1].bone;
  const ArcIndex arc = static_cast<int>(network.arcs.size());
  network.arcs.push_back({node.node, {a.bone, b.bone}, {-1, -1}, {}});
  arcs_of(network, a).push_back({arc, false});
  arcs_of(network, b).push_back({arc, a.end == b.end});
}

/// The corners and arcs of a node of three bones or more.
void append_arcs(const Skeleton& skeleton, const SeparationPlanes& separation, const NodeCells& node,
                 SeamNetwork& network) {
  std::vector<Vec3> directions;
  for (const Cell& cell : node.cells) directions.push_back(cell.direction);
  const std::vector<CellCorner> corners = cell_corners(directions);
  if (corners.size() != 2 * node.cells.size() - 4)
    throw TopologyError(
        fmt::format("the separation planes around node \"{}\" cannot be told apart; move the far end of one of its "
                    "bones a little",
                    skeleton.nodes[node.node].name));
  const int first_corner = static_cast<int>(network.corners.size());
  for (const CellCorner& corner : corners) {
    std::vector<BoneIndex> bones;
    for (const int cell : corner.cells) bones.push_back(node.cells[cell].bone.bone);
    std::sort(bones.begin(), bones.end());
    network.corners.push_back({node.node, bones, {separation.turn_of(bones[0], corner.direction), 0}});
    network.directions.push_back(corner.direction);
  }
  for (int i = 0; i < static_cast<int>(node.cells.size()); ++i)
    for (int j = i + 1; j < static_cast<int>(node.cells.size()); ++j) {
      SeamArc arc{node.node, {node.cells[i].bone.bone, node.cells[j].bone.bone}, {-1, -1}, {}};
      for (int c = 0; c < static_cast<int>(corners.size()); ++c)
        if (contains(corners[c], i) && contains(corners[c], j))
          arc.corners[leaves(node, corners[c], i, j) ? 0 : 1] = first_corner + c;
      if (arc.corners[0] >= 0) network.arcs.push_back(arc);
    }
}

/// Orders the arcs around a bone at a node, from corner to corner.
/// \param first_arc  of the node
void close_loop(const Skeleton& skeleton, NodeIndex node, BoneAtNode bone, ArcIndex first_arc, SeamNetwork& network) {
  std::vector<ArcUse> uses;
  for (int a = first_arc; a < static_cast<int>(network.arcs.size()); ++a)
    for (const int side : {0, 1}) {
      const SeamArc& arc = network.arcs[a];
      if (arc.bones[side] != bone.bone) continue;
      const BoneEnd other = skeleton.bones[arc.bones[1 - side]].head == node ? BoneEnd::kHead : BoneEnd::kTail;
      uses.push_back({a, side == 1 && other == bone.end});
    }
  const auto ends_of = [&](ArcUse use) {
    const SeamArc& arc = network.arcs[use.arc];
    return std::array<int, 2>{arc.corners[use.is_reversed ? 1 : 0], arc.corners[use.is_reversed ? 0 : 1]};
  };
  std::vector<ArcUse>& loop = arcs_of(network, bone);
  loop.push_back(uses.front());
  while (loop.size() < uses.size()) {
    const auto next =
        std::find_if(uses.begin(), uses.end(), [&](ArcUse use) { return ends_of(use)[0] == ends_of(loop.back())[1]; });
    if (next == uses.end())
      throw TopologyError(
          fmt::format("the separation planes around node \"{}\" do not close", skeleton.nodes[node].name));
    loop.push_back(*next);
  }
}

}  // namespace

SeamNetwork seam_network(const Skeleton& skeleton, const SeparationPlanes& separation) {
  SeamNetwork network;
  network.ends.resize(skeleton.bones.size());
  for (const NodeCells& node : node_cells(skeleton, 0)) {
    if (node.cells.size() == 2) {
      append_closed_arc(node, network);
      continue;
    }
    const ArcIndex first_arc = static_cast<int>(network.arcs.size());
    append_arcs(skeleton, separation, node, network);
    for (const Cell& cell : node.cells) close_loop(skeleton, node.node, cell.bone, first_arc, network);
  }
  return network;
}

}  // namespace skeletex
