// SPDX-License-Identifier: MIT
#pragma once
#include <array>

#include "skeletex/geometry/mesh.h"

namespace skeletex {

/// Up to 32 triangles side by side, for tests of one against four of them at a time.
struct TriangleBlock {
  static constexpr int kSize = 32;
  template <class T>
  using Lanes = std::array<T, kSize>;

  std::array<Lanes<float>, 3> least, greatest;  ///< boxes, by coordinate; infinite where there is no triangle
  Lanes<int> numbers;
  Lanes<int> is_asked;
  std::array<Lanes<double>, 3> vertices;                ///< whole numbers, by corner: compared beside coordinates
  std::array<std::array<Lanes<double>, 3>, 3> corners;  ///< by corner and coordinate
  std::array<Lanes<double>, 3> normals;
  Lanes<double> offsets, margins;  ///< of their planes, and how far from them rounding could put a vertex

  Triangle triangle(int i) const {
    return {static_cast<int>(vertices[0][i]), static_cast<int>(vertices[1][i]), static_cast<int>(vertices[2][i])};
  }
  std::array<Vec3, 3> corners_of(int i) const {
    const auto at = [&](int corner) {
      return Vec3(corners[corner][0][i], corners[corner][1][i], corners[corner][2][i]);
    };
    return {at(0), at(1), at(2)};
  }
};

/// 4 x 4 quads of a lattice: of each its vertices, own, right, above and beyond, and whether it takes the second
/// diagonal.
struct QuadBlock {
  static constexpr int kSize = 16;
  template <class T>
  using Lanes = std::array<T, kSize>;
  std::array<std::array<Lanes<float>, 4>, 3> points;  ///< by coordinate
  Lanes<int> own, right;                              ///< numbers
  int row_step;                                       ///< from those to the ones above
  Lanes<int> take_second;
};

/// The triangles of quads are their lower ones, then their upper ones. Their boxes:
/// \param margin  around them
void fill_boxes(const QuadBlock& quads, float margin, TriangleBlock& block);
/// The rest but for planes. \param origin  of points
void fill_corners(const QuadBlock& quads, const Vec3& origin, TriangleBlock& block);
/// The planes of a block's triangles, by their corners.
/// \param margin  times a normal's sum of coordinates: how far rounding could put a vertex from a plane
void find_planes(double margin, TriangleBlock& block);

/// Where boxes of two blocks overlap.
struct BlockOverlaps {
  static constexpr int kLanes = 4;
  struct Group {
    int i, first;  ///< of the first block, and of four of the second one
  };
  std::array<Group, TriangleBlock::kSize * TriangleBlock::kSize / kLanes + 1> groups;  ///< with one of them
  int group_count = 0;
  std::array<TriangleBlock::Lanes<int>, TriangleBlock::kSize> do_overlap;  ///< by i; of those in groups
};
/// Least and greatest coordinates; infinite the other way round where there is nothing.
struct BlockBox {
  std::array<float, 3> least, greatest;
};
/// Of two blocks, or of one, the pairs of which one is asked for. Needs no more than boxes.
/// \param around        the second block
/// \param around_asked  what is asked for of it
void find_overlaps(const TriangleBlock& one, const TriangleBlock& other, const BlockBox& around,
                   const BlockBox& around_asked, BlockOverlaps& overlaps);

using BlockPairs = std::array<std::array<unsigned char, 2>, TriangleBlock::kSize * TriangleBlock::kSize + 1>;
/// Of these those where neither's plane has all of the other that they do not share on one side, further from it than
/// rounding could put it: others do not meet. Nearly all neighbours are such. \return how many there are
int find_unsettled(const TriangleBlock& one, const TriangleBlock& other, const BlockOverlaps& overlaps,
                   BlockPairs& pairs);

}  // namespace skeletex
