// SPDX-License-Identifier: MIT
#include "skeletex/edit/filter/neighbours.h"

#include <algorithm>
#include <map>

#include "skeletex/edit/filter/coarsen.h"
#include "skeletex/reconstruct/reconstruct_mesh.h"

namespace skeletex {
namespace {

constexpr int kSmallestLevel = 200;  // vertices

/// Sorts the pairs of one vertex so that each begins where the one before ends. An open fan begins with the pair that
/// no other leads to, a closed one with the smallest vertex.
void order_fan(std::span<std::array<int, 2>> fan) {
  std::sort(fan.begin(), fan.end());
  const auto leads_to = [&](VertexIndex vertex) {
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
  std::map<int, std::vector<std::array<int, 2>>> fans;
  for (const Triangle& triangle : end_triangles)
    for (int i = 0; i < 3; ++i) fans[triangle[i]].push_back({triangle[(i + 1) % 3], triangle[(i + 2) % 3]});
  for (auto& [vertex, fan] : fans) {
    order_fan(fan);
    result.fan_vertices.push_back({vertex, static_cast<int>(result.fans.size())});
    result.fans.insert(result.fans.end(), fan.begin(), fan.end());
  }
  result.fan_vertices.push_back({-1, static_cast<int>(result.fans.size())});
  return result;
}

void mark_ends(const SkeletexModel& model, const Lattice& lattice, const std::vector<bool>& is_chosen,
               std::vector<float>& values) {
  const auto are_chosen = [&](const auto& bones) {
    return std::all_of(bones.begin(), bones.end(), [&](BoneIndex bone) { return is_chosen[bone]; });
  };
  for (std::size_t bone = 0; bone < model.patches.size(); ++bone)
    for (const int pole : lattice.poles[bone])
      if (pole >= 0 && is_chosen[bone]) values[pole] = 1;
  for (std::size_t a = 0; a < model.arcs.size(); ++a)
    if (are_chosen(model.arcs[a].bones))
      std::fill_n(values.begin() + lattice.first_sample[a], model.arcs[a].samples.size(), 1.f);
  for (std::size_t c = 0; c < model.corners.size(); ++c)
    if (are_chosen(model.corners[c].bones)) values[lattice.first_corner + c] = 1;
}

SurfaceParameters DeviceNeighbours::parameters(int components) const {
  SurfaceParameters parameters{};
  parameters.row_count = static_cast<int>(rows.size);
  parameters.block_count = static_cast<int>(column_blocks.size);
  parameters.fan_count = fan_count();
  parameters.inner_count = inner_count;
  parameters.count = vertex_count;
  parameters.components = components;
  if (coarser) parameters.coarse_count = static_cast<int>(coarser->picks.size);
  return parameters;
}

ClRange rows_range(const ClContext& context, const DeviceNeighbours& neighbours) {
  return row_range(context, neighbours.rows.size);
}

ClRange fans_range(const ClContext& context, const DeviceNeighbours& neighbours) {
  return row_range(context, (neighbours.fan_count() + FAN_CHUNK - 1) / FAN_CHUNK);
}

DeviceNeighbours upload_neighbours(ClContext& context, const Neighbours& neighbours) {
  constexpr int kColumnsPerBlock = 64;
  std::vector<ColumnBlock> blocks;
  for (std::size_t k = 0; k < neighbours.rows.size(); ++k) {
    const auto [first, width, has_before, has_after] = neighbours.rows[k];
    if (has_before) continue;
    int rows = 1;
    while (neighbours.rows[k + rows - 1].has_after) ++rows;
    for (int column = 0; column < width; column += kColumnsPerBlock)
      blocks.push_back({first + column, std::min(kColumnsPerBlock, width - column), width, rows});
  }
  return {context.upload(neighbours.rows),
          context.upload(blocks),
          context.upload(neighbours.fan_vertices),
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
  struct Reader {
    VertexIndex vertex;
    float share;
  };
  std::vector<std::vector<Reader>> readers_of(count);
  for (int v = 0; v < fine_count; ++v)
    for (int i = 0; i < 4; ++i)
      if (coarse.shares[v][i] > 0) readers_of[coarse.sources[v][i]].push_back({v, coarse.shares[v][i]});
  std::vector<int> begin{0}, readers;
  std::vector<float> shares;
  for (const std::vector<Reader>& of_vertex : readers_of) {
    for (const auto [vertex, share] : of_vertex) readers.push_back(vertex), shares.push_back(share);
    begin.push_back(static_cast<int>(readers.size()));
  }
  DeviceNeighbours neighbours = upload_neighbours(
      context, find_neighbours(coarse.model, coarse.lattice, end_triangles(coarse.model, coarse.positions)));
  neighbours.coarser = upload_coarser(context, coarse.model, coarse.lattice, coarse.positions);
  return std::make_shared<const DeviceCoarseLattice>(DeviceCoarseLattice{
      std::move(neighbours), context.upload(coarse.picks), context.upload(coarse.sources),
      context.upload(coarse.shares), context.upload(begin), context.upload(readers), context.upload(shares)});
}

}  // namespace skeletex
