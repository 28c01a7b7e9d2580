// SPDX-License-Identifier: MIT
#pragma once
#include <array>
#include <span>
#include <vector>

#include "skeletex/reconstruct/lattice_mesh.h"

namespace skeletex {

/// Finds where a lattice's mesh intersects itself, as find_self_intersections does, but knows that triangles which are neighbours in
/// the lattice are so in space: where a part of it bends by less than a quarter turn all in all, no two of its triangles meet. Nearly all of a
/// lattice is such, and only other parts that lie near each other are looked at.
class LatticeCrossings {
 public:
  explicit LatticeCrossings(const LatticeMesh& lattice);

  /// All pairs of triangles that intersect, the smaller index first, sorted. Cost: some 10 ns per triangle, all processors.
  std::vector<std::array<int, 2>> find(const LatticeMesh& lattice);
  /// Of the same lattice with some triangles changed: the pairs with one of these.
  std::vector<std::array<int, 2>> find(const LatticeMesh& lattice, std::span<const int> changed);

  /// Of another mesh of this lattice: the pairs that lie where given ones of this mesh do, or next to it.
  std::vector<std::array<int, 2>> find_around(std::span<const std::array<int, 2>> pairs, const LatticeMesh& lattice, const LatticeMesh& other);

 private:
  /// Least and greatest coordinates, rounded outwards; the fourth does not count.
  struct Box {
    Eigen::Array4f least, greatest;
  };
  /// Up to eight neighbouring triangles: of 2 x 2 quads, or one after the other in a strip or fan.
  struct Piece {
    int patch = -1;                                  ///< -1: of a strip or fan
    int column = 0, columns = 0, row = 0, rows = 0;  ///< its quads
    int begin = 0, count = 0;                        ///< its triangles in triangles_
  };
  /// Up to four pieces: of 4 x 4 quads, or of a strip or fan.
  struct Part {
    int patch = -1;
    int column = 0, row = 0;   ///< of squares, in squares
    int begin = 0, count = 0;  ///< its pieces
  };
  void measure(const LatticeMesh& lattice, int part);
  void join_boxes();
  void measure_again(const LatticeMesh& lattice, std::vector<int>& parts);
  /// The texel at a row of quads of a patch; columns wrap round once.
  int texel_of(int patch, int column, int row) const {
    const Rectangle& r = rectangles_[patch];
    return (r.y + 1 + row) * texture_width_ + r.x + (column < r.width ? column : column - r.width);
  }
  /// The first of a quad's normals.
  int normal_of(int patch, int column, int row) const {
    const int width = rectangles_[patch].width;
    return first_normal_[patch] + 2 * (row * width + (column < width ? column : column - width));
  }
  static constexpr int kPieceTriangles = 8;
  using PieceTriangles = std::array<Triangle, kPieceTriangles>;
  PieceTriangles triangles_of(const LatticeMesh& lattice, const Piece& piece) const;
  Box box_of(const LatticeMesh& lattice, const Triangle& triangle) const;
  Piece quads_of(const Part& part) const;
  bool is_smooth(const Part& a, const Part& b) const;
  bool is_smooth(const Piece& a, const Piece& b) const;
  /// A piece as it is when its triangles are looked at one by one.
  struct MeasuredPiece {
    int piece = -1;
    PieceTriangles triangles;
    std::array<Box, kPieceTriangles> boxes;
    std::array<bool, kPieceTriangles> has_corners;  ///< those that were asked for
    std::array<std::array<Vec3, 3>, kPieceTriangles> corners;
    std::array<Vec3, kPieceTriangles> normals;
    void place(const LatticeMesh& lattice, int triangle);
  };
  void measure(const LatticeMesh& lattice, int piece, MeasuredPiece& measured) const;
  void find_between(const LatticeMesh& lattice, int a, int b, const std::vector<char>& is_asked, std::array<MeasuredPiece, 2>& measured,
                    std::vector<std::array<int, 2>>& pairs) const;
  std::vector<std::array<int, 2>> find_from(const LatticeMesh& lattice, std::span<const int> parts, const std::vector<char>& is_asked,
                                            bool are_alone = false) const;

  float margin_;
  int texture_width_;
  std::vector<Rectangle> rectangles_;  // per patch
  std::vector<std::array<int, 2>> squares_;  // per patch, how many columns and rows of them
  std::vector<int> first_square_;            // per patch, in places_
  std::vector<int> places_;                  // per square, by rows of a patch, its part
  std::vector<Part> parts_;                  // squares along a curve, then strips
  std::vector<Piece> pieces_;
  std::vector<int> triangles_, part_of_;  // of the pieces; per triangle
  std::vector<Eigen::Array4f> normals_;   // per triangle between inner rows, patch by patch
  std::vector<int> first_normal_;         // per patch
  std::vector<Box> normal_boxes_;         // per part
  std::vector<Box> piece_boxes_;
  std::vector<std::vector<Box>> boxes_;  // per level: of parts, of every eight of them, and so on
};

}  // namespace skeletex
