// SPDX-License-Identifier: MIT
#include "skeletex/convert/snap/lattice_surface.h"

#include <algorithm>
#include <bit>
#include <numeric>
#include <set>
#include <utility>

#include "skeletex/convert/snap/snap.h"
#include "skeletex/geometry/parallel.h"
#include "skeletex/reconstruct/prepared_model.h"

namespace skeletex {
namespace {

/// Appends the quads of a square of rows and columns along a Z-order curve.
/// \param quads  rows x columns of a patch
void append_square(int row, int column, int size, int rows, int columns, int first_quad, std::vector<int>& triangles) {
  if (row >= rows || column >= columns) return;
  if (size == 1) {
    const int quad = first_quad + row * columns + column;
    triangles.push_back(2 * quad), triangles.push_back(2 * quad + 1);
    return;
  }
  for (const int i : {0, 1})
    for (const int j : {0, 1})
      append_square(row + i * size / 2, column + j * size / 2, size / 2, rows, columns, first_quad, triangles);
}

std::vector<int> order_triangles(const SkeletexModel& model, const Lattice& lattice) {
  std::vector<int> order;
  order.reserve(lattice.triangle_count);
  for (std::size_t patch = 0; patch < model.patches.size(); ++patch) {
    const int columns = model.patches[patch].rectangle.width, rows = model.patches[patch].rectangle.height - 3;
    const auto size = static_cast<int>(std::bit_ceil(static_cast<unsigned>(std::max(rows, columns))));
    append_square(0, 0, size, rows, columns, lattice.first_quad[patch], order);
  }
  for (TriangleIndex triangle = 2 * lattice.quad_count; triangle < lattice.triangle_count; ++triangle)
    order.push_back(triangle);
  return order;
}

/// Calls act(first vertex, first texel, columns) for the inner rows of all patches.
template <class Act>
void for_each_inner_row(const SkeletexModel& model, const Lattice& lattice, const Act& act) {
  for (std::size_t patch = 0; patch < model.patches.size(); ++patch) {
    const Rectangle& r = model.patches[patch].rectangle;
    for (int row = 1; row + 1 < r.height; ++row)
      act(lattice.first_inner[patch] + (row - 1) * r.width, (r.y + row) * model.texture.width + r.x, r.width);
  }
}

}  // namespace

ClBuffer<int> choose_diagonals(ClContext& context, DiagonalRule rule, const std::vector<LatticeRow>& rows,
                               const ClBuffer<PatchRecord>& records, int texture_width, const DevicePlanes& points) {
  constexpr int kBandRows = 16, kBandColumns = BAND_COLUMNS;  // of a group
  const int count = static_cast<int>(rows.size());
  ClRange groups = row_range(context, (count + kBandRows - 1) / kBandRows);
  groups.global[1] = (texture_width + kBandColumns - 1) / kBandColumns;
  auto diagonals = context.allocate<int>(points.count);
  context.fill(diagonals, 0);
  context.launch({"lattice.cl", "choose_diagonals"}, groups,
                 DiagonalParameters{texture_width, static_cast<int>(points.count), count, kBandRows,
                                    static_cast<int>(rule == DiagonalRule::kSmooth)},
                 context.upload(rows), records, points.values, diagonals);
  return diagonals;
}

LatticeFrame frame_lattice(ClContext& context, const SkeletexModel& model) {
  const PreparedModel prepared(model);
  const SeparationPlanes& separation = prepared.separation;
  const Lattice& lattice = prepared.lattice;
  LatticeFrame frame{model, lattice, context.upload(prepared.tables.patches), {}, {}, {}, {}, {}, {}, {}};
  frame.rows = quad_rows(model.patches);
  frame.positions.resize(lattice.vertex_count);
  place_seams(model, separation, lattice, frame.positions);
  frame.ends.resize(2 * model.patches.size());
  for_each_index(frame.ends.size(), [&](std::size_t i) {
    frame.ends[i] =
        end_seam(model, separation, lattice, frame.positions, static_cast<int>(i / 2), static_cast<BoneEnd>(i % 2));
  });
  frame.texels.assign(lattice.vertex_count, -1);
  for_each_inner_row(model, lattice, [&](VertexIndex vertex, TexelIndex texel, int columns) {
    std::iota(frame.texels.begin() + vertex, frame.texels.begin() + vertex + columns, texel);
  });
  for_each_pole(model, lattice, [&](VertexIndex vertex, int, int, std::size_t texel) {
    frame.texels[vertex] = static_cast<int>(texel);
  });
  frame.texel_patches.assign(static_cast<std::size_t>(model.texture.width) * model.texture.height, -1);
  for (std::size_t patch = 0; patch < model.patches.size(); ++patch) {
    const Rectangle& r = model.patches[patch].rectangle;
    for (int row = r.y; row < r.y + r.height; ++row)
      std::fill_n(frame.texel_patches.begin() + row * static_cast<std::ptrdiff_t>(model.texture.width) + r.x, r.width,
                  static_cast<int>(patch));
  }
  frame.triangle_order = order_triangles(model, lattice);
  frame.triangle_places.resize(frame.triangle_order.size());
  for (std::size_t place = 0; place < frame.triangle_order.size(); ++place)
    frame.triangle_places[frame.triangle_order[place]] = static_cast<int>(place);
  return frame;
}

namespace {

/// Strips and fans of some ends: of patch i 2 i and 2 i + 1.
std::vector<std::vector<Triangle>> make_ends(const LatticeFrame& frame, std::span<const int> ends,
                                             std::span<const Vec3> positions) {
  std::vector<std::vector<Triangle>> triangles(ends.size());
  for_each_index(ends.size(), [&](std::size_t i) {
    append_end_triangles(frame.model, frame.numbers, positions, frame.ends[ends[i]], ends[i] / 2,
                         static_cast<BoneEnd>(ends[i] % 2), triangles[i]);
  });
  return triangles;
}

/// The number of an end's first triangle. There is one per column of the row next to it, and one per side of its seam.
std::vector<int> first_triangles_of_ends(const LatticeFrame& frame) {
  std::vector<int> firsts{2 * frame.numbers.quad_count};
  for (std::size_t i = 0; i < frame.ends.size(); ++i)
    firsts.push_back(firsts.back() + frame.model.patches[i / 2].rectangle.width +
                     static_cast<int>(frame.ends[i].ring.vertices.size()));
  return firsts;
}

/// Writes triangles over those from a number on, and lists those that are others, or have a vertex that has moved.
void replace_triangles(std::span<const Triangle> triangles, int first, std::span<const char> has_moved,
                       TriangleMesh& mesh, std::vector<int>& changed) {
  for (std::size_t i = 0; i < triangles.size(); ++i) {
    Triangle& triangle = mesh.triangles[first + i];
    const bool is_other = triangle != triangles[i];
    triangle = triangles[i];
    if (is_other || has_moved[triangle[0]] || has_moved[triangle[1]] || has_moved[triangle[2]])
      changed.push_back(first + static_cast<int>(i));
  }
}

/// The two triangles of the quad to the right of and above a texel, as reconstruct.cl writes them.
std::array<Triangle, 2> quad_triangles(const LatticeFrame& frame, PatchIndex patch, int row, int column,
                                       const ClMapping<int>& diagonals) {
  const int width = frame.model.patches[patch].rectangle.width;
  const int first = frame.numbers.first_inner[patch] + (row - 1) * width;
  const int own = first + column, right = column + 1 < width ? own + 1 : first;
  const int above = own + width, beyond = right + width;
  if (diagonals[frame.texels[own]] != 0) return {{{own, right, above}, {above, right, beyond}}};
  return {{{own, right, beyond}, {own, beyond, above}}};
}

/// The diagonals that the decoder takes over points, for the host.
ClMapping<int> diagonals_of(ClContext& context, const LatticeFrame& frame, DiagonalRule rule,
                            const std::vector<LatticeRow>& rows, const DevicePlanes& points) {
  return context.map(choose_diagonals(context, rule, rows, frame.patches, frame.model.texture.width, points));
}

}  // namespace

void build_lattice_mesh(ClContext& context, const LatticeFrame& frame, DiagonalRule rule, const DevicePlanes& points,
                        TriangleMesh& mesh) {
  const Lattice& lattice = frame.numbers;
  mesh.positions = frame.positions;
  const ClMapping<int> diagonals = diagonals_of(context, frame, rule, frame.rows, points);
  const ClMapping<float> values = context.map(points.values);
  const float *const x = values.data(), *const y = x + points.count, *const z = y + points.count;
  for_each_index(lattice.vertex_count, 1 << 14, [&](std::size_t vertex) {
    if (const TexelIndex texel = frame.texels[vertex]; texel >= 0)
      mesh.positions[vertex] = frame.model.origin + Vec3(x[texel], y[texel], z[texel]);
  });
  std::vector<int> ends(frame.ends.size());
  std::iota(ends.begin(), ends.end(), 0);
  const std::vector<std::vector<Triangle>> of_ends = make_ends(frame, ends, mesh.positions);
  mesh.triangles.resize(lattice.triangle_count);
  for_each_block(frame.rows.size(), 16, [&](std::size_t, std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const auto [patch, row, unused, first_quad] = frame.rows[i];
      for (int column = 0; column < frame.model.patches[patch].rectangle.width; ++column) {
        const auto triangles = quad_triangles(frame, patch, row, column, diagonals);
        std::copy(triangles.begin(), triangles.end(), mesh.triangles.begin() + 2 * (first_quad + column));
      }
    }
  });
  auto next = mesh.triangles.begin() + 2 * static_cast<std::ptrdiff_t>(lattice.quad_count);
  for (const std::vector<Triangle>& triangles : of_ends) next = std::copy(triangles.begin(), triangles.end(), next);
}

std::vector<int> move_texels(ClContext& context, const LatticeFrame& frame, DiagonalRule rule,
                             std::span<const int> texels, const TexelPlanes& points, DevicePlanes& on_device,
                             TriangleMesh& mesh) {
  if (texels.empty()) return {};
  const SkeletexModel& model = frame.model;
  TexelPlanes moved;
  for (int axis = 0; axis < 3; ++axis)
    for (const TexelIndex texel : texels) moved[axis].push_back(points[axis][texel]);
  context.launch(
      {"encode.cl", "place_points"}, ClRange(texels.size()),
      TexelParameters{model.texture.width, static_cast<int>(on_device.count), static_cast<int>(texels.size()), 0, 0},
      context.upload(texels), upload_planes(context, moved[0], moved[1], moved[2]).values, on_device.values);
  std::vector<char> has_moved(mesh.positions.size(), 0), is_near(frame.numbers.quad_count, 0);
  std::vector<int> changed;
  const auto place_of = [&](TexelIndex texel) {
    const Rectangle& r = model.patches[frame.texel_patches[texel]].rectangle;
    return std::array{frame.texel_patches[texel], texel / model.texture.width - r.y, texel % model.texture.width - r.x};
  };
  for (const TexelIndex texel : texels) {
    const auto [patch, row, column] = place_of(texel);
    const VertexIndex vertex =
        frame.numbers.first_inner[patch] + (row - 1) * model.patches[patch].rectangle.width + column;
    has_moved[vertex] = 1;
    mesh.positions[vertex] = model.origin + Vec3(points[0][texel], points[1][texel], points[2][texel]);
  }
  // The diagonal of a quad depends on the 4 x 4 vertices around it.
  const auto rows_near = [&](PatchIndex patch, int row) {
    return std::array{std::max(1, row - 2), std::min(model.patches[patch].rectangle.height - 3, row + 1)};
  };
  std::set<std::array<int, 2>> are_near;
  for (const TexelIndex texel : texels) {
    const auto [patch, row, column] = place_of(texel);
    for (auto [i, last] = rows_near(patch, row); i <= last; ++i) are_near.insert({patch, i});
  }
  std::vector<LatticeRow> rows = frame.rows;
  std::erase_if(rows, [&](const LatticeRow& row) { return !are_near.contains({row[0], row[1]}); });
  const ClMapping<int> diagonals = diagonals_of(context, frame, rule, rows, on_device);
  for (const TexelIndex texel : texels) {
    const auto [patch, row, column] = place_of(texel);
    const int width = model.patches[patch].rectangle.width;
    for (auto [i, last] = rows_near(patch, row); i <= last; ++i)
      for (int j = column - 2; j <= column + 1; ++j) {
        const int quad = frame.numbers.first_quad[patch] + (i - 1) * width + wrapped(j, width);
        if (std::exchange(is_near[quad], 1) != 0) continue;
        replace_triangles(quad_triangles(frame, patch, i, wrapped(j, width), diagonals), 2 * quad, has_moved, mesh,
                          changed);
      }
  }
  std::vector<int> ends;
  for (int end = 0; end < static_cast<int>(frame.ends.size()); ++end) {
    const std::vector<int> vertices = end_row(model, frame.numbers, end / 2, static_cast<BoneEnd>(end % 2));
    if (std::any_of(vertices.begin(), vertices.end(), [&](VertexIndex vertex) { return has_moved[vertex] != 0; }))
      ends.push_back(end);
  }
  const std::vector<int> firsts = first_triangles_of_ends(frame);
  const std::vector<std::vector<Triangle>> of_ends = make_ends(frame, ends, mesh.positions);
  for (std::size_t i = 0; i < ends.size(); ++i)
    replace_triangles(of_ends[i], firsts[ends[i]], has_moved, mesh, changed);
  std::sort(changed.begin(), changed.end());
  return changed;
}

}  // namespace skeletex
