// SPDX-License-Identifier: MIT
#include "skeletex/skeleton/check_skeleton.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cstdint>
#include <limits>

#include "skeletex/geometry/parallel.h"
#include "skeletex/geometry/union_find.h"
#include "skeletex/model/error.h"

namespace skeletex {

void check_size(std::size_t nodes, std::size_t bones) {
  if (bones > kMostBones)
    throw InputError(
        fmt::format("the skeleton has {} bones; at most {} are taken, leave out those that move nothing of "
                    "their own",
                    bones, kMostBones));
  if (nodes > 2 * kMostBones)
    throw InputError(fmt::format("the skeleton has {} nodes; {} bones, the most that are taken, have no more than {}",
                                 nodes, kMostBones, 2 * kMostBones));
}

/// Crossings of the ray from the point along +z, with sign. Sides of edges are found from the lower vertex, and
/// vertices at the ray's y count as above it, so neighbouring triangles never both or neither count the ray.
int winding_number(std::span<const Vec3> positions, std::span<const int> corners, const Vec3& point) {
  const auto is_above = [&](int v) { return positions[v].y() >= point.y(); };
  int winding = 0;
  for (std::size_t base = 0; base < corners.size(); base += 3) {
    const int* v = &corners[base];
    const bool a = is_above(v[0]), b = is_above(v[1]), c = is_above(v[2]);
    if (a == b && b == c) continue;
    int sign = 0;  // of the triangle around the ray, seen from +z
    for (int e = 0; e < 3; ++e) {
      int i = v[e], j = v[(e + 1) % 3];
      const bool is_i_above = is_above(i);
      if (is_i_above == is_above(j)) continue;
      if (i > j) std::swap(i, j);
      const Vec3 &p = positions[i], &q = positions[j];
      // x at which the edge meets the ray's plane
      const double x = p.x() + (point.y() - p.y()) / (q.y() - p.y()) * (q.x() - p.x());
      if (x > point.x()) sign += is_i_above ? -1 : 1;
    }
    if (sign == 0) continue;
    const Vec3 &p = positions[v[0]], &q = positions[v[1]], &r = positions[v[2]];
    const Vec3 normal = (q - p).cross(r - p);
    // Over or under the point: the plane's z at the point's x, y.
    if ((point - p).dot(normal) * (normal.z() > 0 ? 1 : -1) < 0) winding += sign;
  }
  return winding;
}

namespace {

/// Where a bone first meets the surface on its way from head to tail: its parameter, or infinity.
double first_crossing(const CutMesh& mesh, const Vec3& head, const Vec3& tail) {
  // Coordinates along the bone and across it; a triangle all on one side of a plane is out.
  const Vec3 axis = tail - head, e = axis.unitOrthogonal(), f = axis.cross(e).normalized();
  const double length_squared = axis.squaredNorm();
  std::vector<std::uint8_t> codes(mesh.positions.size());
  for (std::size_t v = 0; v < codes.size(); ++v) {
    const Vec3 p = mesh.positions[v] - head;
    const double x = p.dot(e), y = p.dot(f), z = p.dot(axis);
    codes[v] = static_cast<std::uint8_t>((x > 0) | (x < 0) << 1 | (y > 0) << 2 | (y < 0) << 3 |
                                         (z > length_squared) << 4 | (z < 0) << 5);
  }
  double first = std::numeric_limits<double>::infinity();
  for (std::size_t base = 0; base < mesh.origins.size(); base += 3) {
    const int* v = &mesh.origins[base];
    if (codes[v[0]] & codes[v[1]] & codes[v[2]]) continue;
    const Vec3 &p = mesh.positions[v[0]], &q = mesh.positions[v[1]], &r = mesh.positions[v[2]];
    const Vec3 a = p - head, b = q - head, c = r - head;
    const double ab = axis.dot(a.cross(b)), bc = axis.dot(b.cross(c)), ca = axis.dot(c.cross(a));
    if (!((ab >= 0 && bc >= 0 && ca >= 0) || (ab <= 0 && bc <= 0 && ca <= 0))) continue;
    const Vec3 normal = (q - p).cross(r - p);
    const double along = axis.dot(normal);
    if (along == 0) continue;
    const double t = a.dot(normal) / along;
    if (t >= 0 && t <= 1) first = std::min(first, t);
  }
  return first;
}

void check_connected(const Skeleton& skeleton) {
  UnionFind sets(static_cast<int>(skeleton.nodes.size()));
  for (const Bone& bone : skeleton.bones) sets.unite(bone.head, bone.tail);
  for (const Bone& bone : skeleton.bones)
    if (sets.find(bone.head) != sets.find(skeleton.bones[0].head))
      throw TopologyError(fmt::format(
          "bone \"{}\" at {} is not connected with bone \"{}\"; let them share a node, or join them by further bones",
          bone.name, text_of(skeleton, skeleton.nodes[bone.head].position), skeleton.bones[0].name));
}

[[noreturn]] void refuse_outside_node(const CutMesh& mesh, const Skeleton& skeleton, int n) {
  const Node& node = skeleton.nodes[n];
  std::string bones;
  for (const Bone& bone : skeleton.bones)
    if (bone.head == n || bone.tail == n) bones += fmt::format("{}\"{}\"", bones.empty() ? "" : ", ", bone.name);
  double nearest = std::numeric_limits<double>::infinity();
  Vec3 vertex = node.position;
  for (const Vec3& p : mesh.positions)
    if ((p - node.position).squaredNorm() < nearest) {
      nearest = (p - node.position).squaredNorm();
      vertex = p;
    }
  throw TopologyError(fmt::format(
      "node \"{}\" (bone {}) lies outside the mesh at {}; move it into the body, whose nearest vertex is at {}",
      node.name, bones, text_of(skeleton, node.position), text_of(skeleton, vertex)));
}

/// \param count  how many of the nodes with bones are looked at
void check_nodes(const CutMesh& mesh, const Skeleton& skeleton, std::size_t count) {
  std::vector<NodeIndex> nodes;
  for (const Bone& bone : skeleton.bones) nodes.insert(nodes.end(), {bone.head, bone.tail});
  std::sort(nodes.begin(), nodes.end());
  nodes.erase(std::unique(nodes.begin(), nodes.end()), nodes.end());
  nodes.resize(std::min(count, nodes.size()));
  std::vector<int> windings(nodes.size());
  for_each_index(nodes.size(), [&](std::size_t i) {
    windings[i] = winding_number(mesh.positions, mesh.origins, skeleton.nodes[nodes[i]].position);
  });
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    const Node& node = skeleton.nodes[nodes[i]];
    if (windings[i] > 0) continue;
    if (windings[i] < 0)
      throw TopologyError(fmt::format(
          "the mesh is turned inside out around node \"{}\" at {}; reverse the order of every triangle's vertices",
          node.name, text_of(skeleton, node.position)));
    refuse_outside_node(mesh, skeleton, nodes[i]);
  }
}

/// Per bone where it first meets the surface.
std::vector<double> first_crossings(const CutMesh& mesh, const Skeleton& skeleton) {
  std::vector<double> crossings(skeleton.bones.size());
  for_each_index(crossings.size(), [&](std::size_t b) {
    const BoneIndex bone = static_cast<int>(b);
    crossings[b] = first_crossing(mesh, end_position(skeleton, bone, BoneEnd::kHead),
                                  end_position(skeleton, bone, BoneEnd::kTail));
  });
  return crossings;
}

void check_bones(const Skeleton& skeleton, std::span<const double> crossings) {
  for (int b = 0; b < static_cast<int>(skeleton.bones.size()); ++b) {
    const Vec3 &head = end_position(skeleton, b, BoneEnd::kHead), &tail = end_position(skeleton, b, BoneEnd::kTail);
    const double t = crossings[b];
    if (t > 1) continue;
    const Bone& bone = skeleton.bones[b];
    throw TopologyError(fmt::format("bone \"{}\" leaves the mesh at {}, {:.0f} % of the way from node \"{}\" to node "
                                    "\"{}\"; move one of them, or bend the bone with a node in between",
                                    bone.name, text_of(skeleton, head + t * (tail - head)), 100 * t,
                                    skeleton.nodes[bone.head].name, skeleton.nodes[bone.tail].name),
                        b, -1);
  }
}

}  // namespace

void check_skeleton_inside(const CutMesh& mesh, const Skeleton& skeleton) {
  check_connected(skeleton);
  const std::vector<double> crossings = first_crossings(mesh, skeleton);
  // What hangs together and meets no surface lies on one side of it.
  const bool has_crossing = std::any_of(crossings.begin(), crossings.end(), [](double t) { return t <= 1; });
  check_nodes(mesh, skeleton, has_crossing ? skeleton.nodes.size() : 1);
  check_bones(skeleton, crossings);
}

}  // namespace skeletex
