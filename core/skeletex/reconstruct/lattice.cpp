// SPDX-License-Identifier: MIT
#include "skeletex/reconstruct/lattice.h"

#include <fmt/format.h>

#include <algorithm>

#include "skeletex/model/error.h"

namespace skeletex {
namespace {

[[noreturn]] void refuse(const SkeletexModel& model, BoneIndex bone, int end, const std::string& what) {
  throw InputError(fmt::format("the model does not fit together at the {} of bone \"{}\": {}; encode it again",
                               end == 0 ? "head" : "tail", model.skeleton.bones[bone].name, what));
}

void check_end(const SkeletexModel& model, BoneIndex bone, int end, const std::vector<int>& loop) {
  const std::vector<ArcUse>& uses = model.ends[bone][end].arcs;
  for (std::size_t i = 0; i < uses.size(); ++i) {
    const SeamArc& arc = model.arcs[uses[i].arc];
    if (arc.is_closed()) {
      if (uses.size() > 1 || arc.samples.size() < 3)
        refuse(model, bone, end, "a closed arc needs three samples and no other arc at its end");
      continue;
    }
    if (arc.samples.empty())
      refuse(model, bone, end, fmt::format("arc {} has no sample between its corners", uses[i].arc));
    const ArcUse next = uses[(i + 1) % uses.size()];
    if (arc.corners[uses[i].is_reversed ? 0 : 1] != model.arcs[next.arc].corners[next.is_reversed ? 1 : 0])
      refuse(model, bone, end, fmt::format("arc {} does not end where arc {} starts", uses[i].arc, next.arc));
  }
  std::vector<int> sorted = loop;
  std::sort(sorted.begin(), sorted.end());
  if (sorted.size() < 3 || std::adjacent_find(sorted.begin(), sorted.end()) != sorted.end())
    refuse(model, bone, end, "its seam meets itself");
}

}  // namespace

std::vector<LatticeRow> lattice_rows(const std::vector<Patch>& patches, RowChoice choice) {
  const int margin = choice == RowChoice::kInner ? 1 : 0;
  std::vector<LatticeRow> rows;
  int vertex = 0, quad = 0;
  for (BoneIndex bone = 0; bone < static_cast<int>(patches.size()); ++bone) {
    const Rectangle& rectangle = patches[bone].rectangle;
    for (int row = margin; row < rectangle.height - margin; ++row) {
      rows.push_back({bone, row, vertex, quad});
      vertex += rectangle.width;
      if (row + 1 < rectangle.height - margin) quad += rectangle.width;
    }
  }
  return rows;
}

std::vector<LatticeRow> quad_rows(const std::vector<Patch>& patches) {
  std::vector<LatticeRow> rows = lattice_rows(patches, RowChoice::kInner);
  std::erase_if(rows, [&](const LatticeRow& row) { return row[1] == patches[row[0]].rectangle.height - 2; });
  return rows;
}

Lattice number_lattice(const SkeletexModel& model) {
  const int count = static_cast<int>(model.patches.size());
  Lattice lattice;
  lattice.first_inner.resize(count);
  lattice.first_quad.resize(count);
  lattice.poles.assign(count, {-1, -1});
  for (BoneIndex bone = 0; bone < count; ++bone) {
    const auto [x, y, width, height] = model.patches[bone].rectangle;
    if (width < 4 || height < 4)
      throw InputError(fmt::format("bone \"{}\" has a rectangle of {} x {} texels; 4 x 4 is the least",
                                   model.skeleton.bones[bone].name, width, height));
    lattice.first_inner[bone] = lattice.inner_count;
    lattice.first_quad[bone] = lattice.quad_count;
    lattice.inner_count += width * (height - 2);
    lattice.quad_count += width * (height - 3);
  }
  int next = lattice.inner_count;
  for (BoneIndex bone = 0; bone < count; ++bone)
    for (int end = 0; end < 2; ++end)
      if (model.ends[bone][end].arcs.empty()) lattice.poles[bone][end] = next++;
  for (const SeamArc& arc : model.arcs) {
    lattice.first_sample.push_back(next);
    next += static_cast<int>(arc.samples.size());
  }
  lattice.first_corner = next;
  lattice.vertex_count = next + static_cast<int>(model.corners.size());

  lattice.triangle_count = 2 * lattice.quad_count;
  for (BoneIndex bone = 0; bone < count; ++bone)
    for (int end = 0; end < 2; ++end) {
      lattice.triangle_count += model.patches[bone].rectangle.width;
      if (lattice.poles[bone][end] >= 0) continue;
      const std::vector<int> loop = end_loop(model, lattice, bone, static_cast<BoneEnd>(end));
      check_end(model, bone, end, loop);
      lattice.triangle_count += static_cast<int>(loop.size());
    }
  return lattice;
}

std::vector<int> end_loop(const SkeletexModel& model, const Lattice& lattice, BoneIndex bone, BoneEnd end) {
  std::vector<int> loop;
  for (const ArcUse use : model.ends[bone][static_cast<int>(end)].arcs) {
    const SeamArc& arc = model.arcs[use.arc];
    const int samples = static_cast<int>(arc.samples.size());
    if (!arc.is_closed()) loop.push_back(lattice.first_corner + arc.corners[use.is_reversed ? 1 : 0]);
    for (int i = 0; i < samples; ++i)
      loop.push_back(lattice.first_sample[use.arc] + (use.is_reversed ? samples - 1 - i : i));
  }
  return loop;
}

std::vector<int> end_row(const SkeletexModel& model, const Lattice& lattice, BoneIndex bone, BoneEnd end) {
  const Rectangle& rectangle = model.patches[bone].rectangle;
  const int first = lattice.first_inner[bone] + (end == BoneEnd::kHead ? 0 : (rectangle.height - 3) * rectangle.width);
  std::vector<int> row(rectangle.width);
  for (int column = 0; column < rectangle.width; ++column) row[column] = first + column;
  return row;
}

void append_pole_fan(std::span<const int> row, int pole, BoneEnd end, std::vector<Triangle>& triangles) {
  for (std::size_t j = 0; j < row.size(); ++j) {
    const int here = row[j], next = row[(j + 1) % row.size()];
    if (end == BoneEnd::kHead)
      triangles.push_back({pole, next, here});
    else
      triangles.push_back({here, next, pole});
  }
}

void append_pole_fan(const SkeletexModel& model, const Lattice& lattice, BoneIndex bone, BoneEnd end,
                     std::vector<Triangle>& triangles) {
  append_pole_fan(end_row(model, lattice, bone, end), lattice.poles[bone][static_cast<int>(end)], end, triangles);
}

}  // namespace skeletex
