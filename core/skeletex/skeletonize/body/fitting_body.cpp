// SPDX-License-Identifier: MIT
#include "skeletex/skeletonize/body/fitting_body.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>
#include <vector>

#include "skeletex/skeletonize/body/curve_graph.h"
#include "skeletex/skeletonize/body/thinning.h"

namespace skeletex {
namespace {

/// Numbers of voxels that are tried until the body hangs together and has the mesh's handles.
constexpr std::array<int, 4> kVoxelCounts{60'000, 180'000, 480'000, 1'500'000};
constexpr int kTrusted = 180'000;  // so many voxels that rings too many are the shape's, and are opened later
constexpr double kWhole = 0.97;    // share of the voxels that must hang together

}  // namespace

int genus_of(const TriangleMesh& mesh) {
  std::vector<char> is_used(mesh.positions.size(), 0);
  for (const Triangle& triangle : mesh.triangles)
    for (const VertexIndex vertex : triangle) is_used[vertex] = 1;
  const auto vertices = static_cast<int>(std::count(is_used.begin(), is_used.end(), 1));
  return (2 - (vertices - static_cast<int>(mesh.triangles.size()) / 2)) / 2;
}

VoxelBody make_fitting_body(const Surface& surface, int genus) {
  VoxelBody best;
  int least = -1;
  for (const int count : kVoxelCounts) {
    VoxelBody body = make_voxel_body(surface, count);
    if (body.size() == 0) continue;
    const CurveGraph graph = make_curve_graph(body, thin_body(body, {}));
    const int cycles = graph.cycles();
    const int off = std::abs(cycles - genus) + (body.kept < kWhole ? 1 : 0) + (cycles < genus ? 1000 : 0);
    if (least < 0 || off < least) least = off, best = std::move(body);
    if (least == 0 || (least < 1000 && best.kept >= kWhole && count >= kTrusted)) break;
  }
  return best;
}

}  // namespace skeletex
