// SPDX-License-Identifier: MIT
#pragma once
#include <array>
#include <memory>
#include <span>
#include <vector>

#include "skeletex/convert/snap/lattice_mesh.h"
#include "skeletex/geometry/triangle_block.h"

namespace skeletex {

/// Finds where a lattice's mesh intersects itself, as find_self_intersections does, but knows that triangles which are
/// neighbours in the lattice are so in space: where a part of it bends by less than a quarter turn all in all, no two
/// of its triangles meet. Nearly all of a lattice is such, and only other parts that lie near each other are looked at.
class LatticeCrossings {
 public:
  explicit LatticeCrossings(const LatticeMesh& lattice);

  /// Where the lattice's parts lie; of the same lattice with some triangles changed, the parts with these.
  void measure(const LatticeMesh& lattice);
  void measure(const LatticeMesh& lattice, std::span<const int> changed);
  /// Of a lattice as it was measured last: the pairs of triangles that intersect with one that is asked for, the
  /// smaller index first, sorted.
  std::vector<std::array<int, 2>> find(const LatticeMesh& lattice, std::span<const int> triangles);

  /// Of another mesh of this lattice: the same pairs, and all between the same parts (4 x 4 quads, or eight triangles
  /// at an end) as given ones for one in `share` pairs of parts.
  struct Others {
    std::vector<std::array<int, 2>> pairs;
    std::size_t counted = 0;      ///< of these, those between such pairs of parts
    std::size_t given_there = 0;  ///< of the given ones, those between them where there is any of the others
  };
  /// \param other  its triangles there are chosen and filled where they are not there yet
  Others find_between_same(std::span<const std::array<int, 2>> pairs, LatticeMesh& other, int share) const;

 private:
  /// Least and greatest coordinates; the fourth does not count.
  struct Box {
    Eigen::Array4f least, greatest;
  };
  /// Of unit normals their coordinates, and along the four diagonals of space their sums: x + y + z, x + y - z, x - y +
  /// z, -x + y + z.
  struct Normals {
    Box box, diagonals;
  };
  /// What is known of a node's triangles: where they lie, rounded outwards, and their normals.
  struct Bounds {
    Box around;
    Normals normals;
  };
  /// Squares of 4 x 4 quads between a patch's inner rows; or of a strip or fan eight triangles each, counted from the
  /// first strip on, as one row. Above them a tree: each level joins two columns and rows of the one below. Columns
  /// wrap round.
  struct Grid {
    struct Level {
      int first, columns, rows;  ///< first: node
    };
    int patch = 0;
    int end = -1;  ///< -1: between inner rows
    std::vector<Level> levels;
    int first_triangle = 0, last_triangle = 0,
        skipped = 0;  ///< of a strip or fan; last: behind it; skipped: of its first eight those before it
    bool is_fan = false;
  };
  struct Node {
    int grid, level, row, column;
  };
  static constexpr int kSide = 4;  ///< quads along a side of a square
  /// A leaf as it is when its triangles are looked at one by one: of a square four lower and four upper ones in turns,
  /// row by row.
  struct Leaf {
    int node = -1;
    bool has_planes = false;  ///< and corners; else boxes and numbers alone
    QuadBlock quads;          ///< of a square
    TriangleBlock triangles;
  };
  /// Kept at places by the numbers of their nodes; the last place is for two that would have the same.
  using Leaves = std::unique_ptr<Leaf[]>;
  /// What a strip's or fan's triangles share with others.
  struct EndLeaf {
    int first_column = 0, last_column = 0;   ///< of its patch: from the first on, not wrapped
    int first_sample = 0, last_sample = -1;  ///< vertices of the seam, if they are neighbours on an arc
    bool has_sliver = false;                 ///< a triangle that rounding can turn: its normal tells nothing
  };
  /// Of some triangles the nodes that have any of them, and boxes around those that each has.
  struct Asked {
    std::vector<int> nodes;  ///< 1 + number of its box, 0 where there are none
    std::vector<Box> boxes;
    std::vector<int> leaves;  ///< sorted
    bool has(int node) const { return nodes[node] != 0; }
    const Box& box(int node) const { return boxes[nodes[node] - 1]; }
  };
  using Task = std::array<int, 2>;  // nodes
  int leaf_of(const LatticeMesh& lattice, int triangle) const;
  /// Of a leaf of a strip or fan, the first triangle and that behind the last.
  std::pair<int, int> triangles_of_end(const Node& node) const;
  int node_at(const Grid& grid, int level, int row, int column) const {
    return grid.levels[level].first + row * grid.levels[level].columns + column;
  }
  /// The texel at a row of quads of a patch; columns wrap round once.
  int texel_of(int patch, int column, int row) const {
    const Rectangle& r = rectangles_[patch];
    return (r.y + 1 + row) * texture_width_ + r.x + (column < r.width ? column : column - r.width);
  }
  /// The vertices of a square: of its quads' four columns and the one beside them, the last again where there are
  /// fewer.
  struct SquareVertices {
    std::array<const float*, 3> axes;
    std::array<const int*, kSide> diagonals;  ///< per row
    int stride, columns, rows;                ///< of quads
    std::array<float, 3 * (kSide + 1) * (kSide + 1)> copies;
    std::array<int, kSide * kSide> copied_diagonals;
  };
  void view(const LatticeMesh& lattice, const Node& node, SquareVertices& square) const;
  void append_quads(const Node& node, std::vector<int>& texels) const;
  Bounds measure_square(const LatticeMesh& lattice, const Node& node) const;
  void measure_squares(const LatticeMesh& lattice, int first);
  void box_squares(const LatticeMesh& lattice, int first);
  Bounds measure_end(const LatticeMesh& lattice, const Node& node) const;
  void measure_leaf(const LatticeMesh& lattice, int node);
  bool are_together(std::span<const int> leaves) const;
  void measure_leaves(const LatticeMesh& lattice, std::span<const int> leaves, bool has_normals);
  void join(const Asked* asked);
  Asked ask(const LatticeMesh& lattice, std::span<const int> triangles) const;
  EndLeaf describe_end(const LatticeMesh& lattice, const Node& node) const;
  int first_of_ends() const { return grids_[rectangles_.size()].levels[0].first; }

  bool do_asked_lie_at(const Asked& asked, const Task& task) const;
  bool can_meet(int a, int b) const;
  bool is_smooth_within(const Node& a, const Node& b) const;
  bool is_smooth_at_end(const Node& end, const Node& square) const;
  bool is_smooth_over_seam(int a, int b) const;
  bool are_quads_smooth(const LatticeMesh& lattice, int patch, int s, int t) const;
  std::vector<int> squares_near(const Asked& asked) const;
  bool split(const Asked& asked, const Task& task, std::vector<Task>& tasks) const;
  static Leaves fresh_leaves();
  void copy_quads(const Node& node, const SquareVertices& square, QuadBlock& quads) const;
  const TriangleBlock& boxes_of(const LatticeMesh& lattice, int node, const Asked* asked, Leaf& leaf) const;
  void find_planes_of(const LatticeMesh& lattice, Leaf& leaf) const;
  void find_between(const LatticeMesh& lattice, int a, int b, const Box& around_b, const Asked* asked,
                    const Leaves& leaves, std::vector<std::array<int, 2>>& pairs) const;

  float margin_;
  int texture_width_;
  double extent_;                      // of coordinates
  std::vector<Rectangle> rectangles_;  // per patch
  std::vector<Grid> grids_;            // of patches, then of their ends
  std::vector<Node> nodes_;
  std::vector<int> leaves_;
  std::vector<Box> boxes_;        // of nodes
  std::vector<Normals> normals_;  // of leaves; of squares that are not near what was asked for any
  std::vector<EndLeaf> ends_;     // per node behind those of patches
  std::vector<char> is_asked_;    // per triangle, while pairs with some are looked for
};

}  // namespace skeletex
