// SPDX-License-Identifier: MIT
#include "skeletex/convert/snap/lattice_crossings.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>

#include "skeletex/geometry/parallel.h"
#include "skeletex/geometry/self_intersection.h"
#include "skeletex/geometry/wide_too.h"

namespace skeletex {
namespace {

constexpr int kEndTriangles = 8;      // of a leaf of a strip or fan
constexpr int kNear = 2;              // squares: up to here a part of the lattice is looked at as a whole
constexpr int kNearAtEnds = 4;        // along a strip or fan, with what of it lies at them
constexpr int kNearQuads = 8;         // quads, likewise
constexpr float kLeastCosine = 0.2f;  // between a part's normals and their middle
constexpr double kRounding = 1e-10;   // of a product of lengths: far more than double precision rounds off
constexpr float kSliver =
    16;  // of what rounding moves a vertex by: the least height of a triangle that it does not turn
constexpr std::size_t kAtOnce = 128;
constexpr int kTaskLevel = 3;        // nodes up to here are one task
constexpr std::size_t kTasks = 8;    // at once
constexpr std::size_t kLeaves = 96;  // kept while some tasks are gone through

constexpr float kInfinity = std::numeric_limits<float>::infinity();

using Four = Eigen::Array4f;

/// (Eigen's are loops here.)
inline float least_of(const Four& v) { return std::min(std::min(v[0], v[1]), std::min(v[2], v[3])); }
inline float greatest_of(const Four& v) { return std::max(std::max(v[0], v[1]), std::max(v[2], v[3])); }

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
  return greatest_of(gaps) <= 0;
}

/// 0 of a triangle without area: it may look anywhere.
inline Four unit_normal(const Four& u, const Four& v) {
  const Eigen::Vector3f across = u.head<3>().matrix().cross(v.head<3>().matrix());
  const float length2 = across.squaredNorm();
  Four normal = Four::Zero();
  if (length2 > 0) normal.head<3>() = across.array() / std::sqrt(length2);
  return normal;
}

/// Of four triangles.
inline std::array<Four, 3> unit_normals(const Four (&u)[3], const Four (&v)[3]) {
  const Four x = u[1] * v[2] - u[2] * v[1], y = u[2] * v[0] - u[0] * v[2], z = u[0] * v[1] - u[1] * v[0];
  const Four inverse = 1 / (x * x + y * y + z * z).sqrt().max(std::numeric_limits<float>::min());
  return {x * inverse, y * inverse, z * inverse};
}

inline Four diagonals_of(const Four& n) {
  return {n[0] + n[1] + n[2], n[0] + n[1] - n[2], n[0] - n[1] + n[2], n[1] + n[2] - n[0]};
}
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
  return std::max(greatest_of(least), -least_of(greatest)) > kLeastCosine ||
         std::max(greatest_of(normals.diagonals.least), -least_of(normals.diagonals.greatest)) > kLeastSum;
}

/// Whether a triangle is so thin that rounding of its corners can turn it.
inline bool is_sliver(const Four& a, const Four& b, const Four& c, float least_height) {
  const Eigen::Vector3f u = (b - a).head<3>().matrix(), v = (c - a).head<3>().matrix();
  return u.cross(v).squaredNorm() <=
         least_height * least_height * std::max({u.squaredNorm(), v.squaredNorm(), (v - u).squaredNorm()});
}

/// \param is_first  1 or 0 of each
inline Four either(const Four& is_first, const Four& a, const Four& b) { return a * is_first + b * (1 - is_first); }

/// Of x, y and z, of normals and of their sums along diagonals (see LatticeCrossings::Normals).
constexpr int kAxes = 10, kSquaresAtOnce = 4, kColumnsAtOnce = 16;
template <int kCount>
struct Ranges {
  std::array<std::array<float, kCount>, kAxes> least, greatest;
};

/// Adds those of sixteen quads side by side.
/// \param planes, take_second  at the first vertex of all
SKELETEX_WIDE_TOO void add_quads(const std::array<const float*, 3>& planes, const int* __restrict take_second,
                                 int stride, Ranges<kColumnsAtOnce>& __restrict ranges) {
  using Lanes = std::array<float, kColumnsAtOnce>;
  const float* __restrict x = planes[0], * __restrict y = planes[1], * __restrict z = planes[2];
  const float* __restrict x_above = x + stride, * __restrict y_above = y + stride, * __restrict z_above = z + stride;
  std::array<Lanes, 3> normals[2];
  Lanes lengths[2];
  for (int k = 0; k < kColumnsAtOnce; ++k) {
    const auto second = static_cast<float>(take_second[k]), first = 1 - second;
    const float ax = x[k], ay = y[k], az = z[k], bx = x[k + 1], by = y[k + 1], bz = z[k + 1];
    const float cx = x_above[k], cy = y_above[k], cz = z_above[k], dx = x_above[k + 1], dy = y_above[k + 1],
                dz = z_above[k + 1];
    const auto add_normal = [&](int side, float ux, float uy, float uz, float vx, float vy, float vz) {
      const float nx = uy * vz - uz * vy, ny = uz * vx - ux * vz, nz = ux * vy - uy * vx;
      normals[side][0][k] = nx, normals[side][1][k] = ny, normals[side][2][k] = nz;
      lengths[side][k] = nx * nx + ny * ny + nz * nz;
    };
    add_normal(0, bx - ax, by - ay, bz - az, cx * second + dx * first - ax, cy * second + dy * first - ay,
               cz * second + dz * first - az);
    add_normal(1, dx - (cx * second + ax * first), dy - (cy * second + ay * first), dz - (cz * second + az * first),
               cx - (bx * second + ax * first), cy - (by * second + ay * first), cz - (bz * second + az * first));
  }
  // By value: references to what is in memory are branches. Square roots are, too, but for Eigen's.
  const auto lesser = [](float a, float b) { return a < b ? a : b; };
  const auto greater = [](float a, float b) { return a < b ? b : a; };
  for (const int side : {0, 1}) {
    Eigen::Map<Eigen::Array<float, kColumnsAtOnce, 1>> inverse(lengths[side].data());
    inverse = 1 / inverse.sqrt().max(std::numeric_limits<float>::min());
    for (int k = 0; k < kColumnsAtOnce; ++k) {
      const float nx = normals[side][0][k] * inverse[k], ny = normals[side][1][k] * inverse[k],
                  nz = normals[side][2][k] * inverse[k], sum = nx + ny;
      const auto add = [&](int axis, float value) {
        ranges.least[axis][k] = lesser(ranges.least[axis][k], value),
        ranges.greatest[axis][k] = greater(ranges.greatest[axis][k], value);
      };
      add(3, nx), add(4, ny), add(5, nz), add(6, sum + nz), add(7, sum - nz), add(8, nx - ny + nz),
          add(9, ny - nx + nz);
    }
  }
  for (int axis = 0; axis < 3; ++axis) {
    const float* __restrict own = planes[axis], * __restrict above = own + stride;
    for (int k = 0; k < kColumnsAtOnce; ++k) {
      const float a = own[k], b = own[k + 1], c = above[k], d = above[k + 1];
      ranges.least[axis][k] = lesser(lesser(ranges.least[axis][k], lesser(a, b)), lesser(c, d));
      ranges.greatest[axis][k] = greater(greater(ranges.greatest[axis][k], greater(a, b)), greater(c, d));
    }
  }
}

/// Of the vertices of sixteen quads side by side, one coordinate, by columns.
struct VertexRange {
  std::array<float, kColumnsAtOnce + 1> least, greatest;
};
SKELETEX_WIDE_TOO void find_range(const float* __restrict plane, int stride, int rows, VertexRange& __restrict range) {
  for (int k = 0; k <= kColumnsAtOnce; ++k) range.least[k] = range.greatest[k] = plane[k];
  for (int row = 1; row < rows; ++row)
    for (int k = 0; k <= kColumnsAtOnce; ++k) {
      const float value = plane[row * stride + k], least = range.least[k], greatest = range.greatest[k];
      range.least[k] = value < least ? value : least, range.greatest[k] = greatest < value ? value : greatest;
    }
}

/// From a to b round a circle, the shorter way: where it starts, and its steps.
std::pair<int, int> between(int a, int b, int around) {
  const int ahead = (b - a + around) % around, behind = (around - ahead) % around;
  return ahead <= behind ? std::pair(a, ahead) : std::pair(b, behind);
}

}  // namespace

LatticeCrossings::LatticeCrossings(const LatticeMesh& lattice)
    : margin_(static_cast<float>(4e-7 * lattice.model().diagonal)),
      texture_width_(lattice.model().texture.width),
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
    add_grid({patch, -1, {}, 0, 0, 0, false}, static_cast<int>(block_count(r.width, kSide)),
             static_cast<int>(block_count(r.height - 3, kSide)));
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
    leaf.has_sliver = leaf.has_sliver || is_sliver(lattice.point(triangle[0]), lattice.point(triangle[1]),
                                                   lattice.point(triangle[2]), kSliver * margin_);
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
  if (!samples.empty() && samples.back() - samples.front() + 1 == std::ssize(samples))
    leaf.first_sample = samples.front(), leaf.last_sample = samples.back();
  return leaf;
}

int LatticeCrossings::leaf_of(const LatticeMesh& lattice, int triangle) const {
  const int patches = static_cast<int>(rectangles_.size());
  if (triangle < lattice.first_end_triangle()) {
    const int texel = triangle / 2, patch = lattice.patch_of(texel);
    const Rectangle& r = rectangles_[patch];
    return node_at(grids_[patch], 0, (texel / texture_width_ - r.y - 1) / kSide,
                   (texel % texture_width_ - r.x) / kSide);
  }
  const auto grid = std::prev(std::upper_bound(grids_.begin() + patches, grids_.end(), triangle,
                                               [](int t, const Grid& g) { return t < g.first_triangle; }));
  return node_at(*grid, 0, 0, (triangle - grid->first_triangle + grid->skipped) / kEndTriangles);
}

std::pair<int, int> LatticeCrossings::triangles_of_end(const Node& node) const {
  const Grid& grid = grids_[node.grid];
  const int begin = grid.first_triangle - grid.skipped + kEndTriangles * node.column;
  return {std::max(begin, grid.first_triangle), std::min(begin + kEndTriangles, grid.last_triangle)};
}

void LatticeCrossings::view(const LatticeMesh& lattice, const Node& node, SquareVertices& square) const {
  const int patch = grids_[node.grid].patch, width = rectangles_[patch].width, column = kSide * node.column,
            row = kSide * node.row;
  square.columns = std::min(kSide, width - column), square.rows = std::min(kSide, rectangles_[patch].height - 3 - row);
  if (column + kSide < width) {
    square.stride = texture_width_;
    for (int axis = 0; axis < 3; ++axis)
      square.axes[axis] = lattice.planes()[axis].data() + texel_of(patch, column, row);
    for (int i = 0; i < square.rows; ++i)
      square.diagonals[i] = lattice.diagonals().data() + texel_of(patch, column, row + i);
    return;
  }
  constexpr int kAcross = kSide + 1;
  square.stride = kAcross;
  for (int i = 0; i <= square.rows; ++i)
    for (int k = 0; k < kAcross; ++k) {
      const int texel = texel_of(patch, std::min(column + k, width), row + i);
      for (int axis = 0; axis < 3; ++axis)
        square.copies[(axis * kAcross + i) * kAcross + k] = lattice.planes()[axis][texel];
      if (i < square.rows && k < kSide) square.copied_diagonals[i * kSide + k] = lattice.diagonals()[texel];
    }
  for (int axis = 0; axis < 3; ++axis) square.axes[axis] = square.copies.data() + axis * kAcross * kAcross;
  for (int i = 0; i < square.rows; ++i) square.diagonals[i] = square.copied_diagonals.data() + i * kSide;
}

/// The texels of its quads.
void LatticeCrossings::append_quads(const Node& node, std::vector<int>& texels) const {
  const Rectangle& r = rectangles_[grids_[node.grid].patch];
  const int column = kSide * node.column, row = kSide * node.row;
  for (int i = row; i < std::min(row + kSide, r.height - 3); ++i)
    for (int k = column; k < std::min(column + kSide, r.width); ++k)
      texels.push_back(texel_of(grids_[node.grid].patch, k, i));
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
      const Four above = Eigen::Map<const Four>(at + square.stride),
                 beyond = Eigen::Map<const Four>(at + square.stride + 1);
      least[axis] = least[axis].min(own.min(right).min(above.min(beyond)));
      greatest[axis] = greatest[axis].max(own.max(right).max(above.max(beyond)));
      u[0][axis] = right - own, v[0][axis] = either(is_second, above, beyond) - own;
      u[1][axis] = beyond - either(is_second, above, own), v[1][axis] = above - either(is_second, right, own);
    }
    for (int side = 0; side < 2; ++side) {
      const auto [x, y, z] = unit_normals(u[side], v[side]);
      Four normal[7] = {x, y, z};
      for (int axis = 0; axis < 3; ++axis)
        for (int k = square.columns; k < kSide; ++k) normal[axis][k] = normal[axis][0];
      const Four sum = normal[0] + normal[1];
      normal[3] = sum + normal[2], normal[4] = sum - normal[2], normal[5] = normal[0] - normal[1] + normal[2],
      normal[6] = normal[1] - normal[0] + normal[2];
      for (int axis = 0; axis < 7; ++axis) {
        least_normals[axis] = least_normals[axis].min(normal[axis]);
        greatest_normals[axis] = greatest_normals[axis].max(normal[axis]);
      }
    }
  }
  Bounds bounds{{{least_of(least[0]), least_of(least[1]), least_of(least[2]), 0},
                 {greatest_of(greatest[0]), greatest_of(greatest[1]), greatest_of(greatest[2]), 0}},
                no_normals<Normals>()};
  for (int axis = 0; axis < 7; ++axis) {
    Box& box = axis < 3 ? bounds.normals.box : bounds.normals.diagonals;
    const int lane = axis < 3 ? axis : axis - 3;
    box.least[lane] = least_of(least_normals[axis]), box.greatest[lane] = greatest_of(greatest_normals[axis]);
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

void LatticeCrossings::measure_leaf(const LatticeMesh& lattice, int node) {
  const bool is_square = node < first_of_ends();
  const Bounds bounds = is_square ? measure_square(lattice, nodes_[node]) : measure_end(lattice, nodes_[node]);
  boxes_[node] = bounds.around, normals_[node] = bounds.normals;
  if (!is_square) {
    ends_[node - first_of_ends()] = describe_end(lattice, nodes_[node]);
  }
}

/// Boxes of levels above the leaves.
/// \param asked  these nodes; all without
void LatticeCrossings::join(const Asked* asked) {
  for (const Grid& grid : grids_)
    for (std::size_t level = 1; level < grid.levels.size(); ++level) {
      const auto [first, columns, rows] = grid.levels[level];
      const Grid::Level& below = grid.levels[level - 1];
      for (int row = 0; row < rows; ++row)
        for (int column = 0; column < columns; ++column) {
          const int node = first + row * columns + column;
          if (asked && !asked->has(node)) continue;
          Box& all = boxes_[node];
          all = no_box<Box>();
          for (int r = 2 * row; r < std::min(2 * row + 2, below.rows); ++r)
            for (int c = 2 * column; c < std::min(2 * column + 2, below.columns); ++c)
              add(boxes_[below.first + r * below.columns + c], all);
        }
    }
}

/// Squares that follow each other in a row, their numbers as well.
void LatticeCrossings::measure_squares(const LatticeMesh& lattice, int first) {
  SquareVertices square;
  view(lattice, nodes_[first], square);
  Ranges<kColumnsAtOnce> ranges;
  for (auto& lanes : ranges.least) lanes.fill(kInfinity);
  for (auto& lanes : ranges.greatest) lanes.fill(-kInfinity);
  for (int row = 0; row < square.rows; ++row) {
    const int at = row * texture_width_;
    add_quads({square.axes[0] + at, square.axes[1] + at, square.axes[2] + at}, square.diagonals[row], texture_width_,
              ranges);
  }
  for (int i = 0; i < kSquaresAtOnce; ++i) {
    Box& around = boxes_[first + i];
    Normals& normals = normals_[first + i];
    around = no_box<Box>(), normals = no_normals<Normals>();
    for (int axis = 0; axis < kAxes; ++axis) {
      Box& box = axis < 3 ? around : axis < 6 ? normals.box : normals.diagonals;
      const int lane = axis < 6 ? axis % 3 : axis - 6;
      box.least[lane] = least_of(Eigen::Map<const Four>(ranges.least[axis].data() + kSide * i));
      box.greatest[lane] = greatest_of(Eigen::Map<const Four>(ranges.greatest[axis].data() + kSide * i));
    }
    widen(margin_, around);
  }
}

/// The boxes alone.
void LatticeCrossings::box_squares(const LatticeMesh& lattice, int first) {
  SquareVertices square;
  view(lattice, nodes_[first], square);
  for (int axis = 0; axis < 3; ++axis) {
    VertexRange range;
    find_range(square.axes[axis], texture_width_, square.rows + 1, range);
    for (int i = 0; i < kSquaresAtOnce; ++i) {
      const float *least = range.least.data() + kSide * i, *greatest = range.greatest.data() + kSide * i;
      Box& box = boxes_[first + i];
      box.least[axis] = std::min(least_of(Eigen::Map<const Four>(least)), least[kSide]) - margin_;
      box.greatest[axis] = std::max(greatest_of(Eigen::Map<const Four>(greatest)), greatest[kSide]) + margin_;
    }
  }
}

/// Whether these are squares that follow each other in a row, away from where columns wrap round.
bool LatticeCrossings::are_together(std::span<const int> leaves) const {
  if (leaves.size() < kSquaresAtOnce || leaves[kSquaresAtOnce - 1] != leaves[0] + kSquaresAtOnce - 1) return false;
  const Node &first = nodes_[leaves[0]], &last = nodes_[leaves[kSquaresAtOnce - 1]];
  return grids_[first.grid].end < 0 && first.grid == last.grid && first.row == last.row &&
         kSide * first.column + kColumnsAtOnce < rectangles_[grids_[first.grid].patch].width;
}

/// Boxes of some leaves and their normals, those of squares only if asked for. (Squares by themselves have them all the
/// same.)
void LatticeCrossings::measure_leaves(const LatticeMesh& lattice, std::span<const int> leaves, bool has_normals) {
  for_each_block(leaves.size(), kAtOnce, [&](std::size_t, std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end;) {
      const bool are_several = are_together(leaves.subspan(i, end - i));
      if (!are_several)
        measure_leaf(lattice, leaves[i]);
      else if (has_normals)
        measure_squares(lattice, leaves[i]);
      else
        box_squares(lattice, leaves[i]);
      i += are_several ? kSquaresAtOnce : 1;
    }
  });
}

LatticeCrossings::Asked LatticeCrossings::ask(const LatticeMesh& lattice, std::span<const int> triangles) const {
  Asked asked;
  asked.nodes.assign(nodes_.size(), 0);
  for (const int number : triangles) {
    const int leaf = leaf_of(lattice, number);
    int& box_number = asked.nodes[leaf];
    if (box_number == 0) {
      asked.leaves.push_back(leaf), asked.boxes.push_back(no_box<Box>());
      box_number = static_cast<int>(asked.boxes.size());
    }
    for (const int vertex : lattice.triangle(number)) add(lattice.point(vertex), asked.boxes[box_number - 1]);
  }
  for (Box& box : asked.boxes) widen(margin_, box);
  std::sort(asked.leaves.begin(), asked.leaves.end());
  for (const int leaf : asked.leaves) {
    const Node& node = nodes_[leaf];
    const Grid& grid = grids_[node.grid];
    const Box box = asked.box(leaf);
    for (int level = 1; level < static_cast<int>(grid.levels.size()); ++level) {
      int& box_number = asked.nodes[node_at(grid, level, node.row >> level, node.column >> level)];
      if (box_number == 0) asked.boxes.push_back(no_box<Box>()), box_number = static_cast<int>(asked.boxes.size());
      add(box, asked.boxes[box_number - 1]);
    }
  }
  return asked;
}

/// Whether triangles of two leaves can, or of one: not where the lattice around them bends little, but for slivers of
/// strips.
bool LatticeCrossings::can_meet(int a, int b) const {
  const Node &one = nodes_[a], &other = nodes_[b];
  const Grid &first = grids_[one.grid], &second = grids_[other.grid];
  const bool are_squares = first.end < 0 && second.end < 0;
  if (!are_squares && !first.is_fan && !second.is_fan) {
    const auto has_sliver = [&](int node, const Grid& grid) {
      return grid.end >= 0 && ends_[node - first_of_ends()].has_sliver;
    };
    if (has_sliver(a, first) || has_sliver(b, second)) return true;
  }
  if (a == b) return !is_narrow(normals_[a]);
  if (one.grid == other.grid) return !is_smooth_within(one, other);
  if (are_squares) return true;
  if (first.end >= 0 && second.end >= 0) return !is_smooth_over_seam(a, b);
  if (first.patch != second.patch) return true;
  const auto& [strip, square] = first.end >= 0 ? std::pair(one, other) : std::pair(other, one);
  return !is_smooth_at_end(strip, square);
}

/// Two leaves of one grid.
bool LatticeCrossings::is_smooth_within(const Node& a, const Node& b) const {
  const Grid& grid = grids_[a.grid];
  const int columns = grid.levels[0].columns;
  if (std::abs(a.row - b.row) > kNear) return false;
  const auto [first, steps] = between(a.column, b.column, columns);
  if (steps > kNear) return false;
  Normals normals = no_normals<Normals>();
  for (int row = std::min(a.row, b.row); row <= std::max(a.row, b.row); ++row)
    for (int step = 0; step <= steps; ++step) add(normals_[node_at(grid, 0, row, (first + step) % columns)], normals);
  return is_narrow(normals);
}

/// A leaf of a strip or fan and a square of the patch: all squares up to that, and what of the end lies at them.
bool LatticeCrossings::is_smooth_at_end(const Node& end, const Node& square) const {
  const Grid &strip = grids_[end.grid], &quads = grids_[square.grid];
  const auto [first_square, columns, rows] = quads.levels[0];
  const int row = strip.end == 0 ? square.row : rows - 1 - square.row;
  if (row > 1) return false;
  const int width = rectangles_[strip.patch].width, pieces = strip.levels[0].columns;
  const auto leaf_at = [&](int column) -> const EndLeaf& {
    return ends_[node_at(strip, 0, 0, (column % pieces + pieces) % pieces) - first_of_ends()];
  };
  // In columns from the strip's first one on.
  const int origin = leaf_at(end.column).first_column, own = leaf_at(end.column).last_column - origin;
  int first = ((kSide * square.column - origin) % width + width) % width;
  if (2 * first > width) first -= width;
  const int last = std::max(own, first + kSide), reach = 3 * kSide;
  first = std::min(0, first);
  if (last - first > reach || 2 * reach > width) return false;
  Normals normals = normals_[node_at(strip, 0, 0, end.column)];
  for (int column = first, at; column < last; column += kSide - at % kSide) {
    at = ((origin + column) % width + width) % width;
    for (int r = 0; r <= row; ++r)
      add(normals_[node_at(quads, 0, strip.end == 0 ? r : rows - 1 - r, at / kSide)], normals);
  }
  // On both sides of the leaf.
  const auto step_between = [&](int from, int to) { return ((to - from) % width + width) % width; };
  for (int piece = end.column, at = own; at < last; ++piece) {
    const int step = step_between(leaf_at(piece).last_column, leaf_at(piece + 1).last_column);
    if (piece - end.column > 3) return false;
    add(normals_[node_at(strip, 0, 0, (piece + 1) % pieces)], normals);
    at += step;
  }
  for (int piece = end.column, at = 0; at > first; --piece) {
    const int step = step_between(leaf_at(piece - 1).first_column, leaf_at(piece).first_column);
    if (end.column - piece > 3) return false;
    add(normals_[node_at(strip, 0, 0, ((piece - 1) % pieces + pieces) % pieces)], normals);
    at -= step;
  }
  return is_narrow(normals);
}

/// Two leaves of strips on both sides of a seam.
bool LatticeCrossings::is_smooth_over_seam(int a, int b) const {
  const auto do_share_side = [&](int one, int other) {
    const EndLeaf &first = ends_[one - first_of_ends()], &second = ends_[other - first_of_ends()];
    return std::min(first.last_sample, second.last_sample) > std::max(first.first_sample, second.first_sample);
  };
  Normals normals = normals_[a];
  add(normals_[b], normals);
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
      add(normals_[beside], all);
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
  // Four columns at a time; those of none are 0.
  constexpr int kMost = kNearQuads + 1, kAcross = (kMost + kSide - 1) / kSide * kSide;
  const int columns = std::min(steps + 1, r.width);
  using Row = std::array<std::array<float, kAcross + 1>, 3>;
  Row own, above;
  const auto load = [&](int i, Row& points) {
    for (int axis = 0; axis < 3; ++axis) {
      points[axis].fill(0);
      for (int k = 0; k <= columns; ++k) points[axis][k] = lattice.planes()[axis][texel_of(patch, column + k, i)];
    }
  };
  load(row, above);
  std::array<std::array<Four, 3>, 2 * kMost * kAcross / kSide> normals;
  std::array<Four, kAcross / kSide> is_any;
  std::array<Four, 3> sums{Four::Zero(), Four::Zero(), Four::Zero()};
  int count = 0;
  for (int k = 0; k < kAcross; ++k) is_any[k / kSide][k % kSide] = k < columns ? 1.0f : 0.0f;
  for (int i = row; i < end; ++i) {
    own = above;
    load(i + 1, above);
    for (int first = 0; first < columns; first += kSide) {
      Four is_second;
      for (int k = 0; k < kSide; ++k)
        is_second[k] =
            first + k < columns && lattice.takes_second(texel_of(patch, column + first + k, i)) ? 1.0f : 0.0f;
      Four u[2][3], v[2][3];
      for (int axis = 0; axis < 3; ++axis) {
        const Eigen::Map<const Four> a(own[axis].data() + first), b(own[axis].data() + first + 1),
            c(above[axis].data() + first), d(above[axis].data() + first + 1);
        u[0][axis] = b - a, v[0][axis] = either(is_second, c, d) - a;
        u[1][axis] = d - either(is_second, c, a), v[1][axis] = c - either(is_second, b, a);
      }
      for (int side = 0; side < 2; ++side, ++count) {
        normals[count] = unit_normals(u[side], v[side]);
        for (int axis = 0; axis < 3; ++axis) sums[axis] += normals[count][axis] *= is_any[first / kSide];
      }
    }
  }
  const float x = sums[0].sum(), y = sums[1].sum(), z = sums[2].sum();
  Four least = Four::Constant(kInfinity);
  for (int k = 0, chunks = (columns + kSide - 1) / kSide; k < count; ++k) {
    const Four none = 1 - is_any[k / 2 % chunks];
    least =
        least.min(x * normals[k][0] + y * normals[k][1] + z * normals[k][2] + std::numeric_limits<float>::max() * none);
  }
  return least_of(least) > kLeastCosine * std::sqrt(x * x + y * y + z * z);
}

/// Where there are fewer the last row counts again.
void LatticeCrossings::copy_quads(const Node& node, const SquareVertices& square, QuadBlock& quads) const {
  const int patch = grids_[node.grid].patch, column = kSide * node.column;
  quads.row_step = texture_width_;
  for (int row = 0; row < kSide; ++row) {
    const int own_row = std::min(row, square.rows - 1), first = kSide * row;
    const int texel = texel_of(patch, column, kSide * node.row + own_row);
    for (int axis = 0; axis < 3; ++axis) {
      const float* at = square.axes[axis] + own_row * square.stride;
      for (const int vertex : {0, 1, 2, 3})
        std::copy_n(at + vertex % 2 + vertex / 2 * square.stride, kSide, quads.points[axis][vertex].begin() + first);
    }
    std::copy_n(square.diagonals[own_row], kSide, quads.take_second.begin() + first);
    for (int k = 0; k < kSide; ++k) quads.own[first + k] = texel + k, quads.right[first + k] = texel + k + 1;
    if (column + square.columns == rectangles_[patch].width) quads.right[first + square.columns - 1] = texel - column;
  }
}

const TriangleBlock& LatticeCrossings::boxes_of(const LatticeMesh& lattice, int number, const Asked* asked,
                                                Leaf& leaf) const {
  TriangleBlock& block = leaf.triangles;
  if (leaf.node == number) return block;
  leaf.node = number, leaf.has_planes = false;
  const Node& node = nodes_[number];
  block.is_asked.fill(1);
  if (grids_[node.grid].end < 0) {
    SquareVertices square;
    view(lattice, node, square);
    QuadBlock& quads = leaf.quads;
    copy_quads(node, square, quads);
    fill_boxes(quads, margin_, block);
    for (int i = 0; i < TriangleBlock::kSize; ++i) {
      const int quad = i % QuadBlock::kSize;
      block.numbers[i] = 2 * quads.own[quad] + i / QuadBlock::kSize;
      if (quad % kSide < square.columns && quad / kSide < square.rows) continue;
      for (int axis = 0; axis < 3; ++axis) block.least[axis][i] = kInfinity, block.greatest[axis][i] = -kInfinity;
    }
  } else {
    for (auto& plane : block.least) plane.fill(kInfinity);
    for (auto& plane : block.greatest) plane.fill(-kInfinity);
    const auto [begin, end] = triangles_of_end(node);
    for (int i = 0; i < end - begin; ++i) {
      block.numbers[i] = begin + i;
      Box box = no_box<Box>();
      for (const int vertex : lattice.triangle(begin + i)) add(lattice.point(vertex), box);
      widen(margin_, box);
      for (int axis = 0; axis < 3; ++axis)
        block.least[axis][i] = box.least[axis], block.greatest[axis][i] = box.greatest[axis];
    }
  }
  if (asked)
    for (int i = 0; i < TriangleBlock::kSize; ++i)
      if (block.least[0][i] <= block.greatest[0][i]) block.is_asked[i] = is_asked_[block.numbers[i]];
  return block;
}

void LatticeCrossings::find_planes_of(const LatticeMesh& lattice, Leaf& leaf) const {
  if (std::exchange(leaf.has_planes, true)) return;
  TriangleBlock& block = leaf.triangles;
  const Node& node = nodes_[leaf.node];
  if (grids_[node.grid].end < 0) {
    fill_corners(leaf.quads, lattice.model().origin, block);
  } else {
    const auto [begin, end] = triangles_of_end(node);
    for (int i = 0; i < end - begin; ++i) {
      const Triangle triangle = lattice.triangle(begin + i);
      for (int corner = 0; corner < 3; ++corner) {
        const Vec3 position = lattice.position(triangle[corner]);
        block.vertices[corner][i] = triangle[corner];
        for (int axis = 0; axis < 3; ++axis) block.corners[corner][axis][i] = position[axis];
      }
    }
  }
  find_planes(kRounding * extent_, block);
}

/// Triangles of two leaves, or of one.
void LatticeCrossings::find_between(const LatticeMesh& lattice, int a, int b, const Box& around_b, const Asked* asked,
                                    const Leaves& leaves, std::vector<std::array<int, 2>>& pairs) const {
  const std::size_t place_a = a % kLeaves, place_b = a != b && b % kLeaves == place_a ? kLeaves : b % kLeaves;
  const TriangleBlock &one = boxes_of(lattice, a, asked, leaves[place_a]),
                      &other = boxes_of(lattice, b, asked, leaves[place_b]);
  BlockOverlaps overlaps;
  const auto block_box = [](const Box& box) {
    return BlockBox{{box.least[0], box.least[1], box.least[2]}, {box.greatest[0], box.greatest[1], box.greatest[2]}};
  };
  find_overlaps(one, other, block_box(around_b),
                block_box(!asked          ? around_b
                          : asked->has(b) ? asked->box(b)
                                          : no_box<Box>()),
                overlaps);
  if (overlaps.group_count == 0) return;
  find_planes_of(lattice, leaves[place_a]), find_planes_of(lattice, leaves[place_b]);
  BlockPairs unsettled;
  const int count = find_unsettled(one, other, overlaps, unsettled);
  const bool is_of_one_patch = nodes_[a].grid == nodes_[b].grid && grids_[nodes_[a].grid].end < 0;
  for (int i = 0; i < count; ++i) {
    const auto [k, l] = unsettled[i];
    const int s = one.numbers[k], t = other.numbers[l];
    if (!do_triangles_intersect(one.triangle(k), one.corners_of(k), other.triangle(l), other.corners_of(l))) continue;
    if (is_of_one_patch && are_quads_smooth(lattice, grids_[nodes_[a].grid].patch, s, t)) continue;
    pairs.push_back({std::min(s, t), std::max(s, t)});
  }
}

/// None of them known. (For overwrite: what is not known yet need not be cleared.)
LatticeCrossings::Leaves LatticeCrossings::fresh_leaves() {
  return std::make_unique_for_overwrite<Leaf[]>(kLeaves + 1);
}

/// Squares whose normals tell whether triangles asked for can meet others near them.
std::vector<int> LatticeCrossings::squares_near(const Asked& asked) const {
  std::vector<char> are_near(first_of_ends(), 0);
  for (const int leaf : asked.leaves) {
    const Node& node = nodes_[leaf];
    const Grid &own = grids_[node.grid], &quads = grids_[own.patch];
    const auto [first, columns, rows] = quads.levels[0];
    const bool is_end = own.end >= 0;
    const int row = !is_end ? node.row : own.end == 0 ? 0 : rows - 1;
    const int begin = is_end ? ends_[leaf - first_of_ends()].first_column / kSide : node.column;
    const int end = is_end ? ends_[leaf - first_of_ends()].last_column / kSide : node.column;
    const int reach = row <= 1 || row >= rows - 2 ? kNearAtEnds : kNear;
    for (int r = std::max(0, row - kNear); r <= std::min(rows - 1, row + kNear); ++r)
      for (int c = begin - reach; c <= end + reach; ++c)
        are_near[first + r * columns + (c % columns + columns) % columns] = 1;
  }
  std::vector<int> squares;
  for (int square = 0; square < first_of_ends(); ++square)
    if (are_near[square] != 0) squares.push_back(square);
  return squares;
}

/// Of either of two nodes to the other.
bool LatticeCrossings::do_asked_lie_at(const Asked& asked, const Task& task) const {
  const auto [a, b] = task;
  return (asked.has(a) && do_overlap(asked.box(a), boxes_[b])) || (asked.has(b) && do_overlap(boxes_[a], asked.box(b)));
}

/// What is to be asked in place of a pair of nodes, or a node by itself. \return whether they are leaves that can meet
bool LatticeCrossings::split(const Asked& asked, const Task& task, std::vector<Task>& tasks) const {
  const auto [a, b] = task;
  if (!do_asked_lie_at(asked, task)) return false;
  const Node &one = nodes_[a], &other = nodes_[b];
  if (one.level == 0 && other.level == 0) return can_meet(a, b);
  const auto parts_of = [&](const Node& node, std::array<int, 4>& parts) {
    const Grid& grid = grids_[node.grid];
    const Grid::Level& below = grid.levels[node.level - 1];
    int count = 0;
    for (int row = 2 * node.row; row < std::min(2 * node.row + 2, below.rows); ++row)
      for (int column = 2 * node.column; column < std::min(2 * node.column + 2, below.columns); ++column)
        parts[count++] = node_at(grid, node.level - 1, row, column);
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
  const int count = one.level >= other.level ? parts_of(one, parts) : 1,
            other_count = other.level >= one.level ? parts_of(other, others) : 1;
  for (int i = 0; i < count; ++i)
    for (int j = 0; j < other_count; ++j) tasks.push_back({parts[i], others[j]});
  return false;
}

void LatticeCrossings::measure(const LatticeMesh& lattice) {
  const Four wide{1, 1, 1, 0}, wide_diagonals = Four::Constant(std::numbers::sqrt3_v<float>);
  boxes_.resize(nodes_.size()), ends_.resize(nodes_.size() - first_of_ends());
  normals_.assign(nodes_.size(), {{-wide, wide}, {-wide_diagonals, wide_diagonals}});
  measure_leaves(lattice, leaves_, false);
  join(nullptr);
}

void LatticeCrossings::measure(const LatticeMesh& lattice, std::span<const int> changed) {
  const Asked asked = ask(lattice, changed);
  measure_leaves(lattice, asked.leaves, true);
  join(&asked);
}

std::vector<std::array<int, 2>> LatticeCrossings::find(const LatticeMesh& lattice, std::span<const int> triangles) {
  if (triangles.empty()) return {};
  const Asked asked = ask(lattice, triangles);
  is_asked_.resize(lattice.triangle_count(), 0);
  for (const int triangle : triangles) is_asked_[triangle] = 1;
  measure_leaves(lattice, squares_near(asked), true);
  // Large nodes first, so that there are tasks for all processors.
  std::vector<Task> large, tasks;
  for (std::size_t i = 0; i < grids_.size(); ++i)
    for (std::size_t j = i; j < grids_.size(); ++j)
      large.push_back({grids_[i].levels.back().first, grids_[j].levels.back().first});
  while (!large.empty()) {
    const Task task = large.back();
    large.pop_back();
    if (std::max(nodes_[task[0]].level, nodes_[task[1]].level) > kTaskLevel)
      split(asked, task, large);
    else if (do_asked_lie_at(asked, task))
      tasks.push_back(task);
  }
  std::vector<std::vector<std::array<int, 2>>> found(block_count(tasks.size(), kTasks));
  for_each_block(tasks.size(), kTasks, [&](std::size_t block, std::size_t begin, std::size_t end) {
    const Leaves leaves = fresh_leaves();
    std::vector<Task> stack(tasks.begin() + static_cast<std::ptrdiff_t>(begin),
                            tasks.begin() + static_cast<std::ptrdiff_t>(end));
    while (!stack.empty()) {
      const Task task = stack.back();
      stack.pop_back();
      if (split(asked, task, stack))
        find_between(lattice, task[0], task[1], boxes_[task[1]], &asked, leaves, found[block]);
    }
  });
  for (const int triangle : triangles) is_asked_[triangle] = 0;
  std::vector<std::array<int, 2>> pairs;
  for (const auto& some : found) pairs.insert(pairs.end(), some.begin(), some.end());
  std::sort(pairs.begin(), pairs.end());
  return pairs;
}

LatticeCrossings::Others LatticeCrossings::find_between_same(std::span<const std::array<int, 2>> pairs,
                                                             LatticeMesh& other, int share) const {
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
  std::vector<int> quads, ends;
  for (std::size_t i = 0; i < count; ++i) {
    for (const int leaf : given[first[i]].leaves)
      if (const Grid& grid = grids_[nodes_[leaf].grid]; grid.end >= 0)
        ends.push_back(2 * grid.patch + grid.end);
      else if (is_whole(i))
        append_quads(nodes_[leaf], quads);
    for (std::size_t k = first[i]; k < first[i + 1] && !is_whole(i); ++k)
      for (const int triangle : given[k].pair)
        if (triangle < other.first_end_triangle()) quads.push_back(triangle / 2);
  }
  for (std::vector<int>* each : {&quads, &ends}) {
    std::sort(each->begin(), each->end());
    each->erase(std::unique(each->begin(), each->end()), each->end());
  }
  other.choose(quads);
  other.fill_ends(ends);
  for_each_block(count, kAtOnce, [&](std::size_t, std::size_t begin, std::size_t end) {
    const Leaves leaves = fresh_leaves();
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
