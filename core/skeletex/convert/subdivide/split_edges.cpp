// SPDX-License-Identifier: MIT
#include "skeletex/convert/subdivide/split_edges.h"

#include <algorithm>
#include <array>
#include <map>

namespace skeletex {
namespace {

double edge_length(const TriangleMesh& mesh, const Triangle& t, int k) {
  return (mesh.positions[t[(k + 1) % 3]] - mesh.positions[t[k]]).norm();
}

/// The vertices in the middle of split edges by the ends of those, the smaller number first.
using Middles = std::map<std::pair<int, int>, int>;

/// Numbers those vertices from the mesh's last one on.
Middles number_middles(const TriangleMesh& mesh, double longest, double least_area) {
  Middles middles;
  for (const Triangle& t : mesh.triangles) {
    if (area_vector(mesh, t).norm() < least_area) continue;
    for (int k = 0; k < 3; ++k)
      if (edge_length(mesh, t, k) > longest)
        middles.try_emplace(std::minmax(t[k], t[(k + 1) % 3]),
                            static_cast<int>(mesh.positions.size() + middles.size()));
  }
  return middles;
}

/// The parts of a triangle. Where two edges are split, the quad that is left is cut along its shorter diagonal.
void append_parts(const TriangleMesh& mesh, const Triangle& triangle, const Middles& middles,
                  std::vector<Triangle>& parts) {
  const auto middle_of = [&](int k) {
    const int a = triangle[k], b = triangle[(k + 1) % 3];
    const auto found = middles.find({std::min(a, b), std::max(a, b)});
    return found == middles.end() ? -1 : found->second;
  };
  const std::array<int, 3> middle{middle_of(0), middle_of(1), middle_of(2)};
  const auto count = std::count_if(middle.begin(), middle.end(), [](int m) { return m >= 0; });
  if (count == 0) {
    parts.push_back(triangle);
    return;
  }
  // Of one split edge, begin with its first end; of two, with the corner where they meet.
  int first = 0;
  while (count == 1 ? middle[first] < 0 : count == 2 && middle[(first + 1) % 3] >= 0) ++first;
  const int a = triangle[first], b = triangle[(first + 1) % 3], c = triangle[(first + 2) % 3];
  const int ab = middle[first], bc = middle[(first + 1) % 3], ca = middle[(first + 2) % 3];
  if (count == 1) {
    parts.insert(parts.end(), {{a, ab, c}, {ab, b, c}});
    return;
  }
  parts.push_back({a, ab, ca});
  if (count == 3) {
    parts.insert(parts.end(), {{ab, b, bc}, {ca, bc, c}, {ab, bc, ca}});
    return;
  }
  const auto distance = [&](int i, int j) { return (mesh.positions[i] - mesh.positions[j]).squaredNorm(); };
  if (distance(ab, c) < distance(b, ca))
    parts.insert(parts.end(), {{ab, b, c}, {ab, c, ca}});
  else
    parts.insert(parts.end(), {{ab, b, ca}, {b, c, ca}});
}

}  // namespace

std::optional<TriangleMesh> split_long_edges(const TriangleMesh& mesh, double longest, double least_area) {
  std::optional<TriangleMesh> result;
  while (true) {
    const TriangleMesh& coarse = result ? *result : mesh;
    const Middles middles = number_middles(coarse, longest, least_area);
    if (middles.empty()) return result;
    TriangleMesh finer{coarse.positions, {}};
    finer.positions.resize(coarse.positions.size() + middles.size());
    for (const auto& [ends, middle] : middles)
      finer.positions[middle] = 0.5 * (coarse.positions[ends.first] + coarse.positions[ends.second]);
    for (const Triangle& triangle : coarse.triangles) append_parts(finer, triangle, middles, finer.triangles);
    result = std::move(finer);
  }
}

double share_to_split(const TriangleMesh& mesh, double longest, double least_area) {
  double share = 0, all = 0;
  for (const Triangle& t : mesh.triangles) {
    const double area = area_vector(mesh, t).norm();
    const bool is_split = area >= least_area && std::max({edge_length(mesh, t, 0), edge_length(mesh, t, 1),
                                                          edge_length(mesh, t, 2)}) > longest;
    all += area;
    share += is_split ? area : 0;
  }
  return all > 0 ? share / all : 0;
}

}  // namespace skeletex
