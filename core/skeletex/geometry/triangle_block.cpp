// SPDX-License-Identifier: MIT
#include "skeletex/geometry/triangle_block.h"

#include <algorithm>
#include <cmath>

#include "skeletex/geometry/wide_too.h"

namespace skeletex {
namespace {

constexpr int kLanes = BlockOverlaps::kLanes;

}  // namespace

SKELETEX_WIDE_TOO void fill_boxes(const QuadBlock& quads, float margin, TriangleBlock& block) {
  constexpr int kSize = QuadBlock::kSize;
  // (Copies are apart from all else.)
  const QuadBlock::Lanes<int> take_second = quads.take_second;
  for (int axis = 0; axis < 3; ++axis) {
    const auto [own, right, above, beyond] = quads.points[axis];
    std::array<QuadBlock::Lanes<float>, 2> least, greatest;
    for (int i = 0; i < kSize; ++i) {
      // As LatticeMesh::triangles_of.
      const bool is_second = take_second[i] != 0;
      const float lower = is_second ? above[i] : beyond[i], first = is_second ? above[i] : own[i],
                  second = is_second ? right[i] : beyond[i], third = is_second ? beyond[i] : above[i];
      least[0][i] = std::min(std::min(own[i], right[i]), lower) - margin,
      greatest[0][i] = std::max(std::max(own[i], right[i]), lower) + margin;
      least[1][i] = std::min(std::min(first, second), third) - margin,
      greatest[1][i] = std::max(std::max(first, second), third) + margin;
    }
    for (const int side : {0, 1}) {
      std::copy(least[side].begin(), least[side].end(), block.least[axis].begin() + side * kSize);
      std::copy(greatest[side].begin(), greatest[side].end(), block.greatest[axis].begin() + side * kSize);
    }
  }
}

SKELETEX_WIDE_TOO void fill_corners(const QuadBlock& quads, const Vec3& origin, TriangleBlock& block) {
  constexpr int kSize = QuadBlock::kSize;
  const auto fill = [&](int i, auto own, auto right, auto above, auto beyond, double* a, double* b, double* c) {
    const bool is_second = quads.take_second[i] != 0;
    a[i] = own, b[i] = right, c[i] = is_second ? above : beyond;
    a[kSize + i] = is_second ? above : own, b[kSize + i] = is_second ? right : beyond,
              c[kSize + i] = is_second ? beyond : above;
  };
  for (int axis = 0; axis < 3; ++axis) {
    const auto& [own, right, above, beyond] = quads.points[axis];
    const double from = origin[axis];
    for (int i = 0; i < kSize; ++i)
      fill(i, from + static_cast<double>(own[i]), from + static_cast<double>(right[i]),
           from + static_cast<double>(above[i]), from + static_cast<double>(beyond[i]), block.corners[0][axis].data(),
           block.corners[1][axis].data(), block.corners[2][axis].data());
  }
  for (int i = 0; i < kSize; ++i)
    fill(i, quads.own[i], quads.right[i], quads.own[i] + quads.row_step, quads.right[i] + quads.row_step,
         block.vertices[0].data(), block.vertices[1].data(), block.vertices[2].data());
}

SKELETEX_WIDE_TOO void find_planes(double margin, TriangleBlock& block) {
  for (int i = 0; i < TriangleBlock::kSize; ++i) {
    const auto& [a, b, c] = block.corners;
    const double ux = b[0][i] - a[0][i], uy = b[1][i] - a[1][i], uz = b[2][i] - a[2][i];
    const double vx = c[0][i] - a[0][i], vy = c[1][i] - a[1][i], vz = c[2][i] - a[2][i];
    const double x = uy * vz - uz * vy, y = uz * vx - ux * vz, z = ux * vy - uy * vx;
    block.normals[0][i] = x, block.normals[1][i] = y, block.normals[2][i] = z;
    block.offsets[i] = x * a[0][i] + y * a[1][i] + z * a[2][i];
    block.margins[i] = margin * (std::abs(x) + std::abs(y) + std::abs(z));
  }
}

// Both without branches but for the ends of loops: which boxes overlap, and which planes tell, is chance, and a wrong
// guess costs as much as four triangles.

SKELETEX_WIDE_TOO void find_overlaps(const TriangleBlock& one, const TriangleBlock& other, const BlockBox& around,
                                     const BlockBox& around_asked, BlockOverlaps& overlaps) {
  constexpr int kSize = TriangleBlock::kSize;
  using Flags = TriangleBlock::Lanes<int>;
  // Boxes of a block that overlap one.
  const auto find_overlapping = [](const TriangleBlock& block, float low_x, float low_y, float low_z, float high_x,
                                   float high_y, float high_z, Flags& do_overlap) {
    const float *least_x = block.least[0].data(), *least_y = block.least[1].data(), *least_z = block.least[2].data();
    const float *greatest_x = block.greatest[0].data(), *greatest_y = block.greatest[1].data(),
                *greatest_z = block.greatest[2].data();
    for (int i = 0; i < kSize; ++i)
      do_overlap[i] = static_cast<int>(least_x[i] <= high_x) & static_cast<int>(low_x <= greatest_x[i]) &
                      static_cast<int>(least_y[i] <= high_y) & static_cast<int>(low_y <= greatest_y[i]) &
                      static_cast<int>(least_z[i] <= high_z) & static_cast<int>(low_z <= greatest_z[i]);
  };
  // Of the first block what is asked for and near the second one, and what is near that which is asked for there.
  const auto find_overlapping_box = [&](const BlockBox& box, Flags& do_overlap) {
    find_overlapping(one, box.least[0], box.least[1], box.least[2], box.greatest[0], box.greatest[1], box.greatest[2],
                     do_overlap);
  };
  Flags are_near, are_near_asked;
  find_overlapping_box(around, are_near), find_overlapping_box(around_asked, are_near_asked);
  for (int i = 0; i < kSize; ++i) are_near[i] = (are_near[i] & one.is_asked[i]) | are_near_asked[i];
  std::array<int, kSize + 1> near;
  int near_count = 0;
  for (int i = 0; i < kSize; ++i) {
    near[near_count] = i;
    near_count += are_near[i];
  }
  int group_count = 0;
  for (int n = 0; n < near_count; ++n) {
    const int i = near[n], behind = &one == &other ? i : -1, is_asked = one.is_asked[i];
    Flags do_overlap;
    find_overlapping(other, one.least[0][i], one.least[1][i], one.least[2][i], one.greatest[0][i], one.greatest[1][i],
                     one.greatest[2][i], do_overlap);
    for (int j = 0; j < kSize; ++j) do_overlap[j] &= static_cast<int>(j > behind) & (is_asked | other.is_asked[j]);
    overlaps.do_overlap[i] = do_overlap;
    for (int first = 0; first < kSize; first += kLanes) {
      int any = 0;
      for (int k = 0; k < kLanes; ++k) any |= do_overlap[first + k];
      overlaps.groups[group_count] = {i, first};
      group_count += any;
    }
  }
  overlaps.group_count = group_count;
}

SKELETEX_WIDE_TOO int find_unsettled(const TriangleBlock& one, const TriangleBlock& other,
                                     const BlockOverlaps& overlaps, BlockPairs& pairs) {
  int count = 0;
  for (int n = 0; n < overlaps.group_count; ++n) {
    const auto [i, first] = overlaps.groups[n];
    const double v0 = one.vertices[0][i], v1 = one.vertices[1][i], v2 = one.vertices[2][i];
    const double nx = one.normals[0][i], ny = one.normals[1][i], nz = one.normals[2][i], offset = one.offsets[i],
                 margin = one.margins[i];
    const auto& [a, b, c] = one.corners;
    const double ax = a[0][i], ay = a[1][i], az = a[2][i], bx = b[0][i], by = b[1][i], bz = b[2][i], cx = c[0][i],
                 cy = c[1][i], cz = c[2][i];
    std::array<double, kLanes> are_settled;
    for (int k = 0; k < kLanes; ++k) {
      const int j = first + k;
      const double w0 = other.vertices[0][j], w1 = other.vertices[1][j], w2 = other.vertices[2][j];
      const auto has = [](double x, double y, double z, double w) { return (x == w) | (y == w) | (z == w); };
      const auto are_beside = [](bool is_first, bool is_second, bool is_third, double h0, double h1, double h2,
                                 double m) {
        return ((is_first | (h0 > m)) & (is_second | (h1 > m)) & (is_third | (h2 > m))) |
               ((is_first | (h0 < -m)) & (is_second | (h1 < -m)) & (is_third | (h2 < -m)));
      };
      const bool s0 = has(v0, v1, v2, w0), s1 = has(v0, v1, v2, w1), s2 = has(v0, v1, v2, w2);
      const auto height_of = [&](int corner) {
        const auto& [x, y, z] = other.corners[corner];
        return nx * x[j] + ny * y[j] + nz * z[j] - offset;
      };
      const bool is_other_beside = are_beside(s0, s1, s2, height_of(0), height_of(1), height_of(2), margin);
      const double mx = other.normals[0][j], my = other.normals[1][j], mz = other.normals[2][j],
                   other_offset = other.offsets[j];
      const bool is_one_beside = are_beside(
          has(w0, w1, w2, v0), has(w0, w1, w2, v1), has(w0, w1, w2, v2), mx * ax + my * ay + mz * az - other_offset,
          mx * bx + my * by + mz * bz - other_offset, mx * cx + my * cy + mz * cz - other_offset, other.margins[j]);
      are_settled[k] = (is_other_beside | is_one_beside) & !(s0 & s1 & s2) ? 1.0 : 0.0;
    }
    for (int k = 0; k < kLanes; ++k) {
      pairs[count] = {static_cast<unsigned char>(i), static_cast<unsigned char>(first + k)};
      count += overlaps.do_overlap[i][first + k] & static_cast<int>(are_settled[k] == 0);
    }
  }
  return count;
}

}  // namespace skeletex
