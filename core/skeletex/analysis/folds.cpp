// SPDX-License-Identifier: MIT
#include "skeletex/analysis/folds.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <tuple>
#include <vector>

namespace skeletex {

FoldReport measure_folds(const TriangleMesh& mesh) {
  constexpr double kFolded = -0.5;  // cosine
  std::vector<Vec3> normals;
  std::vector<std::tuple<int, int, int>> sides;  // lower vertex, higher vertex, triangle
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    const Triangle& triangle = mesh.triangles[t];
    const Vec3 normal = (mesh.positions[triangle[1]] - mesh.positions[triangle[0]])
                            .cross(mesh.positions[triangle[2]] - mesh.positions[triangle[0]]);
    normals.push_back(normal.norm() > 0 ? Vec3(normal.normalized()) : Vec3::Zero());
    for (int i = 0; i < 3; ++i) {
      const int a = triangle[i], b = triangle[(i + 1) % 3];
      sides.emplace_back(std::min(a, b), std::max(a, b), static_cast<int>(t));
    }
  }
  std::sort(sides.begin(), sides.end());
  FoldReport report;
  for (std::size_t i = 0; i + 1 < sides.size(); ++i) {
    const auto& [a, b, first] = sides[i];
    const auto& [c, d, second] = sides[i + 1];
    if (a != c || b != d) continue;
    ++report.edges;
    if (normals[first].dot(normals[second]) < kFolded) ++report.folded_edges;
  }
  return report;
}

}  // namespace skeletex
