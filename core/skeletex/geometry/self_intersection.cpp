// SPDX-License-Identifier: MIT
#include "skeletex/geometry/self_intersection.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numeric>
#include <span>
#include <utility>

#include "skeletex/geometry/parallel.h"
#include "skeletex/geometry/predicates.h"

namespace skeletex {
namespace {

using Corners = std::array<Vec3, 3>;

Corners corners_of(const TriangleMesh& mesh, TriangleIndex triangle) {
  const Triangle& t = mesh.triangles[triangle];
  return {mesh.positions[t[0]], mesh.positions[t[1]], mesh.positions[t[2]]};
}

/// The plane of two coordinates in which a triangle is largest; -1 when it has no area in any.
int drawing_plane(const Corners& t) {
  const Vec3 normal = (t[1] - t[0]).cross(t[2] - t[0]);
  Eigen::Index axis;
  normal.cwiseAbs().maxCoeff(&axis);
  const auto drawn = [axis](const Vec3& p) { return Vec2(p[(axis + 1) % 3], p[(axis + 2) % 3]); };
  return orientation(drawn(t[0]), drawn(t[1]), drawn(t[2])) != 0 ? static_cast<int>(axis) : -1;
}

Vec2 drawn(const Vec3& p, int plane) { return {p[(plane + 1) % 3], p[(plane + 2) % 3]}; }

bool do_intervals_meet(double a, double b, double c, double d) {
  return std::max(std::min(a, b), std::min(c, d)) <= std::min(std::max(a, b), std::max(c, d));
}

bool do_segments_meet(const Vec2& a, const Vec2& b, const Vec2& c, const Vec2& d) {
  const int abc = orientation(a, b, c), abd = orientation(a, b, d), cda = orientation(c, d, a),
            cdb = orientation(c, d, b);
  if (abc * abd > 0 || cda * cdb > 0) return false;
  // All on one line, or touching: then the intervals decide.
  return do_intervals_meet(a.x(), b.x(), c.x(), d.x()) && do_intervals_meet(a.y(), b.y(), c.y(), d.y());
}

/// Whether a segment and a triangle, both projected along the axis of `plane`, meet.
bool does_drawn_segment_meet(const Vec3& p, const Vec3& q, const Corners& t, int plane) {
  const Vec2 a = drawn(t[0], plane), b = drawn(t[1], plane), c = drawn(t[2], plane), from = drawn(p, plane),
             to = drawn(q, plane);
  const int way = orientation(a, b, c);
  if (orientation(a, b, from) * way >= 0 && orientation(b, c, from) * way >= 0 && orientation(c, a, from) * way >= 0)
    return true;
  return do_segments_meet(from, to, a, b) || do_segments_meet(from, to, b, c) || do_segments_meet(from, to, c, a);
}

/// Whether the segment from p to q meets a triangle with area (drawn in `plane`).
bool does_segment_meet(const Vec3& p, const Vec3& q, const Corners& t, int plane) {
  const int side_p = orientation(t[0], t[1], t[2], p), side_q = orientation(t[0], t[1], t[2], q);
  if (side_p * side_q > 0) return false;
  if (side_p != 0 || side_q != 0) {
    const int ab = orientation(p, q, t[0], t[1]), bc = orientation(p, q, t[1], t[2]),
              ca = orientation(p, q, t[2], t[0]);
    if (!(ab >= 0 && bc >= 0 && ca >= 0) && !(ab <= 0 && bc <= 0 && ca <= 0)) return false;
  }
  // What meets in space meets here. Near one plane the volumes above can have the sign of rounding errors alone.
  return does_drawn_segment_meet(p, q, t, plane);
}

enum class Answer { kNo, kYes, kUnsure };

constexpr double kRounding = 1e-14;  // of products of differences: some ten times what their last digits add up to

/// The part of a line that lies in a triangle, by one coordinate.
struct LinePart {
  double low = 0, high = 0, error = 0;

  void add(double at) {
    low = is_empty ? at : std::min(low, at);
    high = is_empty ? at : std::max(high, at);
    is_empty = false;
  }
  bool is_empty = true;
};

/// Where a triangle meets the line of its plane and another one.
/// \param normal, origin  of the other plane
/// \param axis    the coordinate by which the line is measured
/// \param first           1 when the first vertex lies in the other plane, else 0
Answer cut_by_plane(const Corners& points, const Vec3& normal, const Vec3& origin, double extent, Eigen::Index axis,
                    int first, LinePart& part) {
  const double error = kRounding * extent * (extent * extent + normal.lpNorm<1>());
  std::array<double, 3> heights;
  int above = 0, below = 0;
  for (int k = first; k < 3; ++k) {
    heights[k] = normal.dot(points[k] - origin);
    above += heights[k] > error;
    below += heights[k] < -error;
  }
  if (above + below < 3 - first) return Answer::kUnsure;
  if (above == 0 || below == 0) return Answer::kNo;
  for (int k = first; k < 3 - first; ++k) {
    const int next = (k + 1) % 3;
    if ((heights[k] > 0) == (heights[next] > 0)) continue;
    const double span = std::abs(heights[k] - heights[next]);
    part.add(points[k][axis] + (points[next][axis] - points[k][axis]) * (std::abs(heights[k]) / span));
    part.error = std::max(part.error, extent * (8 * error / span + kRounding));
  }
  return Answer::kYes;
}

/// Where two triangles meet the line of both their planes (Moeller 1997), in plain double precision: unsure wherever
/// rounding could decide, or they are nearly in one plane, or have no area.
/// \param shared  whether their first vertex is one: then whether they meet elsewhere
Answer meet_on_line(const Corners& s, const Corners& t, bool shared) {
  constexpr double kLeastSine = 1e-6;
  Corners own, other;  // from the first vertex of s
  double extent = 0;
  for (int k = 0; k < 3; ++k) {
    own[k] = s[k] - s[0], other[k] = t[k] - s[0];
    extent = std::max({extent, own[k].lpNorm<Eigen::Infinity>(), other[k].lpNorm<Eigen::Infinity>()});
  }
  const Vec3 own_normal = own[1].cross(own[2]), other_normal = (other[1] - other[0]).cross(other[2] - other[0]);
  const Vec3 line = own_normal.cross(other_normal);
  Eigen::Index axis;
  const double along = line.cwiseAbs().maxCoeff(&axis);
  if (along <= kLeastSine * own_normal.lpNorm<1>() * other_normal.lpNorm<1>() || own_normal.isZero() ||
      other_normal.isZero())
    return Answer::kUnsure;
  LinePart first, second;
  const int begin = shared ? 1 : 0;
  if (const Answer answer = cut_by_plane(own, other_normal, other[0], extent, axis, begin, first);
      answer != Answer::kYes)
    return answer;
  if (const Answer answer = cut_by_plane(other, own_normal, Vec3::Zero(), extent, axis, begin, second);
      answer != Answer::kYes)
    return answer;
  const double error = first.error + second.error;
  if (shared) {
    // Both parts begin at the shared vertex: whether they lie on one side of it.
    if (std::abs(first.low) <= error || std::abs(second.low) <= error) return Answer::kUnsure;
    const double common = first.low * second.low;
    return common > 0 ? Answer::kYes : common < 0 ? Answer::kNo : Answer::kUnsure;
  }
  const double common = std::min(first.high, second.high) - std::max(first.low, second.low);
  return common > error ? Answer::kYes : common < -error ? Answer::kNo : Answer::kUnsure;
}

bool do_disjoint_triangles_meet(const Corners& s, const Corners& t) {
  if (const Answer answer = meet_on_line(s, t, false); answer != Answer::kUnsure) return answer == Answer::kYes;
  const auto is_off = [](const Corners& plane, const Corners& points) {
    const int side = orientation(plane[0], plane[1], plane[2], points[0]);
    return side != 0 && side == orientation(plane[0], plane[1], plane[2], points[1]) &&
           side == orientation(plane[0], plane[1], plane[2], points[2]);
  };
  if (is_off(s, t) || is_off(t, s)) return false;
  const int plane_s = drawing_plane(s), plane_t = drawing_plane(t);
  for (int k = 0; k < 3; ++k) {
    if (plane_t >= 0 && does_segment_meet(s[k], s[(k + 1) % 3], t, plane_t)) return true;
    if (plane_s >= 0 && does_segment_meet(t[k], t[(k + 1) % 3], s, plane_s)) return true;
  }
  return false;
}

/// Two triangles with their shared vertex first.
bool do_triangles_at_vertex_meet(const Corners& s, const Corners& t) {
  if (const Answer answer = meet_on_line(s, t, true); answer != Answer::kUnsure) return answer == Answer::kYes;
  // The rest of one on one side of the other's plane: for most pairs all that needs to be known.
  if (orientation(t[0], t[1], t[2], s[1]) * orientation(t[0], t[1], t[2], s[2]) > 0) return false;
  if (orientation(s[0], s[1], s[2], t[1]) * orientation(s[0], s[1], s[2], t[2]) > 0) return false;
  const int plane_s = drawing_plane(s), plane_t = drawing_plane(t);
  return (plane_t >= 0 && does_segment_meet(s[1], s[2], t, plane_t)) ||
         (plane_s >= 0 && does_segment_meet(t[1], t[2], s, plane_s));
}

/// Two triangles that share the edge from a to b.
bool do_triangles_at_edge_meet(const Vec3& a, const Vec3& b, const Vec3& c, const Vec3& d) {
  if (orientation(a, b, c, d) != 0) return false;
  const int plane = drawing_plane({a, b, c});
  if (plane < 0) return false;
  return orientation(drawn(a, plane), drawn(b, plane), drawn(c, plane)) *
             orientation(drawn(a, plane), drawn(b, plane), drawn(d, plane)) >
         0;
}

/// The corners of a mesh's triangles by vertex: those of vertex v, as 3 triangle + corner, are corners[begin[v]] to
/// corners[begin[v + 1] - 1].
struct VertexCorners {
  std::vector<int> begin, corners;
};

VertexCorners list_vertex_corners(const TriangleMesh& mesh) {
  VertexCorners list{std::vector<int>(mesh.positions.size() + 1, 0), std::vector<int>(3 * mesh.triangles.size())};
  for (const Triangle& t : mesh.triangles)
    for (const VertexIndex vertex : t) ++list.begin[vertex + 1];
  std::partial_sum(list.begin.begin(), list.begin.end(), list.begin.begin());
  std::vector<int> next(list.begin.begin(), list.begin.end() - 1);
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t)
    for (int k = 0; k < 3; ++k) list.corners[next[mesh.triangles[t][k]]++] = static_cast<int>(3 * t) + k;
  return list;
}

constexpr int kMostCorners = 24;  // of a vertex that is looked at

/// Whether the triangles at a vertex go once around it, all facing one way.
bool is_plain_vertex(const TriangleMesh& mesh, VertexIndex vertex, std::span<const int> corners) {
  constexpr double kLeastCosine = 0.1;
  const int n = static_cast<int>(corners.size());
  if (n < 3 || n > kMostCorners) return false;
  std::array<std::array<int, 2>, kMostCorners> sides;
  std::array<Vec3, kMostCorners> normals;
  const Vec3& p = mesh.positions[vertex];
  Vec3 mean = Vec3::Zero();
  for (int i = 0; i < n; ++i) {
    const Triangle& t = mesh.triangles[corners[i] / 3];
    const int k = corners[i] % 3;
    sides[i] = {t[(k + 1) % 3], t[(k + 2) % 3]};
    normals[i] = (mesh.positions[sides[i][0]] - p).cross(mesh.positions[sides[i][1]] - p).normalized();
    mean += normals[i];
  }
  const double least = kLeastCosine * mean.norm();
  for (int i = 0; i < n; ++i) {
    int followers = 0;
    for (int j = 0; j < n; ++j) followers += sides[j][0] == sides[i][1];
    if (followers != 1 || !(normals[i].dot(mean) > least)) return false;
  }
  // How often they go around: how often they pass one direction.
  Eigen::Index axis;
  mean.cwiseAbs().minCoeff(&axis);
  const Vec3 across = mean.cross(Vec3::Unit(axis));
  int turns = 0;
  for (int i = 0; i < n; ++i)
    turns += (mesh.positions[sides[i][0]] - p).dot(across) <= 0 && (mesh.positions[sides[i][1]] - p).dot(across) > 0;
  return turns == 1;
}

/// Vertices whose triangles go once around them, all facing one way: seen from there their corners lie side by side, so
/// no two of them meet but where they touch. Most are such, and most pairs of boxes that overlap are of triangles at
/// such a vertex.
std::vector<char> find_plain_vertices(const TriangleMesh& mesh) {
  const VertexCorners list = list_vertex_corners(mesh);
  std::vector<char> is_plain(mesh.positions.size(), 0);
  for_each_index(is_plain.size(), 1 << 12, [&](std::size_t v) {
    is_plain[v] = is_plain_vertex(mesh, static_cast<int>(v),
                                  std::span(list.corners).subspan(list.begin[v], list.begin[v + 1] - list.begin[v]));
  });
  return is_plain;
}

constexpr int kWidth = TriangleTree::kWidth;

using Box = std::array<float, 6>;  // least x, y, z, greatest x, y, z, in the tree's units
using Pairs = std::vector<std::array<int, 2>>;

/// Boxes of a block's triangles: six planes of eight.
std::array<float, 6 * kWidth> boxes_of_block(const TriangleMesh& mesh, const TriangleTree& tree, std::size_t block) {
  constexpr float kMargin = 3e-7f;  // rounding of the corners
  std::array<float, 6 * kWidth> boxes{};
  const std::size_t begin = block * kWidth, end = std::min(begin + kWidth, tree.order.size());
  for (std::size_t place = begin; place < end; ++place) {
    const auto [a, b, c] = mesh.triangles[tree.order[place]];
    const Eigen::Array3f p = tree.points[a], q = tree.points[b], r = tree.points[c];
    const Eigen::Array3f low = p.min(q).min(r) - kMargin, high = p.max(q).max(r) + kMargin;
    for (int d = 0; d < 3; ++d)
      boxes[d * kWidth + place - begin] = low[d], boxes[(3 + d) * kWidth + place - begin] = high[d];
  }
  return boxes;
}

/// How far each of eight boxes is from one along the axis that parts them most: at most 0 where they overlap. (Without
/// branches: the compiler takes lanes.)
std::array<float, kWidth> gaps_between(const float* planes, const Box& box) {
  std::array<float, kWidth> gaps;
  for (int k = 0; k < kWidth; ++k) {
    const float x = std::max(planes[k] - box[3], box[0] - planes[3 * kWidth + k]),
                y = std::max(planes[kWidth + k] - box[4], box[1] - planes[4 * kWidth + k]);
    gaps[k] = std::max(std::max(x, y), std::max(planes[2 * kWidth + k] - box[5], box[2] - planes[5 * kWidth + k]));
  }
  return gaps;
}

/// The search for pairs that intersect, block of the tree by block.
struct PairSearch {
  const TriangleMesh& mesh;
  const TriangleTree& tree;
  std::vector<char> is_plain;    // per vertex; empty: not known
  std::vector<char> is_queried;  // per triangle; empty: all are

  bool is_in_query(TriangleIndex triangle) const { return is_queried.empty() || is_queried[triangle] != 0; }

  bool do_share_plain_vertex(const Triangle& a, const Triangle& b) const {
    if (is_plain.empty()) return false;
    return std::any_of(a.begin(), a.end(),
                       [&](int v) { return (v == b[0] || v == b[1] || v == b[2]) && is_plain[v] != 0; });
  }

  /// Blocks whose boxes overlap one.
  /// \param first  blocks before it are left out
  void list_blocks(const Box& box, std::size_t first, std::vector<std::size_t>& listed) const {
    struct Entry {
      int level;
      std::size_t index;
    };
    listed.clear();
    std::vector<Entry> open{{tree.top_level(), 0}};
    while (!open.empty()) {
      const auto [level, index] = open.back();
      open.pop_back();
      if (level == 0) {
        listed.push_back(index);
        continue;
      }
      const auto gaps = gaps_between(tree.boxes.data() + (tree.level_begin[level] + index) * 6 * kWidth, box);
      for (int k = 0; k < kWidth; ++k) {
        const std::size_t child = kWidth * index + k;  // it covers 8^(level - 1) blocks
        if (gaps[k] <= 0 && (child + 1) << (3 * (level - 1)) > first) open.push_back({level - 1, child});
      }
    }
  }

  /// Pairs of the triangle at a place with those of a block; each pair once, from the earlier place of two in the
  /// query set.
  /// \param boxes  of the block's triangles
  void add_pairs(std::size_t place, const Box& box, std::size_t block, const float* boxes, Pairs& found) const {
    const auto gaps = gaps_between(boxes, box);
    const int own = tree.order[place];
    for (int k = 0; k < kWidth; ++k) {
      const std::size_t other_place = kWidth * block + k;
      if (gaps[k] > 0 || other_place >= tree.order.size() || other_place == place) continue;
      const int other = tree.order[other_place];
      if (other_place < place && is_in_query(other)) continue;
      if (do_share_plain_vertex(mesh.triangles[own], mesh.triangles[other])) continue;
      const int first = std::min(own, other), second = std::max(own, other);
      if (do_triangles_intersect(mesh, first, second)) found.push_back({first, second});
    }
  }

  /// Pairs of the queried triangles of a block.
  void search_block(std::size_t block, std::vector<std::size_t>& listed, Pairs& found) const {
    const std::size_t begin = block * kWidth, end = std::min(tree.order.size(), begin + kWidth);
    std::array<Box, kWidth> boxes;
    std::array<std::size_t, kWidth> places;
    int count = 0;
    for (std::size_t place = begin; place < end; ++place)
      if (is_in_query(tree.order[place])) places[count++] = place;
    if (count == 0) return;
    const std::array<float, 6 * kWidth> planes = boxes_of_block(mesh, tree, block);
    Box around{};
    for (int i = 0; i < count; ++i) {
      Box& box = boxes[i];
      for (int d = 0; d < 6; ++d) box[d] = planes[d * kWidth + (places[i] - begin)];
      for (int d = 0; d < 3; ++d) {
        around[d] = i == 0 ? box[d] : std::min(around[d], box[d]);
        around[3 + d] = i == 0 ? box[3 + d] : std::max(around[3 + d], box[3 + d]);
      }
    }
    list_blocks(around, is_queried.empty() ? block : 0, listed);
    for (const std::size_t other : listed) {
      const std::array<float, 6 * kWidth> others = boxes_of_block(mesh, tree, other);
      for (int i = 0; i < count; ++i) add_pairs(places[i], boxes[i], other, others.data(), found);
    }
  }

  Pairs find() const {
    constexpr std::size_t kAtOnce = 128;
    const std::size_t blocks = block_count(tree.order.size(), kWidth);
    std::vector<Pairs> found(block_count(blocks, kAtOnce));
    for_each_block(blocks, kAtOnce, [&](std::size_t part, std::size_t begin, std::size_t end) {
      std::vector<std::size_t> listed;
      for (std::size_t block = begin; block < end; ++block) search_block(block, listed, found[part]);
    });
    Pairs pairs;
    for (const Pairs& some : found) pairs.insert(pairs.end(), some.begin(), some.end());
    std::sort(pairs.begin(), pairs.end());
    return pairs;
  }
};

bool do_corners_intersect(const Triangle& i, const Corners& s, const Triangle& j, const Corners& t) {
  int shared = 0, at_i = 0, at_j = 0, free_i = 0, free_j = 0;
  for (int k = 0; k < 3; ++k) {
    const auto there = std::find(j.begin(), j.end(), i[k]);
    if (there == j.end()) {
      free_i = k;
    } else {
      ++shared;
      at_i = k;
      at_j = static_cast<int>(there - j.begin());
    }
    if (std::find(i.begin(), i.end(), j[k]) == i.end()) free_j = k;
  }
  switch (shared) {
    case 0: return do_disjoint_triangles_meet(s, t);
    case 1:
      return do_triangles_at_vertex_meet({s[at_i], s[(at_i + 1) % 3], s[(at_i + 2) % 3]},
                                         {t[at_j], t[(at_j + 1) % 3], t[(at_j + 2) % 3]});
    case 2: return do_triangles_at_edge_meet(s[(free_i + 1) % 3], s[(free_i + 2) % 3], s[free_i], t[free_j]);
    default: return drawing_plane(s) >= 0;
  }
}

}  // namespace

bool do_triangles_intersect(const TriangleMesh& mesh, int first, int second) {
  return do_corners_intersect(mesh.triangles[first], corners_of(mesh, first), mesh.triangles[second],
                              corners_of(mesh, second));
}

std::vector<std::array<int, 2>> find_self_intersections(const TriangleMesh& mesh) {
  if (mesh.triangles.empty()) return {};
  return find_self_intersections(mesh, build_triangle_tree(mesh));
}

std::vector<std::array<int, 2>> find_self_intersections(const TriangleMesh& mesh, const TriangleTree& tree) {
  return PairSearch{mesh, tree, find_plain_vertices(mesh), {}}.find();
}

std::vector<std::array<int, 2>> find_self_intersections(const TriangleMesh& mesh, const TriangleTree& tree,
                                                        std::span<const int> query) {
  if (query.empty()) return {};
  std::vector<char> is_queried(mesh.triangles.size(), 0);
  for (const TriangleIndex triangle : query) is_queried[triangle] = 1;
  return PairSearch{mesh, tree, {}, std::move(is_queried)}.find();
}

long count_self_intersections(const TriangleMesh& mesh) {
  return static_cast<long>(find_self_intersections(mesh).size());
}

}  // namespace skeletex
