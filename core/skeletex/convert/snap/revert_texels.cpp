// SPDX-License-Identifier: MIT
#include "skeletex/convert/snap/revert_texels.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "skeletex/convert/snap/snap.h"

namespace skeletex {
namespace {

constexpr float kLeastCosine = 0.2f;  // between a triangle and the regular grid's quad in space

using Point = Eigen::Vector3f;
using QuadPoints = std::array<Point, 4>;

/// The quad to the right of and above a texel: its texels, counter-clockwise.
struct Quad {
  std::array<int, 4> texels;
  std::array<bool, 4> are_inner;
};

/// \param row  of its texel, 0 to height - 2;
/// \param column  any
Quad quad_at(const LatticeFrame& frame, PatchIndex patch, int row, int column) {
  const Rectangle& r = frame.model.patches[patch].rectangle;
  const int width = frame.model.texture.width, line = (r.y + row) * width + r.x;
  const int left = line + wrapped(column, r.width), right = line + wrapped(column + 1, r.width);
  const bool is_lower_inner = row >= 1, is_upper_inner = row + 1 <= r.height - 2;
  return {{left, right, right + width, left + width}, {is_lower_inner, is_lower_inner, is_upper_inner, is_upper_inner}};
}

/// The four around an inner texel.
std::array<Quad, 4> quads_at(const LatticeFrame& frame, TexelIndex texel) {
  const int width = frame.model.texture.width, patch = frame.texel_patches[texel];
  const Rectangle& r = frame.model.patches[patch].rectangle;
  const int row = texel / width - r.y, column = texel % width - r.x;
  return {quad_at(frame, patch, row, column), quad_at(frame, patch, row, column - 1),
          quad_at(frame, patch, row - 1, column), quad_at(frame, patch, row - 1, column - 1)};
}

QuadPoints points_of(const Quad& quad, const TexelPlanes& points) {
  QuadPoints found;
  for (int i = 0; i < 4; ++i)
    found[i] = {points[0][quad.texels[i]], points[1][quad.texels[i]], points[2][quad.texels[i]]};
  return found;
}

/// Whether a quad folds in the map.
bool is_folded(const Quad& quad, const PlacedTexels& texels) {
  std::array<float, 4> x, y;
  for (int i = 0; i < 4; ++i) {
    x[i] = static_cast<float>(i == 1 || i == 2) + texels.offset_x[quad.texels[i]];
    y[i] = static_cast<float>(i >= 2) + texels.offset_y[quad.texels[i]];
  }
  for (int i = 0; i < 4; ++i) {
    const int before = (i + 3) % 4, after = (i + 1) % 4;
    if ((x[after] - x[i]) * (y[before] - y[i]) - (y[after] - y[i]) * (x[before] - x[i]) <= 0) return true;
  }
  return false;
}

Point area_vector(const QuadPoints& p, const std::array<int, 3>& corners) {
  return (p[corners[1]] - p[corners[0]]).cross(p[corners[2]] - p[corners[0]]);
}

/// Whether a triangle of a quad turns from a direction, and does not do so in the regular grid.
bool is_turned(const QuadPoints& now, const QuadPoints& regular, const std::array<int, 3>& corners,
               const Point& direction) {
  const auto turns = [&](const QuadPoints& points) {
    const Point normal = area_vector(points, corners);
    return normal.dot(direction) < kLeastCosine * normal.norm() * direction.norm();
  };
  return turns(now) && !turns(regular);
}

/// Whether a quad folds in the map, or for both its diagonals a triangle turns from the regular grid's quad.
bool is_bad(const Quad& quad, const PlacedTexels& regular, const PlacedTexels& texels) {
  if (std::all_of(quad.texels.begin(), quad.texels.end(),
                  [&](TexelIndex texel) { return texels.has_same_point(texel, regular); }))
    return false;
  if (is_folded(quad, texels)) return true;
  const QuadPoints now = points_of(quad, texels.points), before = points_of(quad, regular.points);
  const Point normal = area_vector(before, {0, 1, 2}) + area_vector(before, {0, 2, 3});
  return (is_turned(now, before, {0, 1, 2}, normal) || is_turned(now, before, {0, 2, 3}, normal)) &&
         (is_turned(now, before, {0, 1, 3}, normal) || is_turned(now, before, {1, 2, 3}, normal));
}

}  // namespace

std::vector<int> revert_texels(const LatticeFrame& frame, std::span<const int> listed, bool with_vertices,
                               const PlacedTexels& regular, PlacedTexels& texels) {
  std::vector<int> reverted;
  const auto revert = [&](TexelIndex texel) {
    if (texels.has_same_point(texel, regular)) return;
    for (int axis = 0; axis < 3; ++axis) texels.points[axis][texel] = regular.points[axis][texel];
    texels.offset_x[texel] = regular.offset_x[texel], texels.offset_y[texel] = regular.offset_y[texel];
    texels.anchors[texel] = 0;
    texels.map_triangles[texel] = regular.map_triangles[texel];
    reverted.push_back(texel);
  };
  for (const TexelIndex texel : listed)
    if (texels.anchors[texel] <= 0 || with_vertices) revert(texel);
  for (std::size_t next = 0; next < reverted.size(); ++next)
    for (const Quad& quad : quads_at(frame, reverted[next])) {
      if (!is_bad(quad, regular, texels)) continue;
      for (int k = 0; k < 4; ++k)
        if (quad.are_inner[k]) revert(quad.texels[k]);
    }
  return reverted;
}

}  // namespace skeletex
