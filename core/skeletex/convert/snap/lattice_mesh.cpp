// SPDX-License-Identifier: MIT
#include "skeletex/convert/snap/lattice_mesh.h"

#include <algorithm>
#include <numeric>
#include <tuple>
#include <utility>

#include "skeletex/geometry/parallel.h"

namespace skeletex {

namespace {

constexpr int kBandRows = 16, kBandColumns = 64;  // of choose_diagonals, columns as in lattice.cl: each group works out
                                                  // the normals of two rows more
constexpr int kRun = 8;                           // quads of choose_listed_diagonals, as in lattice.cl

/// Poles, samples of seams and corners of a lattice alone, which has no more vertices.
Lattice without_rows(Lattice lattice) {
  for (std::array<int, 2>& poles : lattice.poles)
    for (int& pole : poles) pole = pole < 0 ? pole : pole - lattice.inner_count;
  for (int& sample : lattice.first_sample) sample -= lattice.inner_count;
  lattice.first_corner -= lattice.inner_count, lattice.vertex_count -= lattice.inner_count, lattice.inner_count = 0;
  return lattice;
}

}  // namespace

std::vector<LatticeRow> quad_rows(const std::vector<Patch>& patches) {
  std::vector<LatticeRow> rows = lattice_rows(patches, RowChoice::kInner);
  std::erase_if(rows, [&](const LatticeRow& row) { return row[1] == patches[row[0]].rectangle.height - 2; });
  return rows;
}

void choose_diagonals(ClContext& context, DiagonalRule rule, const std::vector<Patch>& patches, int texture_width,
                      const ClBuffer<LatticeRow>& rows, const ClBuffer<PatchRecord>& records, const TexelPoints& points,
                      ClBuffer<int>& diagonals) {
  const int count = static_cast<int>(rows.size);
  int widest = 0;
  for (const Patch& patch : patches) widest = std::max(widest, patch.rectangle.width);
  ClRange groups = row_range(context, (count + kBandRows - 1) / kBandRows);
  groups.global[1] = (widest + kBandColumns - 1) / kBandColumns;
  context.launch({"lattice.cl", "choose_diagonals"}, groups, count, kBandRows, texture_width,
                 static_cast<int>(rule == DiagonalRule::kSmooth), rows, records, points.x, points.y, points.z,
                 diagonals);
}

std::shared_ptr<const LatticeFrame> frame_lattice(const SkeletexModel& model) {
  LatticeFrame frame{without_rows(number_lattice(model)), {}, {}, {}, {0}};
  frame.texel_patches.assign(static_cast<std::size_t>(model.texture.width) * model.texture.height, -1);
  for (std::size_t bone = 0; bone < model.patches.size(); ++bone) {
    const Rectangle& r = model.patches[bone].rectangle;
    for (int row = 0; row < r.height; ++row)
      std::fill_n(frame.texel_patches.begin() + (r.y + row) * static_cast<std::ptrdiff_t>(model.texture.width) + r.x,
                  r.width, static_cast<int>(bone));
  }
  const SeparationPlanes separation(model.skeleton);
  frame.positions.resize(frame.ends.vertex_count);
  place_seams(model, separation, frame.ends, frame.positions);
  frame.seams.resize(2 * model.patches.size());
  for_each_block(frame.seams.size(), 1, [&](std::size_t i, std::size_t, std::size_t) {
    frame.seams[i] =
        end_seam(model, separation, frame.ends, frame.positions, static_cast<int>(i / 2), static_cast<BoneEnd>(i % 2));
  });
  // A triangle per column of the row next to the end, and one per side of the seam.
  for (std::size_t i = 0; i < frame.seams.size(); ++i)
    frame.first_end.push_back(frame.first_end.back() + model.patches[i / 2].rectangle.width +
                              static_cast<int>(frame.seams[i].ring.vertices.size()));
  return std::make_shared<const LatticeFrame>(std::move(frame));
}

LatticeMesh::LatticeMesh(ClContext& context, const LatticeMesh& other, DiagonalRule rule, TexelPoints points)
    : LatticeMesh(context, other.model_, rule, other.frame_, other.patches_, std::move(points), Parts::kAll) {}

LatticeMesh::LatticeMesh(ClContext& context, const SkeletexModel& model, DiagonalRule rule,
                         std::shared_ptr<const LatticeFrame> frame, ClBuffer<PatchRecord> patches, TexelPoints points,
                         Parts parts)
    : context_(context),
      model_(model),
      rule_(rule),
      frame_(std::move(frame)),
      rows_(context.upload(quad_rows(model.patches))),
      patches_(std::move(patches)),
      end_positions_(frame_->positions),
      points_(std::move(points)) {
  // Before the kernel is queued, so that the host can go on beside it.
  std::tie(planes_[0], planes_[1], planes_[2]) = context.map(points_.x, points_.y, points_.z);
  device_diagonals_ = context.allocate<int>(texel_count());
  if (parts == Parts::kAll)
    choose_diagonals(context, rule, model.patches, model.texture.width, rows_, patches_, points_, device_diagonals_);
  else
    context.fill(device_diagonals_, 0);
  for_each_pole(model, frame_->ends, [&](int vertex, int, int, std::size_t texel) {
    end_positions_[vertex] = position(static_cast<int>(texel));
  });
  std::array<std::vector<float>, 3> end_planes;
  for (const Vec3& place : end_positions_) {
    end_points_.emplace_back(0);
    end_points_.back().head<3>() = (place - model.origin).cast<float>();
    for (int axis = 0; axis < 3; ++axis) end_planes[axis].push_back(end_points_.back()[axis]);
  }
  device_end_points_ = {context.upload(end_planes[0]), context.upload(end_planes[1]), context.upload(end_planes[2])};
  if (parts == Parts::kAsked) return;
  std::vector<int> ends(frame_->seams.size());
  std::iota(ends.begin(), ends.end(), 0);
  fill_ends(ends);
  diagonals_ = context.map(device_diagonals_);
}

void LatticeMesh::fill_ends(std::span<const int> ends) {
  end_triangles_.resize(frame_->first_end.back());
  const std::vector<std::vector<Triangle>> filled = make_ends(ends);
  for (std::size_t k = 0; k < ends.size(); ++k)
    std::copy(filled[k].begin(), filled[k].end(), end_triangles_.begin() + frame_->first_end[ends[k]]);
}

void LatticeMesh::choose(std::span<const int> texels) {
  if (texels.empty()) return;
  diagonals_ = {};
  choose_listed(texels);
  diagonals_ = context_.map(device_diagonals_);
}

/// By runs of columns: quads are seldom asked for by themselves.
/// \param quads  in order
void LatticeMesh::choose_listed(std::span<const int> quads) {
  std::vector<int> firsts, asked, patches;
  int end = 0;  // of the last run, or of its row
  for (const int quad : quads) {
    if (quad >= end) {
      const int patch = patch_of(quad), width = model_.texture.width;
      const Rectangle& r = model_.patches[patch].rectangle;
      firsts.push_back(quad), asked.push_back(0), patches.push_back(patch);
      end = std::min(quad + kRun, quad / width * width + r.x + r.width);
    }
    asked.back() |= 1 << (quad - firsts.back());
  }
  context_.launch({"lattice.cl", "choose_listed_diagonals"}, ClRange(firsts.size()), static_cast<int>(firsts.size()),
                  model_.texture.width, static_cast<int>(rule_ == DiagonalRule::kSmooth), context_.upload(firsts),
                  context_.upload(asked), context_.upload(patches), patches_, points_.x, points_.y, points_.z,
                  device_diagonals_);
}

/// The strips or fans of ends, numbered as in LatticeFrame::first_end.
std::vector<std::vector<Triangle>> LatticeMesh::make_ends(std::span<const int> ends) {
  std::vector<std::vector<Triangle>> filled(ends.size());
  for_each_block(ends.size(), 1, [&](std::size_t i, std::size_t, std::size_t) {
    const int bone = ends[i] / 2;
    const auto end = static_cast<BoneEnd>(ends[i] % 2);
    const Rectangle& r = model_.patches[bone].rectangle;
    const int first_texel = (r.y + (end == BoneEnd::kHead ? 1 : r.height - 2)) * model_.texture.width + r.x;
    std::vector<int> vertices(r.width);  // the row next to the end
    std::iota(vertices.begin(), vertices.end(), first_texel);
    const EndSeam& seam = frame_->seams[ends[i]];
    if (seam.ring.vertices.empty())
      return append_pole_fan(vertices, texel_count() + frame_->ends.poles[bone][ends[i] % 2], end, filled[i]);
    for (const int vertex : seam.ring.vertices) vertices.push_back(texel_count() + vertex);
    std::vector<Vec3> positions;
    for (const int vertex : vertices) positions.push_back(position(vertex));
    Ring own_seam = seam.ring, row;
    row.vertices.resize(r.width);
    std::iota(row.vertices.begin(), row.vertices.end(), 0);
    std::iota(own_seam.vertices.begin(), own_seam.vertices.end(), r.width);
    append_seam_strip(positions, own_seam, seam.turns, row, end, filled[i]);
    for (Triangle& triangle : filled[i])
      for (int& vertex : triangle) vertex = vertices[vertex];
  });
  return filled;
}

int LatticeMesh::right_of(int texel) const {
  const Rectangle& r = model_.patches[patch_of(texel)].rectangle;
  return texel % model_.texture.width + 1 < r.x + r.width ? texel + 1 : texel + 1 - r.width;
}

Triangle LatticeMesh::triangle(int index) const {
  if (index >= first_end_triangle()) return end_triangles_[index - first_end_triangle()];
  return triangles_of(index / 2, right_of(index / 2))[index % 2];
}

std::vector<int> LatticeMesh::move(std::span<const int> texels, std::array<ClMapping<float>, 3> points) {
  planes_ = std::move(points);
  if (texels.empty()) return {};
  const int width = model_.texture.width;
  std::vector<char> is_moved(texel_count(), 0), is_asked(texel_count(), 0);
  std::vector<char> has_moved_end(2 * model_.patches.size(), 0);
  int first_line = model_.texture.height, last_line = 0;
  for (const int texel : texels) {
    is_moved[texel] = 1;
    const int bone = patch_of(texel);
    const Rectangle& r = model_.patches[bone].rectangle;
    const int row = texel / width - r.y, column = texel % width - r.x;
    if (row == 1) has_moved_end[2 * bone] = 1;
    if (row == r.height - 2) has_moved_end[2 * bone + 1] = 1;
    // The diagonal of a quad depends on the 4 x 4 vertices around it.
    for (int i = std::max(1, row - 2); i <= std::min(r.height - 3, row + 1); ++i) {
      char* line = is_asked.data() + static_cast<std::ptrdiff_t>(r.y + i) * width + r.x;
      for (int j = column - 2; j <= column + 1; ++j) line[j < 0 ? j + r.width : j < r.width ? j : j - r.width] = 1;
      first_line = std::min(first_line, r.y + i), last_line = std::max(last_line, r.y + i);
    }
  }
  std::vector<int> quads;
  for (auto at = is_asked.begin() + static_cast<std::ptrdiff_t>(first_line) * width,
            end = is_asked.begin() + static_cast<std::ptrdiff_t>(last_line + 1) * width;
       (at = std::find(at, end, 1)) != end; ++at)
    quads.push_back(static_cast<int>(at - is_asked.begin()));

  std::vector<int> before, changed;
  for (const int quad : quads) before.push_back(diagonals_[quad]);
  diagonals_ = {};
  choose_listed(quads);
  std::vector<int> ends;
  for (int end = 0; end < static_cast<int>(has_moved_end.size()); ++end)
    if (has_moved_end[end]) ends.push_back(end);
  const std::vector<std::vector<Triangle>> filled = make_ends(ends);  // beside the kernel
  diagonals_ = context_.map(device_diagonals_);
  for (std::size_t i = 0; i < quads.size(); ++i) {
    const bool is_other = diagonals_[quads[i]] != before[i];
    const std::array<Triangle, 2> triangles = triangles_of(quads[i], right_of(quads[i]));
    for (const int k : {0, 1})
      if (is_other || is_moved[triangles[k][0]] || is_moved[triangles[k][1]] || is_moved[triangles[k][2]])
        changed.push_back(2 * quads[i] + k);
  }
  for (std::size_t k = 0; k < ends.size(); ++k)
    for (std::size_t i = 0; i < filled[k].size(); ++i) {
      Triangle& triangle = end_triangles_[frame_->first_end[ends[k]] + i];
      const bool is_other = std::exchange(triangle, filled[k][i]) != filled[k][i];
      if (is_other || std::any_of(triangle.begin(), triangle.end(),
                                  [&](int vertex) { return is_texel(vertex) && is_moved[vertex]; }))
        changed.push_back(first_end_triangle() + frame_->first_end[ends[k]] + static_cast<int>(i));
    }
  return changed;
}

}  // namespace skeletex
