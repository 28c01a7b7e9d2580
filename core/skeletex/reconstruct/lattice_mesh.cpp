// SPDX-License-Identifier: MIT
#include "skeletex/reconstruct/lattice_mesh.h"

#include <algorithm>

#include "skeletex/model/parallel.h"

namespace skeletex {

LatticeMesh::LatticeMesh(ClContext& context, const SkeletexModel& model, DiagonalRule rule, const Planes& planes)
    : context_(context),
      model_(model),
      rule_(rule),
      walls_(model.skeleton),
      lattice_(number_lattice(model)),
      quads_(upload_quads(context, model, walls_)) {
  std::vector<LatticeRow> rows = lattice_rows(model.patches, RowChoice::kInner);
  int quad_rows = 0;
  for (const Patch& patch : model.patches) {
    first_row_.push_back(quad_rows);
    quad_rows += patch.rectangle.height - 3;
  }
  texels_.resize(lattice_.inner_count);
  mesh_.positions.resize(lattice_.vertex_count);
  for (auto& plane : points_) plane.resize(texels_.size());
  for_each_block(rows.size(), 32, [&](std::size_t, std::size_t begin, std::size_t end) {
    for (std::size_t k = begin; k < end; ++k) {
      const auto [patch, row, vertex, quad] = rows[k];
      const Rectangle& r = model.patches[patch].rectangle;
      const int texel = (r.y + row) * model.texture.width + r.x;
      for (int j = 0; j < r.width; ++j) {
        texels_[vertex + j] = texel + j;
        for (int axis = 0; axis < 3; ++axis) {
          points_[axis][vertex + j] = planes[axis][texel + j];
          mesh_.positions[vertex + j][axis] = model.origin[axis] + static_cast<double>(planes[axis][texel + j]);
        }
      }
    }
  });
  device_points_ = {context.upload(points_[0]), context.upload(points_[1]), context.upload(points_[2])};
  for_each_pole(model, lattice_, [&](int vertex, int, int, std::size_t texel) {
    for (int axis = 0; axis < 3; ++axis) mesh_.positions[vertex][axis] = model.origin[axis] + static_cast<double>(planes[axis][texel]);
  });
  place_seams(model, walls_, lattice_, mesh_.positions);
  device_triangles_ = triangulate(context, rule, quads_, lattice_, device_points_);
  mesh_.triangles = context.download(device_triangles_);
  mesh_.triangles.resize(2 * static_cast<std::size_t>(lattice_.quad_count));
  first_end_.resize(model.patches.size());
  for (std::size_t bone = 0; bone < model.patches.size(); ++bone)
    for (const BoneEnd end : {BoneEnd::kHead, BoneEnd::kTail}) {
      first_end_[bone][static_cast<int>(end)] = mesh_.triangles.size();
      append_end_triangles(model, walls_, lattice_, mesh_.positions, static_cast<int>(bone), end, mesh_.triangles);
    }
}

int LatticeMesh::patch_of(int vertex) const {
  return static_cast<int>(std::upper_bound(lattice_.first_inner.begin(), lattice_.first_inner.end(), vertex) - lattice_.first_inner.begin()) - 1;
}

void LatticeMesh::retriangulate(std::span<const int> quads) {
  std::vector<int> listed;
  for (const int quad : quads) {
    const auto bone = std::upper_bound(lattice_.first_quad.begin(), lattice_.first_quad.end(), quad) - lattice_.first_quad.begin() - 1;
    const int at = quad - lattice_.first_quad[bone], width = model_.patches[bone].rectangle.width;
    listed.push_back(first_row_[bone] + at / width);
    listed.push_back(at % width);
  }
  const auto triangles = context_.allocate<Triangle>(2 * quads.size());
  context_.launch({"reconstruct.cl", "triangulate_listed"}, ClRange(quads.size()), static_cast<int>(quads.size()),
                  static_cast<int>(rule_ == DiagonalRule::kSmooth), context_.upload(listed), quads_.rows, quads_.patches, device_points_.x,
                  device_points_.y, device_points_.z, device_triangles_, triangles);
  const std::vector<Triangle> made = context_.download(triangles);
  for (std::size_t i = 0; i < made.size(); ++i) mesh_.triangles[2 * static_cast<std::size_t>(quads[i / 2]) + i % 2] = made[i];
}

std::vector<int> LatticeMesh::move(std::span<const int> vertices, const Planes& planes) {
  if (vertices.empty()) return {};
  std::vector<char> is_moved(lattice_.vertex_count, 0);
  std::vector<int> quads;
  std::vector<std::array<char, 2>> has_moved_end(model_.patches.size(), {0, 0});
  for (const int vertex : vertices) {
    is_moved[vertex] = 1;
    for (int axis = 0; axis < 3; ++axis) {
      points_[axis][vertex] = planes[axis][texels_[vertex]];
      mesh_.positions[vertex][axis] = model_.origin[axis] + static_cast<double>(points_[axis][vertex]);
    }
    const int bone = patch_of(vertex);
    const Rectangle& r = model_.patches[bone].rectangle;
    const int at = vertex - lattice_.first_inner[bone], row = at / r.width, column = at % r.width;
    if (row == 0) has_moved_end[bone][0] = 1;
    if (row == r.height - 3) has_moved_end[bone][1] = 1;
    // The diagonal of a quad depends on the 4 x 4 vertices around it.
    for (int i = std::max(0, row - 2); i <= std::min(r.height - 4, row + 1); ++i)
      for (int j = column - 2; j <= column + 1; ++j) quads.push_back(lattice_.first_quad[bone] + i * r.width + (j + r.width) % r.width);
  }
  std::sort(quads.begin(), quads.end());
  quads.erase(std::unique(quads.begin(), quads.end()), quads.end());
  context_.write(device_points_.x, points_[0]), context_.write(device_points_.y, points_[1]), context_.write(device_points_.z, points_[2]);

  std::vector<int> candidates;
  std::vector<Triangle> before;
  const auto add = [&](std::size_t triangle) {
    candidates.push_back(static_cast<int>(triangle));
    before.push_back(mesh_.triangles[triangle]);
  };
  for (const int quad : quads) add(2 * static_cast<std::size_t>(quad)), add(2 * static_cast<std::size_t>(quad) + 1);
  if (!quads.empty()) retriangulate(quads);
  for (std::size_t bone = 0; bone < has_moved_end.size(); ++bone)
    for (const BoneEnd end : {BoneEnd::kHead, BoneEnd::kTail}) {
      if (!has_moved_end[bone][static_cast<int>(end)]) continue;
      std::vector<Triangle> made;
      append_end_triangles(model_, walls_, lattice_, mesh_.positions, static_cast<int>(bone), end, made);
      const std::size_t first = first_end_[bone][static_cast<int>(end)];
      for (std::size_t i = 0; i < made.size(); ++i) {
        add(first + i);
        mesh_.triangles[first + i] = made[i];
      }
    }
  std::vector<int> changed;
  for (std::size_t i = 0; i < candidates.size(); ++i) {
    const Triangle& now = mesh_.triangles[candidates[i]];
    if (now != before[i] || is_moved[now[0]] || is_moved[now[1]] || is_moved[now[2]]) changed.push_back(candidates[i]);
  }
  return changed;
}

}  // namespace skeletex
