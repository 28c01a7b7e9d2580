// SPDX-License-Identifier: MIT
#include "skeletex/skeletonize/body/voxel_body.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numeric>
#include <span>

#include "skeletex/geometry/parallel.h"
#include "skeletex/geometry/union_find.h"

namespace skeletex {
namespace {

constexpr double kMostColumns = 1500;  // along x or y
constexpr std::size_t kBlock = 1024;

/// Columns of voxels along z over the box of a mesh.
struct Columns {
  Vec3 origin = Vec3::Zero();  // centre of voxel 0, 0, 0
  double side = 0;
  int x_count = 0, y_count = 0, z_count = 0;
  int index(int x, int y) const { return x * y_count + y; }
  int size() const { return x_count * y_count; }
};

/// Voxels of a column from first to last.
struct Run {
  int column = 0, first = 0, last = 0;
};

/// Runs in the order of their columns and of z.
struct Runs {
  std::vector<Run> runs;
  std::vector<int> begin;  // per column, and the end
};

/// Where the line through a column's centres meets a triangle.
struct ColumnHit {
  int column = 0;
  double z = 0;
  int sign = 0;  // of the winding number, for what is below
};

Columns columns_of(const TriangleMesh& mesh, int count) {
  const BoundingBox box = bounding_box(mesh);
  const Vec3 extent = box.upper - box.lower;
  Columns columns;
  columns.side =
      std::max(std::cbrt(std::max(0.0, signed_volume(mesh)) / count), std::max(extent.x(), extent.y()) / kMostColumns);
  const auto cells = [&](int d) { return static_cast<int>(extent[d] / columns.side) + 1; };
  columns.x_count = cells(0), columns.y_count = cells(1), columns.z_count = cells(2);
  for (int d = 0; d < 3; ++d)
    columns.origin[d] = 0.5 * (box.lower[d] + box.upper[d]) - 0.5 * (cells(d) - 1) * columns.side;
  return columns;
}

/// x where an edge meets the line of a given y. Seen from the lower vertex, so that both triangles at the edge agree.
double edge_x(const TriangleMesh& mesh, int i, int j, double y) {
  if (i > j) std::swap(i, j);
  const Vec3 &p = mesh.positions[i], &q = mesh.positions[j];
  return p.x() + (y - p.y()) / (q.y() - p.y()) * (q.x() - p.x());
}

void hit_columns(const TriangleMesh& mesh, const Triangle& triangle, const Columns& columns,
                 std::vector<ColumnHit>& hits) {
  const Vec3 &p = mesh.positions[triangle[0]], &q = mesh.positions[triangle[1]], &r = mesh.positions[triangle[2]];
  const Vec3 normal = (q - p).cross(r - p);
  if (normal.z() == 0) return;
  const auto cell = [&](double value, int d) { return (value - columns.origin[d]) / columns.side; };
  const int first = std::max(0, static_cast<int>(std::floor(cell(std::min({p.y(), q.y(), r.y()}), 1)))),
            last = std::min(columns.y_count - 1, static_cast<int>(std::ceil(cell(std::max({p.y(), q.y(), r.y()}), 1))));
  for (int row = first; row <= last; ++row) {
    const double y = columns.origin.y() + row * columns.side;
    const auto is_above = [&](int v) { return mesh.positions[v].y() >= y; };
    std::array<double, 2> x{};
    int found = 0;
    for (int e = 0; e < 3; ++e) {
      const int i = triangle[e], j = triangle[(e + 1) % 3];
      if (is_above(i) != is_above(j) && found < 2) x[found++] = edge_x(mesh, i, j, y);
    }
    if (found < 2) continue;
    if (x[0] > x[1]) std::swap(x[0], x[1]);
    for (int c = std::max(0, static_cast<int>(std::floor(cell(x[0], 0)))); c < columns.x_count; ++c) {
      const double at = columns.origin.x() + c * columns.side;
      if (at >= x[1]) break;
      if (at < x[0]) continue;
      const double z = p.z() - ((at - p.x()) * normal.x() + (y - p.y()) * normal.y()) / normal.z();
      hits.push_back({columns.index(c, row), z, normal.z() > 0 ? 1 : -1});
    }
  }
}

/// Appends the voxels of a column from `entered` to `left`; runs that touch are one.
/// \param begin  the column's first run
void append_run(const Columns& columns, int column, int begin, double entered, double left, std::vector<Run>& runs) {
  const int first = std::max(0, static_cast<int>(std::ceil((entered - columns.origin.z()) / columns.side))),
            last =
                std::min(columns.z_count - 1, static_cast<int>(std::floor((left - columns.origin.z()) / columns.side)));
  if (first > last) return;
  if (static_cast<int>(runs.size()) > begin && runs.back().last >= first - 1)
    runs.back().last = std::max(runs.back().last, last);
  else
    runs.push_back({column, first, last});
}

/// The voxels whose centres the mesh winds around.
Runs inside_runs(const TriangleMesh& mesh, const Columns& columns) {
  std::vector<ColumnHit> hits;
  for (const Triangle& triangle : mesh.triangles) hit_columns(mesh, triangle, columns, hits);
  std::sort(hits.begin(), hits.end(), [](const ColumnHit& a, const ColumnHit& b) {
    return a.column != b.column ? a.column < b.column : a.z != b.z ? a.z < b.z : a.sign < b.sign;
  });
  Runs runs;
  std::size_t at = 0;
  for (int column = 0; column < columns.size(); ++column) {
    runs.begin.push_back(static_cast<int>(runs.runs.size()));
    int winding = 0;
    double entered = 0;
    for (; at < hits.size() && hits[at].column == column; ++at) {
      const int before = winding;
      winding -= hits[at].sign;  // a top face ends what is below it
      if (before <= 0 && winding > 0) entered = hits[at].z;
      if (before > 0 && winding <= 0) append_run(columns, column, runs.begin.back(), entered, hits[at].z, runs.runs);
    }
  }
  runs.begin.push_back(static_cast<int>(runs.runs.size()));
  return runs;
}

/// Joins runs of neighbouring columns that are nearer along z than `gap`.
void join_runs(const Runs& runs, const Columns& columns, int x, int y, std::array<int, 2> step, int gap,
               UnionFind& sets) {
  const int nx = x + step[0], ny = y + step[1];
  if (nx < 0 || ny < 0 || nx >= columns.x_count || ny >= columns.y_count) return;
  int i = runs.begin[columns.index(x, y)], j = runs.begin[columns.index(nx, ny)];
  const int i_end = runs.begin[columns.index(x, y) + 1], j_end = runs.begin[columns.index(nx, ny) + 1];
  while (i < i_end && j < j_end) {
    if (runs.runs[i].first <= runs.runs[j].last + gap && runs.runs[j].first <= runs.runs[i].last + gap)
      sets.unite(i, j);
    (runs.runs[i].last < runs.runs[j].last ? i : j)++;
  }
}

/// The set of each run;
/// \param steps neighbouring columns.
std::vector<int> sets_of(const Runs& runs, const Columns& columns, std::span<const std::array<int, 2>> steps, int gap) {
  UnionFind sets(static_cast<int>(runs.runs.size()));
  for (int x = 0; x < columns.x_count; ++x)
    for (int y = 0; y < columns.y_count; ++y)
      for (const auto& step : steps) join_runs(runs, columns, x, y, step, gap, sets);
  std::vector<int> set(runs.runs.size());
  for (std::size_t r = 0; r < set.size(); ++r) set[r] = sets.find(static_cast<int>(r));
  return set;
}

/// Keeps the largest 26-connected piece.
/// \return its share of all voxels
double keep_largest(const Columns& columns, Runs& runs) {
  constexpr std::array<std::array<int, 2>, 4> kSteps{{{1, 0}, {0, 1}, {1, 1}, {1, -1}}};
  const std::vector<int> set = sets_of(runs, columns, kSteps, 1);
  std::vector<long> voxels(runs.runs.size(), 0);
  long total = 0;
  for (std::size_t r = 0; r < set.size(); ++r) {
    const long length = runs.runs[r].last - runs.runs[r].first + 1;
    voxels[set[r]] += length;
    total += length;
  }
  if (total == 0) return 0;
  const int largest = static_cast<int>(std::max_element(voxels.begin(), voxels.end()) - voxels.begin());
  Runs kept;
  for (int column = 0; column < columns.size(); ++column) {
    kept.begin.push_back(static_cast<int>(kept.runs.size()));
    for (int r = runs.begin[column]; r < runs.begin[column + 1]; ++r)
      if (set[r] == largest) kept.runs.push_back(runs.runs[r]);
  }
  kept.begin.push_back(static_cast<int>(kept.runs.size()));
  runs = std::move(kept);
  return static_cast<double>(voxels[largest]) / static_cast<double>(total);
}

/// Fills what the outside does not reach over faces of voxels.
void fill_cavities(const Columns& columns, Runs& runs) {
  Runs gaps;
  for (int column = 0; column < columns.size(); ++column) {
    gaps.begin.push_back(static_cast<int>(gaps.runs.size()));
    int first = -1;
    for (int r = runs.begin[column]; r < runs.begin[column + 1]; ++r) {
      gaps.runs.push_back({column, first, runs.runs[r].first - 1});
      first = runs.runs[r].last + 1;
    }
    gaps.runs.push_back({column, first, columns.z_count});
  }
  gaps.begin.push_back(static_cast<int>(gaps.runs.size()));
  constexpr std::array<std::array<int, 2>, 2> kSteps{{{1, 0}, {0, 1}}};
  const std::vector<int> set = sets_of(gaps, columns, kSteps, 0);
  // Columns at the rim may be full from side to side, but each has a gap below the box and one above it.
  std::vector<char> is_outside(gaps.runs.size(), 0);
  for (int column = 0; column < columns.size(); ++column)
    is_outside[set[gaps.begin[column]]] = is_outside[set[gaps.begin[column + 1] - 1]] = 1;
  const auto is_rim = [&](int column) {
    const int x = column / columns.y_count, y = column % columns.y_count;
    return x == 0 || y == 0 || x == columns.x_count - 1 || y == columns.y_count - 1;
  };
  for (std::size_t g = 0; g < set.size(); ++g)
    if (is_rim(gaps.runs[g].column)) is_outside[set[g]] = 1;
  Runs filled;
  for (int column = 0; column < columns.size(); ++column) {
    filled.begin.push_back(static_cast<int>(filled.runs.size()));
    for (int r = runs.begin[column]; r < runs.begin[column + 1]; ++r) {
      const int gap = gaps.begin[column] + (r - runs.begin[column]);  // the one before this run
      if (static_cast<int>(filled.runs.size()) > filled.begin.back() && !is_outside[set[gap]])
        filled.runs.back().last = runs.runs[r].last;
      else
        filled.runs.push_back(runs.runs[r]);
    }
  }
  filled.begin.push_back(static_cast<int>(filled.runs.size()));
  runs = std::move(filled);
}

/// Numbers the voxels of runs and links them.
void link_voxels(const Columns& columns, const Runs& runs, VoxelBody& body) {
  std::vector<int> number(runs.runs.size() + 1, 0);  // of each run's first voxel
  for (std::size_t r = 0; r < runs.runs.size(); ++r)
    number[r + 1] = number[r] + runs.runs[r].last - runs.runs[r].first + 1;
  body.side = columns.side;
  body.centres.resize(number.back());
  body.neighbours.resize(number.back());
  const auto find = [&](int x, int y, int z) {
    if (x < 0 || y < 0 || x >= columns.x_count || y >= columns.y_count) return -1;
    const int column = columns.index(x, y);
    const auto begin = runs.runs.begin() + runs.begin[column], end = runs.runs.begin() + runs.begin[column + 1];
    const auto run = std::lower_bound(begin, end, z, [](const Run& a, int value) { return a.last < value; });
    if (run == end || run->first > z) return -1;
    return number[run - runs.runs.begin()] + z - run->first;
  };
  for_each_index(runs.runs.size(), kBlock, [&](std::size_t r) {
    for (int z = runs.runs[r].first; z <= runs.runs[r].last; ++z) {
      const int voxel = number[r] + z - runs.runs[r].first;
      const int x = runs.runs[r].column / columns.y_count, y = runs.runs[r].column % columns.y_count;
      body.centres[voxel] = columns.origin + columns.side * Vec3(x, y, z);
      for (int place = 0; place < kVoxelPlaces; ++place)
        body.neighbours[voxel][place] = find(x + place / 9 - 1, y + place / 3 % 3 - 1, z + place % 3 - 1);
    }
  });
}

/// Per voxel, bit p: the way to the neighbour at place p meets the surface.
std::vector<unsigned> find_crossed_links(const Surface& surface, const VoxelBody& body) {
  std::vector<unsigned> crossed(body.size(), 0);
  for_each_index(crossed.size(), kBlock, [&](std::size_t v) {
    if (!surface.is_near(body.centres[v], std::sqrt(3.0) * body.side)) return;
    for (int place = kOwnPlace + 1; place < kVoxelPlaces; ++place)
      if (const int other = body.neighbours[v][place];
          other >= 0 && surface.is_between(body.centres[v], body.centres[other]))
        crossed[v] |= 1u << place;
  });
  for (int v = 0; v < body.size(); ++v)
    for (int place = kOwnPlace + 1; place < kVoxelPlaces; ++place)
      if (crossed[v] >> place & 1) crossed[body.neighbours[v][place]] |= 1u << (kVoxelPlaces - 1 - place);
  return crossed;
}

/// Whether a third voxel is a neighbour of both on the same side of the surface.
bool has_clean_detour(const VoxelBody& body, const std::vector<unsigned>& crossed, const std::vector<char>& is_out,
                      int v, int other) {
  for (int third = 0; third < kVoxelPlaces; ++third) {
    const int w = body.neighbours[v][third];
    if (w < 0 || w == v || w == other || is_out[w] || (crossed[v] >> third & 1)) continue;
    for (int back = 0; back < kVoxelPlaces; ++back)
      if (body.neighbours[w][back] == other && !(crossed[w] >> back & 1)) return true;
  }
  return false;
}

/// Voxels to leave out so that no two are neighbours across the surface.
std::vector<char> find_false_links(const Surface& surface, const VoxelBody& body) {
  const std::vector<unsigned> crossed = find_crossed_links(surface, body);
  std::vector<char> is_out(body.size(), 0);
  for (int v = 0; v < body.size(); ++v) {
    for (int place = 0; place < kVoxelPlaces; ++place) {
      const int other = body.neighbours[v][place];
      if (!(crossed[v] >> place & 1) || other < v || is_out[v] || is_out[other]) continue;
      if (!has_clean_detour(body, crossed, is_out, v, other))
        is_out[surface.radius(body.centres[v]) <= surface.radius(body.centres[other]) ? v : other] = 1;
    }
  }
  return is_out;
}

/// The runs without some voxels.
Runs without(const Runs& runs, const Columns& columns, const std::vector<char>& is_out) {
  Runs left;
  std::size_t voxel = 0;
  for (int column = 0; column < columns.size(); ++column) {
    left.begin.push_back(static_cast<int>(left.runs.size()));
    for (int r = runs.begin[column]; r < runs.begin[column + 1]; ++r) {
      bool is_open = false;
      for (int z = runs.runs[r].first; z <= runs.runs[r].last; ++z, ++voxel) {
        if (is_out[voxel])
          is_open = false;
        else if (is_open)
          left.runs.back().last = z;
        else
          left.runs.push_back({column, z, z}), is_open = true;
      }
    }
  }
  left.begin.push_back(static_cast<int>(left.runs.size()));
  return left;
}

void measure_radii(const Surface& surface, VoxelBody& body) {
  body.radii.resize(body.centres.size());
  for_each_block(body.radii.size(), kBlock, [&](std::size_t, std::size_t begin, std::size_t end) {
    // A neighbour along z is a side away, so its distance bounds this one's.
    double bound = std::numeric_limits<double>::infinity();
    for (std::size_t v = begin; v < end; ++v) {
      const bool is_next = v > begin && (body.centres[v] - body.centres[v - 1]).norm() < 1.01 * body.side;
      body.radii[v] = find_nearest_triangle(surface.mesh, surface.tree, body.centres[v],
                                            is_next ? bound : std::numeric_limits<double>::infinity())
                          .distance;
      bound = 1.001 * (body.radii[v] + body.side);
    }
  });
}

}  // namespace

double place_distance(int place) {
  const int x = place / 9 - 1, y = place / 3 % 3 - 1, z = place % 3 - 1;
  return std::sqrt(static_cast<double>(x * x + y * y + z * z));
}

VoxelBody make_voxel_body(const Surface& surface, int count) {
  const Columns columns = columns_of(surface.mesh, count);
  VoxelBody body;
  Runs runs = inside_runs(surface.mesh, columns);
  body.kept = keep_largest(columns, runs);
  if (runs.runs.empty()) return body;
  fill_cavities(columns, runs);
  link_voxels(columns, runs, body);
  const std::vector<char> is_out = find_false_links(surface, body);
  if (std::find(is_out.begin(), is_out.end(), 1) != is_out.end()) {
    runs = without(runs, columns, is_out);
    body.kept *= keep_largest(columns, runs);
    fill_cavities(columns, runs);
    link_voxels(columns, runs, body);
  }
  measure_radii(surface, body);
  return body;
}

}  // namespace skeletex
