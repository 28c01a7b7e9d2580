// SPDX-License-Identifier: MIT
#include "subdivide.h"

#include <algorithm>
#include <cstdint>
#include <unordered_map>

namespace skeletex {

TriangleMesh subdivided(const TriangleMesh& mesh) {
  TriangleMesh fine{mesh.positions, {}};
  fine.triangles.reserve(4 * mesh.triangles.size());
  std::unordered_map<std::uint64_t, int> middles;
  middles.reserve(3 * mesh.triangles.size() / 2);
  const auto middle = [&](int a, int b) {
    const std::uint64_t edge =
        static_cast<std::uint64_t>(std::min(a, b)) << 32 | static_cast<std::uint64_t>(std::max(a, b));
    const auto [it, is_new] = middles.try_emplace(edge, static_cast<int>(fine.positions.size()));
    if (is_new) fine.positions.push_back(0.5 * (mesh.positions[a] + mesh.positions[b]));
    return it->second;
  };
  for (const auto& [a, b, c] : mesh.triangles) {
    const int ab = middle(a, b), bc = middle(b, c), ca = middle(c, a);
    fine.triangles.insert(fine.triangles.end(), {{a, ab, ca}, {ab, b, bc}, {ca, bc, c}, {ab, bc, ca}});
  }
  return fine;
}

}  // namespace skeletex
