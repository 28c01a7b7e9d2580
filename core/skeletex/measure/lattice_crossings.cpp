// SPDX-License-Identifier: MIT
#include "skeletex/measure/lattice_crossings.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>
#include <numbers>
#include <utility>

#include "skeletex/measure/self_intersection.h"
#include "skeletex/model/parallel.h"

namespace skeletex {
namespace {

constexpr int kEndTriangles = 8;      // of a leaf of a strip or fan
constexpr int kNear = 2;              // nodes: up to here a part of the lattice is looked at as a whole
constexpr int kNearQuads = 8;         // quads, likewise
constexpr float kLeastCosine = 0.2f;  // between a part's normals and their middle
constexpr double kRounding = 1e-10;   // of a product of lengths: far more than double precision rounds off
constexpr float kSliver = 16;         // of what rounding moves a vertex by: the least height of a triangle that it does not turn
constexpr std::size_t kAtOnce = 128;
constexpr int kTaskLevel = 3;         // nodes up to here are one task
constexpr std::size_t kTasks = 8;     // at once
constexpr std::size_t kLeaves = 96;   // kept by each thread

constexpr float kInfinity = std::numeric_limits<float>::infinity();

using Four = Eigen::Array4f;

template <class Box>
Box no_box() {
  return {{kInfinity, kInfinity, kInfinity, 0}, {-kInfinity, -kInfinity, -kInfinity, 0}};
}
template <class Box>
inline void add(const Box& other, Box& box) {
  box.least = box.least.min(other.least);
  box.greatest = box.greatest.max(other.greatest);
}
template <class Box>
inline void add(const Four& point, Box& box) {
  box.least = box.least.min(point);
  box.greatest = box.greatest.max(point);
}
template <class Box>
void widen(float margin, Box& box) {
  const Four by{margin, margin, margin, 0};
  box.least -= by, box.greatest += by;
}
/// (Without branches: which of the sides decides is chance.)
template <class Box>
inline bool do_overlap(const Box& a, const Box& b) {
  const Four gaps = (a.least - b.greatest).max(b.least - a.greatest);
  return gaps.maxCoeff() <= 0;
}

/// 0 of a triangle without area: it may look anywhere.
inline Four unit_normal(const Four& u, const Four& v) {
  const Eigen::Vector3f across = u.head<3>().matrix().cross(v.head<3>().matrix());
  const float length2 = across.squaredNorm();
  Four normal = Four::Zero();
  if (length2 > 0) normal.head<3>() = across.array() / std::sqrt(length2);
  return normal;
}

inline Four diagonals_of(const Four& n) { return {n[0] + n[1] + n[2], n[0] + n[1] - n[2], n[0] - n[1] + n[2], n[1] + n[2] - n[0]}; }
template <class Normals>
Normals no_normals() {
  constexpr float k = kInfinity;
  return {{{k, k, k, 0}, {-k, -k, -k, 0}}, {{k, k, k, k}, {-k, -k, -k, -k}}};
}
template <class Normals>
requires requires(Normals n) { n.diagonals; }
inline void add(const Normals& other, Normals& normals) {
  add(other.box, normals.box), add(other.diagonals, normals.diagonals);
}

/// Whether all normals lie within a cone: around the middle of their box, an axis or a diagonal.
template <class Normals>
inline bool is_narrow(const Normals& normals) {
  const Four &least = normals.box.least, &greatest = normals.box.greatest;
  const Four middle = 0.5f * (least + greatest);
  if ((middle * least).min(middle * greatest).sum() > kLeastCosine * middle.matrix().norm()) return true;
  constexpr float kLeastSum = kLeastCosine * std::numbers::sqrt3_v<float>;
  // (The fourth coordinate is 0.)
  return std::max(least.maxCoeff(), -greatest.minCoeff()) > kLeastCosine ||
         std::max(normals.diagonals.least.maxCoeff(), -normals.diagonals.greatest.minCoeff()) > kLeastSum;
}

/// Whether a triangle is so thin that rounding of its corners can turn it.
inline bool is_sliver(const Four& a, const Four& b, const Four& c, float least_height) {
  const Eigen::Vector3f u = (b - a).head<3>().matrix(), v = (c - a).head<3>().matrix();
  return u.cross(v).squaredNorm() <= least_height * least_height * std::max({u.squaredNorm(), v.squaredNorm(), (v - u).squaredNorm()});
}

/// \param is_first  1 or 0 of each
inline Four either(const Four& is_first, const Four& a, const Four& b) { return a * is_first + b * (1 - is_first); }

/// Which of the boxes of a leaf's triangles overlap another one. A compiler that can makes it once more for processors with wider vectors.
#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__)
__attribute__((target_clones("avx2", "default")))
#endif
void find_overlapping(const std::array<std::array<float, 32>, 3>& least, const std::array<std::array<float, 32>, 3>& greatest, const float* other_least,
                      const float* other_greatest, std::array<unsigned char, 32>& do_overlap) {
  const float low_x = other_least[0], low_y = other_least[1], low_z = other_least[2];
  const float high_x = other_greatest[0], high_y = other_greatest[1], high_z = other_greatest[2];
  const float *least_x = least[0].data(), *least_y = least[1].data(), *least_z = least[2].data();
  const float *greatest_x = greatest[0].data(), *greatest_y = greatest[1].data(), *greatest_z = greatest[2].data();
  std::array<int, 32> all;  // apart from bytes, which could be part of anything
  for (int i = 0; i < 32; ++i)
    all[i] = static_cast<int>(least_x[i] <= high_x) & static_cast<int>(low_x <= greatest_x[i]) & static_cast<int>(least_y[i] <= high_y) &
             static_cast<int>(low_y <= greatest_y[i]) & static_cast<int>(least_z[i] <= high_z) & static_cast<int>(low_z <= greatest_z[i]);
  for (int i = 0; i < 32; ++i) do_overlap[i] = static_cast<unsigned char>(all[i]);
}

/// From a to b round a circle, the shorter way: where it starts, and its steps.
std::pair<int, int> between(int a, int b, int around) {
  const int ahead = (b - a + around) % around, behind = (around - ahead) % around;
  return ahead <= behind ? std::pair(a, ahead) : std::pair(b, behind);
}

}  // namespace

LatticeCrossings::LatticeCrossings(const LatticeMesh& lattice)
    : margin_(static_cast<float>(4e-7 * lattice.model().diagonal)), texture_width_(lattice.model().texture.width),
      extent_(lattice.model().origin.lpNorm<Eigen::Infinity>() + lattice.model().diagonal) {
  const SkeletexModel& model = lattice.model();
  const auto add_grid = [&](Grid grid, int columns, int rows) {
    for (int level = 0;; ++level, columns = (columns + 1) / 2, rows = (rows + 1) / 2) {
      grid.levels.push_back({static_cast<int>(nodes_.size()), columns, rows});
      for (int row = 0; row < rows; ++row)
        for (int column = 0; column < columns; ++column) {
          if (level == 0) leaves_.push_back(static_cast<int>(nodes_.size()));
          nodes_.push_back({static_cast<int>(grids_.size()), level, row, column});
        }
      if (columns == 1 && rows == 1) break;
    }
    grids_.push_back(std::move(grid));
  };
  const int patches = static_cast<int>(model.patches.size());
  for (int patch = 0; patch < patches; ++patch) {
    const Rectangle& r = model.patches[patch].rectangle;
    rectangles_.push_back(r);
    add_grid({patch, -1, {}, 0, 0, 0, false}, static_cast<int>(block_count(r.width, kSide)), static_cast<int>(block_count(r.height - 3, kSide)));
  }
  for (int patch = 0; patch < patches; ++patch)
    for (const int end : {0, 1}) {
      const auto [first, last] = lattice.triangles_of_end(patch, static_cast<BoneEnd>(end));
      const int skipped = (first - lattice.first_end_triangle()) % kEndTriangles;
      add_grid({patch, end, {}, first, last, skipped, lattice.is_pole(patch, static_cast<BoneEnd>(end))},
               static_cast<int>(block_count(skipped + last - first, kEndTriangles)), 1);
    }
}

LatticeCrossings::EndLeaf LatticeCrossings::describe_end(const LatticeMesh& lattice, const Node& node) const {
  const Grid& grid = grids_[node.grid];
  const Rectangle& r = rectangles_[grid.patch];
  EndLeaf leaf;
  std::vector<int> samples;
  int least = 0, greatest = 0, first = -1;
  const auto [begin, end] = triangles_of_end(node);
  for (int i = begin; i < end; ++i) {
    const Triangle triangle = lattice.triangle(i);
    leaf.has_sliver = leaf.has_sliver || is_sliver(lattice.point(triangle[0]), lattice.point(triangle[1]), lattice.point(triangle[2]), kSliver * margin_);
    for (const int vertex : triangle) {
      if (!lattice.is_texel(vertex)) {
        samples.push_back(vertex);
        continue;
      }
      const int at = vertex % texture_width_ - r.x;
      if (first < 0) first = at;
      int offset = at - first;  // at most some half turn
      if (2 * offset > r.width) offset -= r.width;
      if (2 * offset < -r.width) offset += r.width;
      least = std::min(least, offset), greatest = std::max(greatest, offset);
    }
  }
  if (first >= 0) {
    leaf.first_column = (first + least + r.width) % r.width;
    leaf.last_column = leaf.first_column + greatest - least;
  }
  std::sort(samples.begin(), samples.end());
  samples.erase(std::unique(samples.begin(), samples.end()), samples.end());
  if (!samples.empty() && samples.back() - samples.front() + 1 == std::ssize(samples)) leaf.first_sample = samples.front(), leaf.last_sample = samples.back();
  return leaf;
}

int LatticeCrossings::leaf_of(const LatticeMesh& lattice, int triangle) const {
  const int patches = static_cast<int>(rectangles_.size());
  if (triangle < lattice.first_end_triangle()) {
    const int texel = triangle / 2, patch = lattice.patch_of(texel);
    const Rectangle& r = rectangles_[patch];
    return node_at(grids_[patch], 0, (texel / texture_width_ - r.y - 1) / kSide, (texel % texture_width_ - r.x) / kSide);
  }
  const auto grid = std::prev(std::upper_bound(grids_.begin() + patches, grids_.end(), triangle, [](int t, const Grid& g) { return t < g.first_triangle; }));
  return node_at(*grid, 0, 0, (triangle - grid->first_triangle + grid->skipped) / kEndTriangles);
}

std::pair<int, int> LatticeCrossings::triangles_of_end(const Node& node) const {
  const Grid& grid = grids_[node.grid];
  const int begin = grid.first_triangle - grid.skipped + kEndTriangles * node.column;
  return {std::max(begin, grid.first_triangle), std::min(begin + kEndTriangles, grid.last_triangle)};
}

void LatticeCrossings::view(const LatticeMesh& lattice, const Node& node, SquareVertices& square) const {
  const int patch = grids_[node.grid].patch, width = rectangles_[patch].width, column = kSide * node.column, row = kSide * node.row;
  square.columns = std::min(kSide, width - column), square.rows = std::min(kSide, rectangles_[patch].height - 3 - row);
  if (column + kSide < width) {
    square.stride = texture_width_;
    for (int axis = 0; axis < 3; ++axis) square.axes[axis] = lattice.planes()[axis].data() + texel_of(patch, column, row);
    for (int i = 0; i < square.rows; ++i) square.diagonals[i] = lattice.diagonals().data() + texel_of(patch, column, row + i);
    return;
  }
  constexpr int kAcross = kSide + 1;
  square.stride = kAcross;
  for (int i = 0; i <= square.rows; ++i)
    for (int k = 0; k < kAcross; ++k) {
      const int texel = texel_of(patch, std::min(column + k, width), row + i);
      for (int axis = 0; axis < 3; ++axis) square.copies[(axis * kAcross + i) * kAcross + k] = lattice.planes()[axis][texel];
      if (i < square.rows && k < kSide) square.copied_diagonals[i * kSide + k] = lattice.diagonals()[texel];
    }
  for (int axis = 0; axis < 3; ++axis) square.axes[axis] = square.copies.data() + axis * kAcross * kAcross;
  for (int i = 0; i < square.rows; ++i) square.diagonals[i] = square.copied_diagonals.data() + i * kSide;
}

/// Four columns at a time, and no more than their loads, or the compiler keeps copies in memory.
LatticeCrossings::Bounds LatticeCrossings::measure_square(const LatticeMesh& lattice, const Node& node) const {
  SquareVertices square;
  view(lattice, node, square);
  const Four none = Four::Constant(kInfinity);
  Four least[3] = {none, none, none}, greatest[3] = {-none, -none, -none};
  // x, y, z, and the diagonals.
  Four least_normals[7] = {none, none, none, none, none, none, none};
  Four greatest_normals[7] = {-none, -none, -none, -none, -none, -none, -none};
  for (int row = 0; row < square.rows; ++row) {
    const Four is_second = Eigen::Map<const Eigen::Array4i>(square.diagonals[row]).cast<float>();
    Four u[2][3], v[2][3];
    for (int axis = 0; axis < 3; ++axis) {
      const float* at = square.axes[axis] + row * square.stride;
      const Four own = Eigen::Map<const Four>(at), right = Eigen::Map<const Four>(at + 1);
      const Four above = Eigen::Map<const Four>(at + square.stride), beyond = Eigen::Map<const Four>(at + square.stride + 1);
      least[axis] = least[axis].min(own.min(right).min(above.min(beyond)));
      greatest[axis] = greatest[axis].max(own.max(right).max(above.max(beyond)));
      u[0][axis] = right - own, v[0][axis] = either(is_second, above, beyond) - own;
      u[1][axis] = beyond - either(is_second, above, own), v[1][axis] = above - either(is_second, right, own);
    }
    for (int side = 0; side < 2; ++side) {
      const Four x = u[side][1] * v[side][2] - u[side][2] * v[side][1], y = u[side][2] * v[side][0] - u[side][0] * v[side][2],
                 z = u[side][0] * v[side][1] - u[side][1] * v[side][0];
      const Four inverse = 1 / (x * x + y * y + z * z).sqrt().max(std::numeric_limits<float>::min());
      Four normal[7] = {x * inverse, y * inverse, z * inverse};
      for (int axis = 0; axis < 3; ++axis)
        for (int k = square.columns; k < kSide; ++k) normal[axis][k] = normal[axis][0];
      const Four sum = normal[0] + normal[1];
      normal[3] = sum + normal[2], normal[4] = sum - normal[2], normal[5] = normal[0] - normal[1] + normal[2], normal[6] = normal[1] - normal[0] + normal[2];
      for (int axis = 0; axis < 7; ++axis) {
        least_normals[axis] = least_normals[axis].min(normal[axis]);
        greatest_normals[axis] = greatest_normals[axis].max(normal[axis]);
      }
    }
  }
  Bounds bounds{{{least[0].minCoeff(), least[1].minCoeff(), least[2].minCoeff(), 0}, {greatest[0].maxCoeff(), greatest[1].maxCoeff(), greatest[2].maxCoeff(), 0}},
                no_normals<Normals>()};
  for (int axis = 0; axis < 7; ++axis) {
    Box& box = axis < 3 ? bounds.normals.box : bounds.normals.diagonals;
    const int lane = axis < 3 ? axis : axis - 3;
    box.least[lane] = least_normals[axis].minCoeff(), box.greatest[lane] = greatest_normals[axis].maxCoeff();
  }
  widen(margin_, bounds.around);
  return bounds;
}

LatticeCrossings::Bounds LatticeCrossings::measure_end(const LatticeMesh& lattice, const Node& node) const {
  Bounds bounds{no_box<Box>(), no_normals<Normals>()};
  const auto [begin, end] = triangles_of_end(node);
  for (int i = begin; i < end; ++i) {
    const Triangle t = lattice.triangle(i);
    const Four a = lattice.point(t[0]), b = lattice.point(t[1]), c = lattice.point(t[2]);
    for (const Four& point : {a, b, c}) add(point, bounds.around);
    const Four normal = unit_normal(b - a, c - a);
    add(normal, bounds.normals.box), add(diagonals_of(normal), bounds.normals.diagonals);
  }
  widen(margin_, bounds.around);
  return bounds;
}

void LatticeCrossings::measure(const LatticeMesh& lattice, int node, Tree& tree) const {
  if (node < first_of_ends()) {
    tree.nodes[node] = measure_square(lattice, nodes_[node]);
  } else {
    tree.nodes[node] = measure_end(lattice, nodes_[node]);
    tree.ends[node - first_of_ends()] = describe_end(lattice, nodes_[node]);
  }
}

/// Levels above the leaves, and caps.
void LatticeCrossings::join(Tree& tree) const {
  for (const Grid& grid : grids_)
    for (std::size_t level = 1; level < grid.levels.size(); ++level) {
      const auto [first, columns, rows] = grid.levels[level];
      const Grid::Level& below = grid.levels[level - 1];
      for (int row = 0; row < rows; ++row)
        for (int column = 0; column < columns; ++column) {
          Bounds& all = tree.nodes[first + row * columns + column];
          all = {no_box<Box>(), no_normals<Normals>()};
          for (int r = 2 * row; r < std::min(2 * row + 2, below.rows); ++r)
            for (int c = 2 * column; c < std::min(2 * column + 2, below.columns); ++c) {
              const Bounds& part = tree.nodes[below.first + r * below.columns + c];
              add(part.around, all.around), add(part.normals, all.normals);
            }
        }
    }
  const std::size_t patches = rectangles_.size();
  tree.caps.assign(patches, {-1, -1});
  for (std::size_t i = patches; i < grids_.size(); ++i) {
    const Grid &fan = grids_[i], &quads = grids_[fan.patch];
    if (!fan.is_fan) continue;
    Normals normals = tree.nodes[fan.levels.back().first].normals;
    const auto [first, columns, rows] = quads.levels[0];
    int& cap = tree.caps[fan.patch][fan.end];
    while (is_narrow(normals) && ++cap < rows)
      for (int column = 0; column < columns; ++column) add(tree.nodes[first + (fan.end == 0 ? cap : rows - 1 - cap) * columns + column].normals, normals);
  }
}

/// Some leaves, and what they are parts of.
void LatticeCrossings::measure(const LatticeMesh& lattice, std::span<const int> leaves, Tree& tree) const {
  tree.nodes.resize(nodes_.size());
  tree.ends.resize(nodes_.size() - first_of_ends());
  for_each_block(leaves.size(), kAtOnce, [&](std::size_t, std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) measure(lattice, leaves[i], tree);
  });
  join(tree);
}

/// Leaves, and all that they are parts of.
void LatticeCrossings::mark(std::span<const int> leaves, std::vector<char>& are_asked) const {
  are_asked.assign(nodes_.size(), 0);
  for (const int leaf : leaves) {
    const Node& node = nodes_[leaf];
    const Grid& grid = grids_[node.grid];
    for (int level = 0; level < static_cast<int>(grid.levels.size()); ++level)
      if (std::exchange(are_asked[node_at(grid, level, node.row >> level, node.column >> level)], 1) != 0) break;
  }
}

/// Whether triangles of two nodes can, or of one: not where the lattice around them bends little, but for slivers of strips.
bool LatticeCrossings::can_meet(const Tree& tree, int a, int b) const {
  const Node &one = nodes_[a], &other = nodes_[b];
  const Grid &first = grids_[one.grid], &second = grids_[other.grid];
  const bool are_squares = first.end < 0 && second.end < 0;
  if (!are_squares && !first.is_fan && !second.is_fan) {
    if (one.level > 0 || other.level > 0) return true;
    const auto has_sliver = [&](int node, const Grid& grid) { return grid.end >= 0 && tree.ends[node - first_of_ends()].has_sliver; };
    if (has_sliver(a, first) || has_sliver(b, second)) return true;
  }
  if (a == b) return !is_narrow(tree.nodes[a].normals);
  if (first.patch == second.patch)
    for (const int end : {0, 1})
      if (tree.caps[first.patch][end] >= 0 && is_in_cap(tree, one, end) && is_in_cap(tree, other, end)) return false;
  if (one.grid == other.grid) return !is_smooth_within(tree, one, other);
  if (are_squares || one.level > 0 || other.level > 0) return true;
  if (first.end >= 0 && second.end >= 0) return !is_smooth_over_seam(tree, a, b);
  if (first.patch != second.patch) return true;
  const auto& [strip, square] = first.end >= 0 ? std::pair(one, other) : std::pair(other, one);
  return !is_smooth_at_end(tree, strip, square);
}

bool LatticeCrossings::is_in_cap(const Tree& tree, const Node& node, int end) const {
  const Grid& grid = grids_[node.grid];
  const int cap = tree.caps[grid.patch][end];
  if (grid.end >= 0) return grid.end == end;
  const int rows = grid.levels[0].rows, first = node.row << node.level, last = std::min(rows, (node.row + 1) << node.level);
  return end == 0 ? last <= cap : first >= rows - cap;
}

/// Two nodes of one grid and level.
bool LatticeCrossings::is_smooth_within(const Tree& tree, const Node& a, const Node& b) const {
  const Grid& grid = grids_[a.grid];
  const int columns = grid.levels[a.level].columns;
  if (std::abs(a.row - b.row) > kNear) return false;
  const auto [first, steps] = between(a.column, b.column, columns);
  if (steps > kNear) return false;
  Normals normals = no_normals<Normals>();
  for (int row = std::min(a.row, b.row); row <= std::max(a.row, b.row); ++row)
    for (int step = 0; step <= steps; ++step) add(tree.nodes[node_at(grid, a.level, row, (first + step) % columns)].normals, normals);
  return is_narrow(normals);
}

/// A leaf of a strip or fan and a square of the patch: all squares up to that, and what of the end lies at them.
bool LatticeCrossings::is_smooth_at_end(const Tree& tree, const Node& end, const Node& square) const {
  const Grid &strip = grids_[end.grid], &quads = grids_[square.grid];
  const auto [first_square, columns, rows] = quads.levels[0];
  const int row = strip.end == 0 ? square.row : rows - 1 - square.row;
  if (row > 1) return false;
  const int width = rectangles_[strip.patch].width, pieces = strip.levels[0].columns;
  const auto leaf_at = [&](int column) -> const EndLeaf& { return tree.ends[node_at(strip, 0, 0, (column % pieces + pieces) % pieces) - first_of_ends()]; };
  // In columns from the strip's first one on.
  const int origin = leaf_at(end.column).first_column, own = leaf_at(end.column).last_column - origin;
  int first = ((kSide * square.column - origin) % width + width) % width;
  if (2 * first > width) first -= width;
  const int last = std::max(own, first + kSide), reach = 3 * kSide;
  first = std::min(0, first);
  if (last - first > reach || 2 * reach > width) return false;
  Normals normals = tree.nodes[node_at(strip, 0, 0, end.column)].normals;
  for (int column = first, at; column < last; column += kSide - at % kSide) {
    at = ((origin + column) % width + width) % width;
    for (int r = 0; r <= row; ++r) add(tree.nodes[node_at(quads, 0, strip.end == 0 ? r : rows - 1 - r, at / kSide)].normals, normals);
  }
  // On both sides of the leaf.
  const auto step_between = [&](int from, int to) { return ((to - from) % width + width) % width; };
  for (int piece = end.column, at = own; at < last; ++piece) {
    const int step = step_between(leaf_at(piece).last_column, leaf_at(piece + 1).last_column);
    if (piece - end.column > 3) return false;
    add(tree.nodes[node_at(strip, 0, 0, (piece + 1) % pieces)].normals, normals);
    at += step;
  }
  for (int piece = end.column, at = 0; at > first; --piece) {
    const int step = step_between(leaf_at(piece - 1).first_column, leaf_at(piece).first_column);
    if (end.column - piece > 3) return false;
    add(tree.nodes[node_at(strip, 0, 0, ((piece - 1) % pieces + pieces) % pieces)].normals, normals);
    at -= step;
  }
  return is_narrow(normals);
}

/// Two leaves of strips on both sides of a seam.
bool LatticeCrossings::is_smooth_over_seam(const Tree& tree, int a, int b) const {
  const auto do_share_side = [&](int one, int other) {
    const EndLeaf &first = tree.ends[one - first_of_ends()], &second = tree.ends[other - first_of_ends()];
    return std::min(first.last_sample, second.last_sample) > std::max(first.first_sample, second.first_sample);
  };
  Normals normals = tree.nodes[a].normals;
  add(tree.nodes[b].normals, normals);
  if (!is_narrow(normals)) return false;
  if (do_share_side(a, b)) return true;
  // By way of a neighbour.
  for (const auto& [from, to] : {std::pair(a, b), std::pair(b, a)}) {
    const Node& node = nodes_[to];
    const Grid& grid = grids_[node.grid];
    const int pieces = grid.levels[0].columns;
    for (const int step : {1, pieces - 1}) {
      const int beside = node_at(grid, 0, 0, (node.column + step) % pieces);
      if (!do_share_side(from, beside)) continue;
      Normals all = normals;
      add(tree.nodes[beside].normals, all);
      if (is_narrow(all)) return true;
    }
  }
  return false;
}

/// Whether the lattice around the quads of two of a patch's triangles bends so little.
bool LatticeCrossings::are_quads_smooth(const LatticeMesh& lattice, int patch, int s, int t) const {
  const Rectangle& r = rectangles_[patch];
  const auto row_of = [&](int triangle) { return triangle / 2 / texture_width_ - r.y - 1; };
  const auto column_of = [&](int triangle) { return triangle / 2 % texture_width_ - r.x; };
  const int row = std::min(row_of(s), row_of(t)), end = std::max(row_of(s), row_of(t)) + 1;
  const auto [column, steps] = between(column_of(s), column_of(t), r.width);
  if (end - 1 - row > kNearQuads || steps > kNearQuads) return false;
  std::array<Four, 2 * (kNearQuads + 1) * (kNearQuads + 1)> normals;
  int count = 0;
  Four middle = Four::Zero();
  for (int i = row; i < end; ++i)
    for (int j = column; j < std::min(column + steps + 1, column + r.width); ++j)
      for (const Triangle& triangle : lattice.triangles_of(texel_of(patch, j < r.width ? j : j - r.width, i), texel_of(patch, (j + 1) % r.width, i))) {
        const Four a = lattice.point(triangle[0]), b = lattice.point(triangle[1]), c = lattice.point(triangle[2]);
        middle += normals[count++] = unit_normal(b - a, c - a);
      }
  float least = kInfinity;
  for (int k = 0; k < count; ++k) least = std::min(least, (normals[k] * middle).sum());
  return least > kLeastCosine * middle.matrix().norm();
}

LatticeCrossings::Leaf& LatticeCrossings::leaf_at(const LatticeMesh& lattice, int number, Leaf& leaf) const {
  if (leaf.node == number) return leaf;
  leaf.node = number;
  leaf.is_placed.fill(false);
  for (auto& plane : leaf.least) plane.fill(kInfinity);
  for (auto& plane : leaf.greatest) plane.fill(-kInfinity);
  const Node& node = nodes_[number];
  const Grid& grid = grids_[node.grid];
  int fours = 0;
  const auto add_four = [&](const auto& coordinates_of, int count) {
    for (int axis = 0; axis < 3; ++axis) {
      Four a, b, c;
      coordinates_of(axis, a, b, c);
      const Four least = a.min(b).min(c) - margin_, greatest = a.max(b).max(c) + margin_;
      std::copy_n(least.data(), count, leaf.least[axis].begin() + 4 * fours);
      std::copy_n(greatest.data(), count, leaf.greatest[axis].begin() + 4 * fours);
    }
    ++fours;
  };
  if (grid.end < 0) {
    SquareVertices square;
    view(lattice, node, square);
    for (int i = 0; i < 2 * square.rows; ++i) {
      const Four is_second = Eigen::Map<const Eigen::Array4i>(square.diagonals[i / 2]).cast<float>();
      add_four(
          [&](int axis, Four& a, Four& b, Four& c) {
            const float* at = square.axes[axis] + i / 2 * square.stride;
            const Four own = Eigen::Map<const Four>(at), right = Eigen::Map<const Four>(at + 1);
            const Four above = Eigen::Map<const Four>(at + square.stride), beyond = Eigen::Map<const Four>(at + square.stride + 1);
            a = i % 2 == 0 ? own : above, b = i % 2 == 0 ? right : beyond;
            c = i % 2 == 0 ? either(is_second, above, beyond) : either(is_second, right, own);
          },
          square.columns);
    }
    return leaf;
  }
  const auto [begin, end] = triangles_of_end(node);
  for (int first = begin; first < end; first += 4) {
    std::array<std::array<Four, 4>, 3> points;
    for (int k = 0; k < 4; ++k) {
      const Triangle t = lattice.triangle(std::min(first + k, end - 1));
      for (int corner = 0; corner < 3; ++corner) points[corner][k] = lattice.point(t[corner]);
    }
    add_four(
        [&](int axis, Four& a, Four& b, Four& c) {
          for (int k = 0; k < 4; ++k) a[k] = points[0][k][axis], b[k] = points[1][k][axis], c[k] = points[2][k][axis];
        },
        std::min(4, end - first));
  }
  return leaf;
}

/// All about a triangle of a leaf.
void LatticeCrossings::place(const LatticeMesh& lattice, int i, Leaf& leaf) const {
  leaf.is_placed[i] = true;
  const Node& node = nodes_[leaf.node];
  const Grid& grid = grids_[node.grid];
  Triangle& triangle = leaf.triangles[i];
  if (grid.end < 0) {
    const int column = kSide * node.column + i % 4, row = kSide * node.row + i / 8, side = i / 4 % 2;
    const int texel = texel_of(grid.patch, column, row);
    triangle = lattice.triangles_of(texel, texel_of(grid.patch, column + 1, row))[side];
    leaf.numbers[i] = 2 * texel + side;
  } else {
    leaf.numbers[i] = triangles_of_end(node).first + i;
    triangle = lattice.triangle(leaf.numbers[i]);
  }
  leaf.corners[i] = lattice.corners(triangle);
  const auto& [a, b, c] = leaf.corners[i];
  leaf.normals[i] = (b - a).cross(c - a);
  leaf.offsets[i] = leaf.normals[i].dot(a);
  leaf.margins[i] = kRounding * extent_ * leaf.normals[i].lpNorm<1>();
}

/// Whether what two triangles do not share of the second one lies on one side of the first one's plane, further than rounding could
/// put it: then they do not meet. So it is with nearly all neighbours, and this is far cheaper than do_triangles_intersect.
bool LatticeCrossings::is_beside(const Leaf& leaf, int i, const Leaf& others, int k) {
  const Triangle &own = leaf.triangles[i], &other = others.triangles[k];
  const Vec3& normal = leaf.normals[i];
  int free = 0, above = 0, below = 0;
  for (int c = 0; c < 3; ++c) {
    const int is_free = static_cast<int>(other[c] != own[0]) & static_cast<int>(other[c] != own[1]) & static_cast<int>(other[c] != own[2]);
    const double height = normal.dot(others.corners[k][c]) - leaf.offsets[i];
    free += is_free, above += is_free & static_cast<int>(height > leaf.margins[i]), below += is_free & static_cast<int>(height < -leaf.margins[i]);
  }
  return free > 0 && (above == free || below == free);
}

/// Triangles of two leaves, or of one.
void LatticeCrossings::find_between(const LatticeMesh& lattice, int a, int b, const Box& around_b, const std::vector<char>* is_asked, Leaves& leaves,
                                    std::vector<std::array<int, 2>>& pairs) const {
  // The last one is for two that are kept at the same place.
  const std::size_t places = leaves.size() - 1, place_a = a % places, place_b = a != b && b % places == place_a ? places : b % places;
  Leaf &one = leaf_at(lattice, a, leaves[place_a]), &other = leaf_at(lattice, b, leaves[place_b]);
  const bool is_of_one_patch = nodes_[a].grid == nodes_[b].grid && grids_[nodes_[a].grid].end < 0;
  const auto look_at = [&](int k, int l) {
    if (!one.is_placed[k]) place(lattice, k, one);
    if (!other.is_placed[l]) place(lattice, l, other);
    const int s = one.numbers[k], t = other.numbers[l];
    if (is_asked && !(*is_asked)[s] && !(*is_asked)[t]) return;
    const Triangle &first = one.triangles[k], &second = other.triangles[l];
    const auto &first_corners = one.corners[k], &second_corners = other.corners[l];
    if (is_beside(one, k, other, l) || is_beside(other, l, one, k)) return;
    if (!do_triangles_intersect(first, first_corners, second, second_corners)) return;
    if (is_of_one_patch && are_quads_smooth(lattice, grids_[nodes_[a].grid].patch, s, t)) return;
    pairs.push_back({std::min(s, t), std::max(s, t)});
  };
  std::array<unsigned char, kLeafTriangles> are_near, do_overlap;
  find_overlapping(one.least, one.greatest, around_b.least.data(), around_b.greatest.data(), are_near);
  for (int i = 0; i < kLeafTriangles; ++i) {
    if (are_near[i] == 0) continue;
    const std::array<float, 3> least{one.least[0][i], one.least[1][i], one.least[2][i]}, greatest{one.greatest[0][i], one.greatest[1][i], one.greatest[2][i]};
    find_overlapping(other.least, other.greatest, least.data(), greatest.data(), do_overlap);
    for (int first = 0; first < kLeafTriangles; first += 8) {
      // Nearly all of them do not.
      std::uint64_t any;
      std::memcpy(&any, do_overlap.data() + first, sizeof any);
      if (any == 0) continue;
      for (int k = std::max(first, a == b ? i + 1 : 0); k < first + 8; ++k)
        if (do_overlap[k] != 0) look_at(i, k);
    }
  }
}

/// The thread's own, none of them known.
LatticeCrossings::Leaves& LatticeCrossings::fresh_leaves() {
  static thread_local Leaves leaves(kLeaves + 1);
  for (Leaf& leaf : leaves) leaf.node = -1;
  return leaves;
}

/// What is to be asked in place of a pair of nodes, or a node by itself. \return whether they are leaves that can meet
bool LatticeCrossings::split(const Search& search, const Task& task, std::vector<Task>& tasks) const {
  const auto [a, b] = task;
  if (search.are_asked) {
    const bool is_first = (*search.are_asked)[a] != 0, is_second = (*search.are_asked)[b] != 0;
    if (!is_first && !is_second) return false;
  }
  if (a != b && !do_overlap(search.tree.nodes[a].around, search.tree.nodes[b].around)) return false;
  if (!can_meet(search.tree, a, b)) return false;
  const Node &one = nodes_[a], &other = nodes_[b];
  if (one.level == 0 && other.level == 0) return true;
  const auto parts_of = [&](const Node& node, std::array<int, 4>& parts) {
    const Grid& grid = grids_[node.grid];
    const Grid::Level& below = grid.levels[node.level - 1];
    int count = 0;
    for (int row = 2 * node.row; row < std::min(2 * node.row + 2, below.rows); ++row)
      for (int column = 2 * node.column; column < std::min(2 * node.column + 2, below.columns); ++column) parts[count++] = node_at(grid, node.level - 1, row, column);
    return count;
  };
  std::array<int, 4> parts{a}, others{b};
  if (a == b) {
    const int count = parts_of(one, parts);
    for (int i = 0; i < count; ++i)
      for (int j = i; j < count; ++j) tasks.push_back({parts[i], parts[j]});
    return false;
  }
  // Nodes of one grid keep the same level.
  const int count = one.level >= other.level ? parts_of(one, parts) : 1, other_count = other.level >= one.level ? parts_of(other, others) : 1;
  for (int i = 0; i < count; ++i)
    for (int j = 0; j < other_count; ++j) tasks.push_back({parts[i], others[j]});
  return false;
}

std::vector<std::array<int, 2>> LatticeCrossings::find(const Search& search) const {
  // Large nodes first, so that there are tasks for all processors.
  std::vector<Task> large, tasks;
  for (std::size_t i = 0; i < grids_.size(); ++i)
    for (std::size_t j = i; j < grids_.size(); ++j) large.push_back({grids_[i].levels.back().first, grids_[j].levels.back().first});
  while (!large.empty()) {
    const Task task = large.back();
    large.pop_back();
    if (std::max(nodes_[task[0]].level, nodes_[task[1]].level) <= kTaskLevel)
      tasks.push_back(task);
    else
      split(search, task, large);
  }
  std::vector<std::vector<std::array<int, 2>>> found(block_count(tasks.size(), kTasks));
  for_each_block(tasks.size(), kTasks, [&](std::size_t block, std::size_t begin, std::size_t end) {
    Leaves& leaves = fresh_leaves();
    std::vector<Task> stack(tasks.begin() + static_cast<std::ptrdiff_t>(begin), tasks.begin() + static_cast<std::ptrdiff_t>(end));
    while (!stack.empty()) {
      const Task task = stack.back();
      stack.pop_back();
      if (split(search, task, stack)) find_between(search.lattice, task[0], task[1], search.tree.nodes[task[1]].around, search.is_asked, leaves, found[block]);
    }
  });
  std::vector<std::array<int, 2>> pairs;
  for (const auto& some : found) pairs.insert(pairs.end(), some.begin(), some.end());
  std::sort(pairs.begin(), pairs.end());
  return pairs;
}

std::vector<std::array<int, 2>> LatticeCrossings::find(const LatticeMesh& lattice) {
  measure(lattice, leaves_, tree_);
  return find({lattice, tree_});
}

std::vector<std::array<int, 2>> LatticeCrossings::find(const LatticeMesh& lattice, std::span<const int> changed) {
  if (changed.empty()) return {};
  std::vector<char> is_asked(lattice.triangle_count(), 0), are_asked;
  std::vector<int> leaves;
  for (const int triangle : changed) {
    is_asked[triangle] = 1;
    leaves.push_back(leaf_of(lattice, triangle));
  }
  std::sort(leaves.begin(), leaves.end());
  leaves.erase(std::unique(leaves.begin(), leaves.end()), leaves.end());
  measure(lattice, leaves, tree_);
  mark(leaves, are_asked);
  return find({lattice, tree_, &are_asked, &is_asked});
}

LatticeCrossings::Others LatticeCrossings::find_between_same(std::span<const std::array<int, 2>> pairs, const LatticeMesh& other, int share) const {
  struct Given {
    Task leaves;
    std::array<int, 2> pair;
    auto operator<=>(const Given&) const = default;
  };
  std::vector<Given> given;
  for (const auto& [s, t] : pairs) {
    const int a = leaf_of(other, s), b = leaf_of(other, t);
    given.push_back({{std::min(a, b), std::max(a, b)}, {s, t}});
  }
  std::sort(given.begin(), given.end());
  std::vector<std::size_t> first;  // per pair of leaves, and the end
  for (std::size_t i = 0; i <= given.size(); ++i)
    if (i == 0 || i == given.size() || given[i].leaves != given[i - 1].leaves) first.push_back(i);
  const std::size_t count = first.size() - 1;
  std::vector<std::vector<std::array<int, 2>>> found(count);
  const auto is_whole = [&](std::size_t i) { return i % share == 0; };
  for_each_block(count, kAtOnce, [&](std::size_t, std::size_t begin, std::size_t end) {
    Leaves& leaves = fresh_leaves();
    for (std::size_t i = begin; i < end; ++i) {
      if (is_whole(i)) {
        const auto [a, b] = given[first[i]].leaves;
        const Bounds bounds = b < first_of_ends() ? measure_square(other, nodes_[b]) : measure_end(other, nodes_[b]);
        find_between(other, a, b, bounds.around, nullptr, leaves, found[i]);
        continue;
      }
      for (std::size_t k = first[i]; k < first[i + 1]; ++k) {
        const auto [s, t] = given[k].pair;
        const Triangle one = other.triangle(s), two = other.triangle(t);
        if (do_triangles_intersect(one, other.corners(one), two, other.corners(two))) found[i].push_back({s, t});
      }
    }
  });
  Others others;
  for (std::size_t i = 0; i < count; ++i) {
    others.pairs.insert(others.pairs.end(), found[i].begin(), found[i].end());
    if (!is_whole(i) || found[i].empty()) continue;
    others.counted += found[i].size();
    others.given_there += first[i + 1] - first[i];
  }
  std::sort(others.pairs.begin(), others.pairs.end());
  return others;
}

}  // namespace skeletex
