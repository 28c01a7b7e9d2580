// SPDX-License-Identifier: MIT
#include "skeletex/measure/lattice_crossings.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <utility>

#include "skeletex/measure/self_intersection.h"
#include "skeletex/model/parallel.h"

namespace skeletex {
namespace {

constexpr int kSide = 4;  // quads along a side of a square
constexpr int kPiece = 2;             // quads along a side of a piece of a square
constexpr int kNear = 8;              // quads: up to here a part of the lattice is looked at as a whole
constexpr float kLeastCosine = 0.2f;  // between a part's normals and their middle
constexpr double kRounding = 1e-10;   // of a product of lengths: far more than double precision rounds off
constexpr std::size_t kWidth = 8;
constexpr std::size_t kAtOnce = 128;

constexpr float kInfinity = std::numeric_limits<float>::infinity();

/// Bits of a number, one place apart.
std::uint64_t spread(std::uint32_t value) {
  std::uint64_t spread = 0;
  for (int bit = 0; bit < 16; ++bit) spread |= static_cast<std::uint64_t>(value >> bit & 1u) << (2 * bit);
  return spread;
}

template <class Box>
Box no_box() {
  return {{kInfinity, kInfinity, kInfinity, 0}, {-kInfinity, -kInfinity, -kInfinity, 0}};
}
template <class Box>
void add(const Box& other, Box& box) {
  box.least = box.least.min(other.least);
  box.greatest = box.greatest.max(other.greatest);
}
/// (Without branches: which of the sides decides is chance.)
template <class Box>
bool do_overlap(const Box& a, const Box& b) {
  return (static_cast<int>(a.least[0] <= b.greatest[0]) & static_cast<int>(b.least[0] <= a.greatest[0]) &
          static_cast<int>(a.least[1] <= b.greatest[1]) & static_cast<int>(b.least[1] <= a.greatest[1]) &
          static_cast<int>(a.least[2] <= b.greatest[2]) & static_cast<int>(b.least[2] <= a.greatest[2])) != 0;
}

/// 0 of a triangle without area: it may look anywhere.
Eigen::Array4f unit_normal(const Eigen::Array4f& u, const Eigen::Array4f& v) {
  const Eigen::Vector3f across = u.head<3>().matrix().cross(v.head<3>().matrix());
  const float length2 = across.squaredNorm();
  Eigen::Array4f normal = Eigen::Array4f::Zero();
  if (length2 > 0) normal.head<3>() = across.array() / std::sqrt(length2);
  return normal;
}

/// Whether all normals of a box lie within a cone.
template <class Box>
bool is_narrow(const Box& normals) {
  const Eigen::Array4f middle = 0.5f * (normals.least + normals.greatest);
  return (middle * normals.least).min(middle * normals.greatest).sum() > kLeastCosine * middle.matrix().norm();
}

/// Whether what two triangles do not share of the second one lies on one side of the first one's plane, further than rounding could
/// put it: then they do not meet. So it is with nearly all neighbours, and this is far cheaper than do_triangles_intersect.
bool is_beside(const Triangle& own, const std::array<Vec3, 3>& corners, const Vec3& normal, const Triangle& other, const std::array<Vec3, 3>& other_corners) {
  int free = 0, above = 0, below = 0;
  for (int k = 0; k < 3; ++k) {
    if (other[k] == own[0] || other[k] == own[1] || other[k] == own[2]) continue;
    const Vec3 offset = other_corners[k] - corners[0];
    const double height = normal.dot(offset), margin = kRounding * normal.cwiseAbs().dot(offset.cwiseAbs());
    ++free, above += height > margin, below += height < -margin;
  }
  return free > 0 && (above == free || below == free);
}

}  // namespace

LatticeCrossings::LatticeCrossings(const LatticeMesh& lattice)
    : margin_(static_cast<float>(4e-7 * lattice.model().diagonal)),
      texture_width_(lattice.model().texture.width),
      part_of_(lattice.triangle_count()) {
  const SkeletexModel& model = lattice.model();
  struct Square {
    std::uint64_t key;
    int patch, column, row;
  };
  std::vector<Square> squares;
  int places = 0;
  for (int patch = 0; patch < static_cast<int>(model.patches.size()); ++patch) {
    const Rectangle& r = model.patches[patch].rectangle;
    const int columns = (r.width + kSide - 1) / kSide, rows = (r.height - 3 + kSide - 1) / kSide;
    rectangles_.push_back(r);
    first_normal_.push_back(static_cast<int>(normals_.size()));
    normals_.resize(normals_.size() + 2 * static_cast<std::size_t>(r.width) * (r.height - 3));
    squares_.push_back({columns, rows});
    first_square_.push_back(places);
    places += columns * rows;
    for (int row = 0; row < rows; ++row)
      for (int column = 0; column < columns; ++column)
        squares.push_back(
            {static_cast<std::uint64_t>(patch) << 40 | spread(static_cast<std::uint32_t>(row)) << 1 | spread(static_cast<std::uint32_t>(column)),
             patch, column, row});
  }
  std::sort(squares.begin(), squares.end(), [](const Square& a, const Square& b) { return a.key < b.key; });
  places_.resize(places);
  triangles_.reserve(lattice.triangle_count());
  for (const Square& square : squares) {
    places_[first_square_[square.patch] + square.row * squares_[square.patch][0] + square.column] = static_cast<int>(parts_.size());
    parts_.push_back({square.patch, square.column, square.row, static_cast<int>(pieces_.size()), 0});
    const Piece whole = quads_of(parts_.back());
    for (int row = 0; row < whole.rows; row += kPiece)
      for (int column = 0; column < whole.columns; column += kPiece) {
        Piece piece{square.patch,
                    whole.column + column,
                    std::min(kPiece, whole.columns - column),
                    whole.row + row,
                    std::min(kPiece, whole.rows - row),
                    static_cast<int>(triangles_.size()),
                    0};
        for (int i = 0; i < piece.rows; ++i)
          for (int j = 0; j < piece.columns; ++j)
            for (const int side : {0, 1})
              triangles_.push_back(2 * texel_of(square.patch, piece.column + j, piece.row + i) + side);
        piece.count = static_cast<int>(triangles_.size()) - piece.begin;
        pieces_.push_back(piece);
        ++parts_.back().count;
      }
  }
  for (int begin = lattice.first_end_triangle(); begin < lattice.triangle_count(); begin += kPieceTriangles) {
    const int count = std::min(kPieceTriangles, lattice.triangle_count() - begin);
    parts_.push_back({-1, 0, 0, static_cast<int>(pieces_.size()), 1});
    pieces_.push_back({-1, 0, 0, 0, 0, static_cast<int>(triangles_.size()), count});
    for (int i = 0; i < count; ++i) triangles_.push_back(begin + i);
  }
  for (std::size_t part = 0; part < parts_.size(); ++part)
    for (int i = parts_[part].begin; i < parts_[part].begin + parts_[part].count; ++i)
      for (int k = pieces_[i].begin; k < pieces_[i].begin + pieces_[i].count; ++k) part_of_[triangles_[k]] = static_cast<int>(part);
  piece_boxes_.resize(pieces_.size());
  normal_boxes_.resize(parts_.size());
  for (std::size_t size = parts_.size();; size = block_count(size, kWidth)) {
    boxes_.emplace_back(size);
    if (size <= kWidth) break;
  }
}

/// The triangles of a piece, in order.
LatticeCrossings::PieceTriangles LatticeCrossings::triangles_of(const LatticeMesh& lattice, const Piece& piece) const {
  PieceTriangles triangles;
  if (piece.patch < 0) {
    for (int k = 0; k < piece.count; ++k) triangles[k] = lattice.triangle(triangles_[piece.begin + k]);
    return triangles;
  }
  auto next = triangles.begin();
  for (int row = piece.row; row < piece.row + piece.rows; ++row)
    for (int column = piece.column; column < piece.column + piece.columns; ++column)
      next = std::ranges::copy(lattice.triangles_of(texel_of(piece.patch, column, row), texel_of(piece.patch, column + 1, row)), next).out;
  return triangles;
}

LatticeCrossings::Box LatticeCrossings::box_of(const LatticeMesh& lattice, const Triangle& triangle) const {
  const Eigen::Array4f a = lattice.point(triangle[0]), b = lattice.point(triangle[1]), c = lattice.point(triangle[2]);
  return {a.min(b).min(c) - margin_, a.max(b).max(c) + margin_};
}

void LatticeCrossings::measure(const LatticeMesh& lattice, int part) {
  Box around = no_box<Box>(), normals = no_box<Box>();
  for (int i = parts_[part].begin; i < parts_[part].begin + parts_[part].count; ++i) {
    const Piece& piece = pieces_[i];
    Box box = no_box<Box>();
    if (piece.patch < 0) {
      for (int k = piece.begin; k < piece.begin + piece.count; ++k)
        for (const int vertex : lattice.triangle(triangles_[k])) add({lattice.point(vertex), lattice.point(vertex)}, box);
    } else {
      // Each vertex once.
      std::array<std::array<Eigen::Array4f, kPiece + 1>, kPiece + 1> points;
      for (int row = 0; row <= piece.rows; ++row)
        for (int column = 0; column <= piece.columns; ++column) {
          points[row][column] = lattice.point(texel_of(piece.patch, piece.column + column, piece.row + row));
          add({points[row][column], points[row][column]}, box);
        }
      for (int row = 0; row < piece.rows; ++row)
        for (int column = 0; column < piece.columns; ++column) {
          const int texel = texel_of(piece.patch, piece.column + column, piece.row + row);
          const Eigen::Array4f &own = points[row][column], &right = points[row][column + 1], &above = points[row + 1][column], &beyond = points[row + 1][column + 1];
          const bool is_second = lattice.takes_second(texel);
          const std::array<Eigen::Array4f, 2> u{right - own, beyond - (is_second ? above : own)};
          const std::array<Eigen::Array4f, 2> v{(is_second ? above : beyond) - own, is_second ? Eigen::Array4f(above - right) : Eigen::Array4f(above - own)};
          for (const int side : {0, 1}) {
            const Eigen::Array4f normal = unit_normal(u[side], v[side]);
            normals_[normal_of(piece.patch, piece.column + column, piece.row + row) + side] = normal;
            add({normal, normal}, normals);
          }
        }
    }
    piece_boxes_[i] = {box.least - margin_, box.greatest + margin_};
    add(piece_boxes_[i], around);
  }
  boxes_[0][part] = around;
  normal_boxes_[part] = normals;
}

void LatticeCrossings::join_boxes() {
  for (std::size_t level = 1; level < boxes_.size(); ++level)
    for (std::size_t i = 0; i < boxes_[level].size(); ++i) {
      boxes_[level][i] = no_box<Box>();
      for (std::size_t child = kWidth * i; child < std::min(boxes_[level - 1].size(), kWidth * (i + 1)); ++child)
        add(boxes_[level - 1][child], boxes_[level][i]);
    }
}

/// All quads of a square.
LatticeCrossings::Piece LatticeCrossings::quads_of(const Part& part) const {
  const Rectangle& r = rectangles_[part.patch];
  const int column = kSide * part.column, row = kSide * part.row;
  return {part.patch, column, std::min(kSide, r.width - column), row, std::min(kSide, r.height - 3 - row), 0, 0};
}

/// Whether the lattice around two bends so little that nothing in it can meet.
bool LatticeCrossings::is_smooth(const Piece& a, const Piece& b) const {
  if (a.patch < 0 || a.patch != b.patch) return false;
  const int width = rectangles_[a.patch].width;
  if (std::abs(a.row - b.row) > kNear) return false;
  const int ahead = (b.column - a.column + width) % width, behind = (width - ahead) % width;
  if (std::min(ahead, behind) > kNear) return false;
  const int column = ahead <= behind ? a.column : b.column;
  const int columns =
      std::min(width, std::min(ahead, behind) + (ahead <= behind ? std::max(b.columns, a.columns - ahead) : std::max(a.columns, b.columns - behind)));
  const int row = std::min(a.row, b.row), end = std::max(a.row + a.rows, b.row + b.rows);
  const auto for_each_normal = [&](const auto& act) {
    for (int r = row; r < end; ++r)
      for (int j = 0; j < columns; ++j) {
        const int first = normal_of(a.patch, column + j, r);
        act(normals_[first]), act(normals_[first + 1]);
      }
  };
  Eigen::Array4f middle = Eigen::Array4f::Zero();
  for_each_normal([&](const Eigen::Array4f& normal) { middle += normal; });
  float least = std::numeric_limits<float>::infinity();
  for_each_normal([&](const Eigen::Array4f& normal) { least = std::min(least, (normal * middle).sum()); });
  return least > kLeastCosine * middle.matrix().norm();
}

bool LatticeCrossings::is_smooth(const Part& a, const Part& b) const {
  if (a.patch < 0 || a.patch != b.patch || std::abs(a.row - b.row) * kSide > kNear) return false;
  const int columns = squares_[a.patch][0];
  const int ahead = (b.column - a.column + columns) % columns, behind = columns - ahead;
  const int steps = std::min(ahead, behind), first = ahead <= behind ? a.column : b.column;
  if (steps * kSide > kNear) return false;
  // By boxes of normals; one by one where these are not enough.
  Box normals = no_box<Box>();
  for (int row = std::min(a.row, b.row); row <= std::max(a.row, b.row); ++row)
    for (int step = 0; step <= steps; ++step) add(normal_boxes_[places_[first_square_[a.patch] + row * columns + (first + step) % columns]], normals);
  return is_narrow(normals) || is_smooth(quads_of(a), quads_of(b));
}

void LatticeCrossings::measure(const LatticeMesh& lattice, int piece, MeasuredPiece& measured) const {
  if (measured.piece == piece) return;
  measured.piece = piece;
  measured.triangles = triangles_of(lattice, pieces_[piece]);
  measured.has_corners.fill(false);
  for (int k = 0; k < pieces_[piece].count; ++k) measured.boxes[k] = box_of(lattice, measured.triangles[k]);
}

void LatticeCrossings::MeasuredPiece::place(const LatticeMesh& lattice, int triangle) {
  if (std::exchange(has_corners[triangle], true)) return;
  corners[triangle] = lattice.corners(triangles[triangle]);
  const auto& [a, b, c] = corners[triangle];
  normals[triangle] = (b - a).cross(c - a);
}

void LatticeCrossings::find_between(const LatticeMesh& lattice, int a, int b, const std::vector<char>& is_asked,
                                    std::array<MeasuredPiece, 2>& measured, std::vector<std::array<int, 2>>& pairs) const {
  // The quad of a piece's triangle.
  const auto quad_at = [](const Piece& piece, int triangle) {
    if (piece.patch < 0) return piece;
    const int quad = triangle / 2;
    return Piece{piece.patch, piece.column + quad % piece.columns, 1, piece.row + quad / piece.columns, 1, 0, 0};
  };
  auto& [ones, others] = measured;
  for (int i = parts_[a].begin; i < parts_[a].begin + parts_[a].count; ++i) {
    if (!do_overlap(piece_boxes_[i], boxes_[0][b])) continue;
    for (int j = a == b ? i : parts_[b].begin; j < parts_[b].begin + parts_[b].count; ++j) {
      if (!do_overlap(piece_boxes_[i], piece_boxes_[j])) continue;
      const Piece &one = pieces_[i], &other = pieces_[j];
      if (is_smooth(one, other)) continue;
      measure(lattice, i, ones), measure(lattice, j, others);
      for (int k = 0; k < one.count; ++k) {
        if (!do_overlap(ones.boxes[k], piece_boxes_[j])) continue;
        for (int l = i == j ? k + 1 : 0; l < other.count; ++l) {
          if (!do_overlap(ones.boxes[k], others.boxes[l])) continue;
          const int s = triangles_[one.begin + k], t = triangles_[other.begin + l];
          if (!is_asked.empty() && !is_asked[s] && !is_asked[t]) continue;
          const Triangle &first = ones.triangles[k], &second = others.triangles[l];
          ones.place(lattice, k), others.place(lattice, l);
          const auto &first_corners = ones.corners[k], &second_corners = others.corners[l];
          if (is_beside(first, first_corners, ones.normals[k], second, second_corners) ||
              is_beside(second, second_corners, others.normals[l], first, first_corners))
            continue;
          if (is_smooth(quad_at(one, k), quad_at(other, l))) continue;
          if (do_triangles_intersect(first, first_corners, second, second_corners)) pairs.push_back({std::min(s, t), std::max(s, t)});
        }
      }
    }
  }
}

/// \param parts       all, or some in order: then pairs with one of these, when both are it is the first that finds them
/// \param are_alone  pairs within `parts` only
std::vector<std::array<int, 2>> LatticeCrossings::find_from(const LatticeMesh& lattice, std::span<const int> parts,
                                                            const std::vector<char>& is_asked, bool are_alone) const {
  const bool are_all = parts.empty();
  const std::size_t count = are_all ? parts_.size() : parts.size();
  const std::size_t at_once = are_all ? kAtOnce : kWidth;
  std::vector<std::vector<std::array<int, 2>>> found(block_count(count, at_once));
  for_each_block(count, at_once, [&](std::size_t block, std::size_t begin, std::size_t end) {
    std::vector<std::pair<int, int>> stack;  // level, node
    std::vector<int> near;
    std::array<MeasuredPiece, 2> measured;
    const int top = static_cast<int>(boxes_.size()) - 1;
    const auto is_listed = [&](int part) { return std::binary_search(parts.begin(), parts.end(), part); };
    const auto part_at = [&](std::size_t i) { return are_all ? static_cast<int>(i) : parts[i]; };
    // The tree is asked once for several parts that lie beside each other.
    for (std::size_t first = begin, last = begin; first < end; first = last) {
      while (last < end && last - first < kWidth && part_at(last) - part_at(first) < static_cast<int>(2 * kWidth)) ++last;
      Box around = no_box<Box>();
      for (std::size_t i = first; i < last; ++i) add(boxes_[0][part_at(i)], around);
      near.clear();
      for (int node = 0; node < static_cast<int>(boxes_[top].size()); ++node) stack.push_back({top, node});
      while (!stack.empty()) {
        const auto [level, node] = stack.back();
        stack.pop_back();
        // With all of them every pair is found from its first part.
        if (are_all && (static_cast<std::int64_t>(node) + 1) << (3 * level) <= part_at(first)) continue;
        if (!do_overlap(around, boxes_[level][node])) continue;
        if (level == 0)
          near.push_back(node);
        else
          for (int child = 8 * node; child < std::min(static_cast<int>(boxes_[level - 1].size()), 8 * (node + 1)); ++child)
            stack.push_back({level - 1, child});
      }
      for (std::size_t i = first; i < last; ++i) {
        const int part = part_at(i);
        for (const int other : near) {
          if (!do_overlap(boxes_[0][part], boxes_[0][other])) continue;
          if (are_all ? other < part : is_listed(other) ? other < part : are_alone) continue;
          if (!is_smooth(parts_[part], parts_[other])) find_between(lattice, part, other, is_asked, measured, found[block]);
        }
      }
    }
  });
  std::vector<std::array<int, 2>> pairs;
  for (const auto& some : found) pairs.insert(pairs.end(), some.begin(), some.end());
  std::sort(pairs.begin(), pairs.end());
  return pairs;
}

std::vector<std::array<int, 2>> LatticeCrossings::find(const LatticeMesh& lattice) {
  for_each_block(parts_.size(), kAtOnce, [&](std::size_t, std::size_t begin, std::size_t end) {
    for (std::size_t part = begin; part < end; ++part) measure(lattice, static_cast<int>(part));
  });
  join_boxes();
  return find_from(lattice, {}, {});
}

std::vector<std::array<int, 2>> LatticeCrossings::find(const LatticeMesh& lattice, std::span<const int> changed) {
  if (changed.empty()) return {};
  std::vector<char> is_asked(part_of_.size(), 0);
  std::vector<int> parts;
  for (const int triangle : changed) {
    is_asked[triangle] = 1;
    parts.push_back(part_of_[triangle]);
  }
  measure_again(lattice, parts);
  return find_from(lattice, parts, is_asked);
}

/// \param parts  sorted here
void LatticeCrossings::measure_again(const LatticeMesh& lattice, std::vector<int>& parts) {
  std::sort(parts.begin(), parts.end());
  parts.erase(std::unique(parts.begin(), parts.end()), parts.end());
  for_each_block(parts.size(), kAtOnce, [&](std::size_t, std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) measure(lattice, parts[i]);
  });
  join_boxes();
}

std::vector<std::array<int, 2>> LatticeCrossings::find_around(std::span<const std::array<int, 2>> pairs, const LatticeMesh& lattice, const LatticeMesh& other) {
  std::vector<int> parts;
  for (const auto& pair : pairs)
    for (const int triangle : pair) {
      const Part& part = parts_[part_of_[triangle]];
      if (part.patch < 0) {
        parts.push_back(part_of_[triangle]);
        continue;
      }
      const auto [columns, rows] = squares_[part.patch];
      for (int row = std::max(0, part.row - 1); row <= std::min(rows - 1, part.row + 1); ++row)
        for (int step = -1; step <= 1; ++step)
          parts.push_back(places_[first_square_[part.patch] + row * columns + (part.column + step + columns) % columns]);
    }
  measure_again(other, parts);
  const auto found = find_from(other, parts, {}, true);
  measure_again(lattice, parts);
  return found;
}

}  // namespace skeletex
