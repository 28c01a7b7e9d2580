// SPDX-License-Identifier: MIT
#include "skeletex/convert/snap/lattice_surface.h"

#include <algorithm>
#include <bit>
#include <numeric>

#include "skeletex/geometry/parallel.h"

namespace skeletex {
namespace {

/// Appends the quads of a square of rows and columns along a Z-order curve. \param quads  rows x columns of a patch
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
  for (int triangle = 2 * lattice.quad_count; triangle < lattice.triangle_count; ++triangle) order.push_back(triangle);
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

LatticeFrame frame_lattice(ClContext& context, const SkeletexModel& model) {
  const SeparationPlanes separation(model.skeleton);
  const Lattice lattice = number_lattice(model);
  LatticeFrame frame{model, lattice, upload_quads(context, model, separation), {}, {}, {}, {}, {}};
  frame.positions.resize(lattice.vertex_count);
  place_seams(model, separation, lattice, frame.positions);
  frame.ends.resize(2 * model.patches.size());
  for_each_block(frame.ends.size(), 1, [&](std::size_t i, std::size_t, std::size_t) {
    frame.ends[i] =
        end_seam(model, separation, lattice, frame.positions, static_cast<int>(i / 2), static_cast<BoneEnd>(i % 2));
  });
  frame.texels.assign(lattice.vertex_count, -1);
  for_each_inner_row(model, lattice, [&](int vertex, int texel, int columns) {
    std::iota(frame.texels.begin() + vertex, frame.texels.begin() + vertex + columns, texel);
  });
  for_each_pole(model, lattice,
                [&](int vertex, int, int, std::size_t texel) { frame.texels[vertex] = static_cast<int>(texel); });
  frame.texel_patches.assign(static_cast<std::size_t>(model.texture.width) * model.texture.height, -1);
  for (std::size_t patch = 0; patch < model.patches.size(); ++patch) {
    const Rectangle& r = model.patches[patch].rectangle;
    for (int row = r.y; row < r.y + r.height; ++row)
      std::fill_n(frame.texel_patches.begin() + row * static_cast<std::ptrdiff_t>(model.texture.width) + r.x, r.width,
                  static_cast<int>(patch));
  }
  frame.triangle_order = order_triangles(model, lattice);
  return frame;
}

TriangleMesh build_lattice_mesh(ClContext& context, const LatticeFrame& frame, DiagonalRule rule,
                                const TexelPlanes& points) {
  const SkeletexModel& model = frame.model;
  const Lattice& lattice = frame.numbers;
  TriangleMesh mesh;
  mesh.positions = frame.positions;
  for (int vertex = 0; vertex < lattice.vertex_count; ++vertex)
    if (const int texel = frame.texels[vertex]; texel >= 0)
      mesh.positions[vertex] = model.origin + Vec3(points[0][texel], points[1][texel], points[2][texel]);
  TexelPlanes inner;
  for (int axis = 0; axis < 3; ++axis) {
    inner[axis].reserve(lattice.inner_count);
    for_each_inner_row(model, lattice, [&](int, int texel, int columns) {
      const auto first = points[axis].begin() + texel;
      inner[axis].insert(inner[axis].end(), first, first + columns);
    });
  }
  const DevicePlanes device_inner{context.upload(inner[0]), context.upload(inner[1]), context.upload(inner[2])};
  const auto device_triangles = triangulate(context, rule, frame.quads, lattice, device_inner);
  std::vector<std::vector<Triangle>> ends(frame.ends.size());
  for_each_block(ends.size(), 1, [&](std::size_t i, std::size_t, std::size_t) {
    append_end_triangles(model, lattice, mesh.positions, frame.ends[i], static_cast<int>(i / 2),
                         static_cast<BoneEnd>(i % 2), ends[i]);
  });
  mesh.triangles = context.download(device_triangles);
  auto next = mesh.triangles.begin() + 2 * static_cast<std::ptrdiff_t>(lattice.quad_count);
  for (const std::vector<Triangle>& triangles : ends) next = std::copy(triangles.begin(), triangles.end(), next);
  return mesh;
}

}  // namespace skeletex
