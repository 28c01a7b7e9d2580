// SPDX-License-Identifier: MIT
#include "simplify.h"

#include <meshoptimizer.h>

#include <vector>

namespace skeletex {

TriangleMesh simplify(const TriangleMesh& mesh, int vertices) {
  std::vector<unsigned> indices;
  for (const Triangle& t : mesh.triangles)
    for (const int corner : t) indices.push_back(corner);
  std::vector<float> positions;
  for (const Vec3& p : mesh.positions)
    for (int k = 0; k < 3; ++k) positions.push_back(static_cast<float>(p[k]));
  // Collapsing edges keeps the Euler characteristic: V - F/2 stays.
  const std::size_t triangles =
      mesh.triangles.size() - 2 * (mesh.positions.size() - static_cast<std::size_t>(vertices));
  std::vector<unsigned> kept(indices.size());
  kept.resize(meshopt_simplify(kept.data(), indices.data(), indices.size(), positions.data(), mesh.positions.size(),
                               3 * sizeof(float), 3 * triangles, 1.0f, 0, nullptr));

  TriangleMesh result;
  std::vector<int> numbers(mesh.positions.size(), -1);
  for (std::size_t i = 0; i < kept.size(); i += 3) {
    Triangle triangle{};
    for (int k = 0; k < 3; ++k) {
      int& number = numbers[kept[i + k]];
      if (number < 0) {
        number = static_cast<int>(result.positions.size());
        result.positions.push_back(mesh.positions[kept[i + k]]);
      }
      triangle[k] = number;
    }
    result.triangles.push_back(triangle);
  }
  return result;
}

}  // namespace skeletex
