// SPDX-License-Identifier: MIT
#include "skeletex/reconstruct/lattice_mesh.h"

#include <algorithm>

#include "skeletex/model/parallel.h"

namespace skeletex {

LatticeMesh::LatticeMesh(ClContext& context, const SkeletexModel& model, DiagonalRule rule, ClBuffer<PatchRecord> patches, DevicePlanes points)
    : context_(context),
      model_(model),
      rule_(rule),
      walls_(model.skeleton),
      lattice_(number_lattice(model)),
      texel_patches_(static_cast<std::size_t>(model.texture.width) * model.texture.height, -1),
      positions_(lattice_.vertex_count),
      points_(std::move(points)),
      patches_(std::move(patches)) {
  std::vector<LatticeRow> rows = lattice_rows(model.patches, RowChoice::kInner);
  std::erase_if(rows, [&](const LatticeRow& row) { return row[1] == model.patches[row[0]].rectangle.height - 2; });
  rows_ = context.upload(rows);
  // Before the kernel is queued, so that the host can go on beside it.
  planes_ = {context.download(points_.x), context.download(points_.y), context.download(points_.z)};
  device_diagonals_ = context.allocate<int>(texel_patches_.size());
  context.launch({"lattice.cl", "choose_diagonals"}, row_range(context, rows.size()), static_cast<int>(rows.size()), model.texture.width,
                 static_cast<int>(rule == DiagonalRule::kSmooth), rows_, patches_, points_.x, points_.y, points_.z, device_diagonals_);
  for (std::size_t bone = 0; bone < model.patches.size(); ++bone) {
    const Rectangle& r = model.patches[bone].rectangle;
    for (int row = 0; row < r.height; ++row)
      std::fill_n(texel_patches_.begin() + (r.y + row) * static_cast<std::ptrdiff_t>(model.texture.width) + r.x, r.width, static_cast<int>(bone));
  }
  place_seams(model, walls_, lattice_, positions_);
  for_each_pole(model, lattice_, [&](int vertex, int, int, std::size_t texel) { positions_[vertex] = position(static_cast<int>(texel)); });
  for (int vertex = texel_count(); vertex < vertex_count(); ++vertex) {
    end_points_.emplace_back(0);
    end_points_.back().head<3>() = (position(vertex) - model.origin).cast<float>();
  }
  std::vector<std::vector<Triangle>> ends(2 * model.patches.size());
  for_each_block(ends.size(), 1, [&](std::size_t i, std::size_t, std::size_t) { ends[i] = fill_end(static_cast<int>(i / 2), static_cast<BoneEnd>(i % 2)); });
  first_end_.push_back(0);
  for (const std::vector<Triangle>& end : ends) {
    end_triangles_.insert(end_triangles_.end(), end.begin(), end.end());
    first_end_.push_back(static_cast<int>(end_triangles_.size()));
  }
  diagonals_ = context.download(device_diagonals_);
}

/// The strip or fan of an end.
std::vector<Triangle> LatticeMesh::fill_end(int bone, BoneEnd end) {
  const Rectangle& r = model_.patches[bone].rectangle;
  const int first_texel = (r.y + (end == BoneEnd::kHead ? 1 : r.height - 2)) * model_.texture.width + r.x;
  const int first_vertex = end_row(model_, lattice_, bone, end)[0];
  for (int j = 0; j < r.width; ++j) positions_[first_vertex + j] = position(first_texel + j);
  std::vector<Triangle> triangles;
  append_end_triangles(model_, walls_, lattice_, positions_, bone, end, triangles);
  for (Triangle& triangle : triangles)
    for (int& vertex : triangle) vertex += vertex < lattice_.inner_count ? first_texel - first_vertex : texel_count() - lattice_.inner_count;
  return triangles;
}

int LatticeMesh::beside(int texel, int columns, int rows) const {
  const Rectangle& r = model_.patches[texel_patches_[texel]].rectangle;
  const int column = texel % model_.texture.width - r.x;
  return texel + rows * model_.texture.width + ((column + columns) % r.width + r.width) % r.width - column;
}

Triangle LatticeMesh::triangle(int index) const {
  if (index >= first_end_triangle()) return end_triangles_[index - first_end_triangle()];
  return triangles_of(index / 2, beside(index / 2, 1, 0))[index % 2];
}

std::vector<int> LatticeMesh::move(std::span<const int> texels, const LatticeMesh& home) {
  if (texels.empty()) return {};
  std::vector<char> is_moved(texel_patches_.size(), 0);
  std::vector<int> quads;
  std::vector<char> has_moved_end(2 * model_.patches.size(), 0);
  for (const int texel : texels) {
    is_moved[texel] = 1;
    for (int axis = 0; axis < 3; ++axis) planes_[axis][texel] = home.planes_[axis][texel];
    const int bone = texel_patches_[texel];
    const Rectangle& r = model_.patches[bone].rectangle;
    const int row = texel / model_.texture.width - r.y;
    if (row == 1) has_moved_end[2 * bone] = 1;
    if (row == r.height - 2) has_moved_end[2 * bone + 1] = 1;
    // The diagonal of a quad depends on the 4 x 4 vertices around it.
    for (int i = std::max(1, row - 2); i <= std::min(r.height - 3, row + 1); ++i)
      for (int j = -2; j <= 1; ++j) quads.push_back(beside(texel, j, i - row));
  }
  std::sort(quads.begin(), quads.end());
  quads.erase(std::unique(quads.begin(), quads.end()), quads.end());

  std::vector<int> changed, patches;
  for (const int quad : quads) patches.push_back(texel_patches_[quad]);
  auto chosen = context_.allocate<int>(quads.size());
  context_.launch({"lattice.cl", "choose_listed_diagonals"}, ClRange(quads.size()), static_cast<int>(quads.size()), model_.texture.width,
                  static_cast<int>(rule_ == DiagonalRule::kSmooth), context_.upload(quads), context_.upload(patches), patches_, points_.x, points_.y,
                  points_.z, device_diagonals_, chosen);
  const std::vector<int> now = context_.download(chosen);
  for (std::size_t i = 0; i < quads.size(); ++i) {
    const bool is_other = now[i] != diagonals_[quads[i]];
    diagonals_[quads[i]] = now[i];
    for (const int index : {2 * quads[i], 2 * quads[i] + 1}) {
      const Triangle t = triangle(index);
      if (is_other || is_moved[t[0]] || is_moved[t[1]] || is_moved[t[2]]) changed.push_back(index);
    }
  }
  for (std::size_t end = 0; end < has_moved_end.size(); ++end) {
    if (!has_moved_end[end]) continue;
    const std::vector<Triangle> made = fill_end(static_cast<int>(end / 2), static_cast<BoneEnd>(end % 2));
    for (std::size_t i = 0; i < made.size(); ++i) {
      Triangle& triangle = end_triangles_[first_end_[end] + i];
      const bool is_other = triangle != made[i];
      triangle = made[i];
      if (is_other || std::any_of(made[i].begin(), made[i].end(), [&](int vertex) { return is_texel(vertex) && is_moved[vertex]; }))
        changed.push_back(first_end_triangle() + first_end_[end] + static_cast<int>(i));
    }
  }
  return changed;
}

}  // namespace skeletex
