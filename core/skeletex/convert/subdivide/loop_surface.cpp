// SPDX-License-Identifier: MIT
#include "skeletex/convert/subdivide/loop_surface.h"

#include <fmt/format.h>

#include <OpenMesh/Tools/Subdivider/Uniform/LoopT.hh>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <unordered_map>
#include <utility>

#include "skeletex/geometry/half_edge.h"
#include "skeletex/math/portable.h"
#include "skeletex/model/error.h"

namespace skeletex {
namespace {

constexpr double kMostTriangles = 1e8;

using Subdivider = OpenMesh::Subdivider::Uniform::LoopT<HalfEdgeMesh, double>;

std::vector<Vec3> positions_of(const HalfEdgeMesh& mesh) {
  std::vector<Vec3> positions;
  positions.reserve(mesh.n_vertices());
  for (const auto vertex : mesh.vertices()) {
    const OpenMesh::Vec3d& p = mesh.point(vertex);
    positions.emplace_back(p[0], p[1], p[2]);
  }
  return positions;
}

std::size_t highest_valence(const HalfEdgeMesh& mesh) {
  std::size_t highest = 0;
  for (const auto vertex : mesh.vertices()) highest = std::max<std::size_t>(highest, mesh.valence(vertex));
  return highest;
}

/// The positions that the vertices converge to (Loop 1987; Hoppe et al. 1994).
std::vector<Vec3> limit_positions(const HalfEdgeMesh& mesh) {
  const std::vector<Vec3> positions = positions_of(mesh);
  std::vector<Vec3> limits = positions;
  for (const auto vertex : mesh.vertices()) {
    Vec3 sum = Vec3::Zero();
    int valence = 0;
    for (const auto neighbour : mesh.vv_range(vertex)) sum += positions[neighbour.idx()], ++valence;
    const double c = 3 + 2 * portable::cos(2 * std::numbers::pi / valence),
                 share = (40 - c * c) / 64;  // of the neighbours
    const double weight = 1 / (3 * valence / (8 * share) + valence);
    limits[vertex.idx()] = (1 - valence * weight) * positions[vertex.idx()] + weight * sum;
  }
  return limits;
}

/// A triangle's four: at its corners, then in the middle.
void append_quarters(const Triangle& corners, const Triangle& middles, std::vector<Triangle>& triangles) {
  const auto [a, b, c] = corners;
  const auto [ab, bc, ca] = middles;
  triangles.insert(triangles.end(), {{a, ab, ca}, {ab, b, bc}, {ca, bc, c}, {ab, bc, ca}});
}

/// Values at corners, divided; those at the middles of edges are means, once for each pair of values. Next to a corner
/// without a value there is none.
template <class T>
void divide(const std::vector<Triangle>& triangles, CornerValues<T>& values) {
  if (values.empty()) return;
  if (values.corners.empty()) values.corners = triangles;
  std::unordered_map<std::uint64_t, int> middles;
  const auto middle = [&](int a, int b) {
    if (a < 0 || b < 0) return -1;
    const std::uint64_t pair =
        static_cast<std::uint64_t>(std::min(a, b)) << 32 | static_cast<std::uint64_t>(std::max(a, b));
    const auto [it, is_new] = middles.try_emplace(pair, static_cast<int>(values.values.size()));
    if (is_new) {
      const T mean = (values.values[a] + values.values[b]) / 2;
      values.values.push_back(mean);
    }
    return it->second;
  };
  std::vector<Triangle> quarters;
  quarters.reserve(4 * values.corners.size());
  for (const Triangle& t : values.corners)
    append_quarters(t, {middle(t[0], t[1]), middle(t[1], t[2]), middle(t[2], t[0])}, quarters);
  values.corners = std::move(quarters);
}

/// \param triangles  of the mesh as it was before
/// \param edge_ends   per edge, whose middles are the new vertices, in their order
void divide_attributes(const std::vector<Triangle>& triangles, const std::vector<std::array<int, 2>>& edge_ends,
                       MeshAttributes& attributes) {
  divide(triangles, attributes.colours);
  divide(triangles, attributes.texture_coordinates);
  for (VertexNumbers& numbers : attributes.numbers)
    for (const auto& [a, b] : edge_ends) numbers.values.push_back((numbers.values[a] + numbers.values[b]) / 2);
  std::vector<int> materials;
  materials.reserve(4 * attributes.triangle_materials.size());
  for (const int material : attributes.triangle_materials) materials.insert(materials.end(), 4, material);
  attributes.triangle_materials = std::move(materials);
}

}  // namespace

AttributedMesh loop_surface(const TriangleMesh& mesh, const MeshAttributes& attributes, int rounds) {
  if (!(static_cast<double>(mesh.triangles.size()) * std::pow(4.0, rounds) <= kMostTriangles))
    throw InputError(fmt::format("{} triangles divided {} times are more than 100 million; divide them less often",
                                 mesh.triangles.size(), rounds));
  AttributedMesh result{mesh, attributes};
  result.attributes.normals = {};
  HalfEdgeMesh divided = build_half_edges(mesh);
  for (int round = 0; round < rounds; ++round) {
    // OpenMesh adds a vertex per edge, in the order of the edges. Its triangles come in an order of its own, so they
    // are made here.
    const int first_middle = static_cast<int>(divided.n_vertices());
    std::vector<std::array<int, 2>> edge_ends;
    edge_ends.reserve(divided.n_edges());
    for (const auto edge : divided.edges()) edge_ends.push_back({edge.v0().idx(), edge.v1().idx()});
    const auto middle = [&](int a, int b) {
      const auto half_edge =
          divided.find_halfedge(OpenMesh::SmartVertexHandle(a, &divided), OpenMesh::SmartVertexHandle(b, &divided));
      return first_middle + divided.edge_handle(half_edge).idx();
    };
    std::vector<Triangle> quarters;
    quarters.reserve(4 * result.mesh.triangles.size());
    for (const Triangle& t : result.mesh.triangles)
      append_quarters(t, {middle(t[0], t[1]), middle(t[1], t[2]), middle(t[2], t[0])}, quarters);
    divide_attributes(result.mesh.triangles, edge_ends, result.attributes);

    Subdivider subdivider;
    subdivider.init_weights(highest_valence(divided) + 1);
    subdivider.attach(divided);
    subdivider(1);
    subdivider.detach();
    result.mesh.triangles = std::move(quarters);
  }
  result.mesh.positions = limit_positions(divided);
  return result;
}

}  // namespace skeletex
