// SPDX-License-Identifier: MIT
#include "skeletex/edit/filter/neighbours.h"

#include <algorithm>
#include <numeric>

#include "skeletex/edit/filter/coarsen.h"
#include "skeletex/reconstruct/reconstruct_mesh.h"

namespace skeletex {
namespace {

constexpr int kSmallestLevel = 200;  // vertices

/// Puts the pairs of one vertex in order: each begins where the one before ends. An open fan begins with the pair that
/// none leads to, a closed one with the smallest vertex.
void order_fan(std::span<std::array<int, 2>> fan) {
  std::sort(fan.begin(), fan.end());
  const auto leads_to = [&](int vertex) {
    return std::any_of(fan.begin(), fan.end(), [&](const auto& pair) { return pair[1] == vertex; });
  };
  const auto start = std::find_if(fan.begin(), fan.end(), [&](const auto& pair) { return !leads_to(pair[0]); });
  if (start != fan.end()) std::swap(*fan.begin(), *start);
  for (std::size_t i = 1; i < fan.size(); ++i) {
    const auto next = std::find_if(fan.begin() + static_cast<std::ptrdiff_t>(i), fan.end(),
                                   [&](const auto& pair) { return pair[0] == fan[i - 1][1]; });
    std::swap(fan[i], *next);
  }
}

}  // namespace

Neighbours find_neighbours(const SkeletexModel& model, const Lattice& lattice,
                           std::span<const Triangle> end_triangles) {
  Neighbours result;
  result.inner_count = lattice.inner_count;
  result.vertex_count = lattice.vertex_count;
  for (std::size_t bone = 0; bone < model.patches.size(); ++bone) {
    const Rectangle& rectangle = model.patches[bone].rectangle;
    for (int row = 1; row < rectangle.height - 1; ++row)
      result.rows.push_back({lattice.first_inner[bone] + (row - 1) * rectangle.width, rectangle.width, row > 1,
                             row + 2 < rectangle.height});
  }
  for (const Triangle& triangle : end_triangles)
    result.fan_vertices.insert(result.fan_vertices.end(), triangle.begin(), triangle.end());
  std::sort(result.fan_vertices.begin(), result.fan_vertices.end());
  result.fan_vertices.erase(std::unique(result.fan_vertices.begin(), result.fan_vertices.end()),
                            result.fan_vertices.end());
  const auto place_of = [&](int vertex) {
    return std::lower_bound(result.fan_vertices.begin(), result.fan_vertices.end(), vertex) -
           result.fan_vertices.begin();
  };

  result.fan_begin.assign(result.fan_vertices.size() + 1, 0);
  for (const Triangle& triangle : end_triangles)
    for (const int vertex : triangle) ++result.fan_begin[place_of(vertex) + 1];
  std::partial_sum(result.fan_begin.begin(), result.fan_begin.end(), result.fan_begin.begin());
  result.fans.resize(3 * end_triangles.size());
  std::vector<int> next(result.fan_begin.begin(), result.fan_begin.end() - 1);
  for (const Triangle& triangle : end_triangles)
    for (int i = 0; i < 3; ++i)
      result.fans[next[place_of(triangle[i])]++] = {triangle[(i + 1) % 3], triangle[(i + 2) % 3]};
  for (std::size_t k = 0; k < result.fan_vertices.size(); ++k)
    order_fan(std::span(result.fans).subspan(result.fan_begin[k], result.fan_begin[k + 1] - result.fan_begin[k]));
  return result;
}

DeviceNeighbours upload_neighbours(ClContext& context, const Neighbours& neighbours) {
  constexpr int kColumnsPerBlock = 64;
  std::vector<std::array<int, 4>> blocks;
  for (std::size_t k = 0; k < neighbours.rows.size(); ++k) {
    const auto [first, width, has_before, has_after] = neighbours.rows[k];
    if (has_before) continue;
    int rows = 1;
    while (neighbours.rows[k + rows - 1][3]) ++rows;
    for (int column = 0; column < width; column += kColumnsPerBlock)
      blocks.push_back({first + column, std::min(kColumnsPerBlock, width - column), width, rows});
  }
  return {context.upload(neighbours.rows),
          context.upload(blocks),
          context.upload(neighbours.fan_vertices),
          context.upload(neighbours.fan_begin),
          context.upload(neighbours.fans),
          neighbours.inner_count,
          neighbours.vertex_count,
          nullptr};
}

std::shared_ptr<const DeviceCoarseLattice> upload_coarser(ClContext& context, const SkeletexModel& model,
                                                          const Lattice& lattice, const std::vector<Vec3>& positions) {
  const CoarseLattice coarse = coarsen(model, lattice, positions);
  const int fine_count = lattice.vertex_count, count = coarse.lattice.vertex_count;
  if (count > 0.6 * fine_count || count < kSmallestLevel) return nullptr;
  std::vector<int> begin(count + 1, 0);
  for (int v = 0; v < fine_count; ++v)
    for (int i = 0; i < 4; ++i)
      if (coarse.shares[v][i] > 0) ++begin[coarse.sources[v][i] + 1];
  std::partial_sum(begin.begin(), begin.end(), begin.begin());
  std::vector<int> readers(begin.back()), next(begin.begin(), begin.end() - 1);
  std::vector<float> shares(begin.back());
  for (int v = 0; v < fine_count; ++v)
    for (int i = 0; i < 4; ++i)
      if (coarse.shares[v][i] > 0) {
        const int at = next[coarse.sources[v][i]]++;
        readers[at] = v;
        shares[at] = coarse.shares[v][i];
      }
  DeviceNeighbours neighbours = upload_neighbours(
      context, find_neighbours(coarse.model, coarse.lattice, end_triangles(coarse.model, coarse.positions)));
  neighbours.coarser = upload_coarser(context, coarse.model, coarse.lattice, coarse.positions);
  return std::make_shared<const DeviceCoarseLattice>(DeviceCoarseLattice{
      std::move(neighbours), context.upload(coarse.picks), context.upload(coarse.sources),
      context.upload(coarse.shares), context.upload(begin), context.upload(readers), context.upload(shares)});
}

}  // namespace skeletex
