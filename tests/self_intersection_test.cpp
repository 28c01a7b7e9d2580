// SPDX-License-Identifier: MIT
#include "skeletex/geometry/self_intersection.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>
#include <random>

#include "skeletex/analysis/manifold.h"
#include "skeletex/geometry/point_triangle.h"
#include "skeletex/geometry/predicates.h"
#include "support/load_model.h"
#include "support/shapes.h"

namespace skeletex {
namespace {

using Int3 = Eigen::Matrix<long, 3, 1>;

/// Whether some axis keeps two convex sets of grid points strictly apart: exact, in integers.
bool is_separated(const std::vector<Int3>& a, const std::vector<Int3>& b, const std::vector<Int3>& axes) {
  for (const Int3& axis : axes) {
    long a_low = a[0].dot(axis), a_high = a_low, b_low = b[0].dot(axis), b_high = b_low;
    for (const Int3& p : a) a_low = std::min(a_low, p.dot(axis)), a_high = std::max(a_high, p.dot(axis));
    for (const Int3& p : b) b_low = std::min(b_low, p.dot(axis)), b_high = std::max(b_high, p.dot(axis));
    if (a_high < b_low || b_high < a_low) return true;
  }
  return false;
}

std::vector<Int3> edges_of(const std::vector<Int3>& polygon) {
  std::vector<Int3> edges;
  for (std::size_t k = 0; k + 1 < polygon.size(); ++k) edges.push_back(polygon[k + 1] - polygon[k]);
  if (polygon.size() > 2) edges.push_back(polygon.front() - polygon.back());
  return edges;
}

/// All axes that can separate a triangle or segment from a triangle (separating axis theorem, coplanar sets included).
bool do_polygons_meet(const std::vector<Int3>& a, const std::vector<Int3>& b) {
  std::vector<Int3> axes, normals;
  for (const auto* polygon : {&a, &b})
    if (polygon->size() > 2) normals.push_back(((*polygon)[1] - (*polygon)[0]).cross((*polygon)[2] - (*polygon)[0]));
  axes = normals;
  for (const Int3& e : edges_of(a)) {
    for (const Int3& f : edges_of(b)) axes.push_back(e.cross(f));
    for (const Int3& n : normals) axes.push_back(n.cross(e));
  }
  for (const Int3& f : edges_of(b))
    for (const Int3& n : normals) axes.push_back(n.cross(f));
  return !is_separated(a, b, axes);
}

bool has_area(const std::vector<Int3>& t) { return !(t[1] - t[0]).cross(t[2] - t[0]).isZero(); }

TriangleMesh pair_of(const std::vector<Vec3>& positions, Triangle first, Triangle second) {
  return {positions, {first, second}};
}

}  // namespace

TEST(SelfIntersection, TrianglesOnAGridMeetWhereIntegersSaySo) {
  std::mt19937 random(4);
  int met = 0;
  for (const int half : {1, 2, 4}) {
    std::uniform_int_distribution<int> coordinate(-half, half);
    for (int round = 0; round < 60000; ++round) {
      std::vector<Int3> points;
      TriangleMesh mesh;
      for (int k = 0; k < 6; ++k) {
        points.emplace_back(coordinate(random), coordinate(random), round % 4 == 0 ? 0 : coordinate(random));
        mesh.positions.push_back(points.back().cast<double>());
      }
      const std::vector<Int3> a(points.begin(), points.begin() + 3), b(points.begin() + 3, points.end());
      if (!has_area(a) || !has_area(b)) continue;
      mesh.triangles = {{0, 1, 2}, {3, 4, 5}};
      const bool expected = do_polygons_meet(a, b);
      met += expected;
      ASSERT_EQ(do_triangles_intersect(mesh, 0, 1), expected) << "round " << round << ", half " << half;
      ASSERT_EQ(do_triangles_intersect(mesh, 1, 0), expected);
    }
  }
  EXPECT_GT(met, 10000);
}

TEST(SelfIntersection, TrianglesAtAVertexMeetWhereTheirConesDo) {
  std::mt19937 random(5);
  int met = 0;
  for (int round = 0; round < 60000; ++round) {
    std::uniform_int_distribution<int> coordinate(-3, 3);
    std::vector<Int3> p;
    for (int k = 0; k < 4; ++k)
      p.emplace_back(coordinate(random), coordinate(random), round % 4 == 0 ? 0 : coordinate(random));
    const Int3 zero = Int3::Zero();
    const std::vector<Int3> a{zero, p[0], p[1]}, b{zero, p[2], p[3]};
    if (!has_area(a) || !has_area(b)) continue;
    // Near the vertex the triangles are cones: the far edge of the one against the other, enlarged.
    const bool expected = do_polygons_meet({p[0], p[1]}, {zero, 1000 * p[2], 1000 * p[3]});
    met += expected;
    TriangleMesh mesh;
    mesh.positions = {p[0].cast<double>(), p[1].cast<double>(), Vec3::Zero(), p[2].cast<double>(), p[3].cast<double>()};
    mesh.triangles = {{0, 1, 2}, {3, 2, 4}};
    ASSERT_EQ(do_triangles_intersect(mesh, 0, 1), expected) << "round " << round;
  }
  EXPECT_GT(met, 5000);
}

TEST(SelfIntersection, TrianglesAtAnEdgeMeetOnlyWhenFoldedFlat) {
  const std::vector<Vec3> flat{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {1, -1, 0}, {0.5, 0.5, 0}, {0.5, 0.5, 1e-12}};
  EXPECT_FALSE(do_triangles_intersect(pair_of(flat, {0, 1, 2}, {1, 0, 3}), 0, 1)) << "unfolded";
  EXPECT_TRUE(do_triangles_intersect(pair_of(flat, {0, 1, 2}, {1, 0, 4}), 0, 1)) << "folded back";
  EXPECT_FALSE(do_triangles_intersect(pair_of(flat, {0, 1, 2}, {1, 0, 5}), 0, 1)) << "a crease, however sharp";
  EXPECT_TRUE(do_triangles_intersect(pair_of(flat, {0, 1, 2}, {2, 1, 0}), 0, 1)) << "the same triangle twice";
}

TEST(SelfIntersection, ATriangleWithoutAreaIsASegment) {
  const std::vector<Vec3> p{{0, 0, 0},     {1, 0, 0},       {0, 1, 0}, {0.2, 0.2, -1},
                            {0.2, 0.2, 1}, {0.2, 0.2, 0.5}, {3, 3, 1}, {3, 3, -1}};
  EXPECT_TRUE(do_triangles_intersect(pair_of(p, {0, 1, 2}, {3, 4, 5}), 0, 1));
  EXPECT_FALSE(do_triangles_intersect(pair_of(p, {0, 1, 2}, {6, 7, 7}), 0, 1));
  EXPECT_FALSE(do_triangles_intersect(pair_of(p, {3, 4, 5}, {6, 7, 7}), 0, 1));
}

TEST(SelfIntersection, TheTreeFindsThePairsOfBruteForce) {
  for (unsigned seed = 1; seed <= 4; ++seed) {
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> uniform(-1, 1);
    TriangleMesh mesh;
    for (int v = 0; v < 500; ++v) mesh.positions.emplace_back(uniform(random), uniform(random), uniform(random));
    std::uniform_int_distribution<int> vertex(0, 499);
    while (mesh.triangles.size() < 700) {
      // Near each other, so that some share vertices and sizes differ.
      const int a = vertex(random), b = (a + 1 + vertex(random) / 100) % 500, c = vertex(random);
      if (a == b || b == c || c == a) continue;
      if (seed > 2) mesh.positions[b] = mesh.positions[a] + 0.05 * (mesh.positions[b] - mesh.positions[a]);
      mesh.triangles.push_back({a, b, c});
    }
    std::vector<std::array<int, 2>> expected;
    for (int i = 0; i < 700; ++i)
      for (int j = i + 1; j < 700; ++j)
        if (do_triangles_intersect(mesh, i, j)) expected.push_back({i, j});
    EXPECT_GT(expected.size(), 10u);
    EXPECT_EQ(find_self_intersections(mesh), expected) << "seed " << seed;
  }
}

TEST(SelfIntersection, OfACrumpledTorusTheTreeFindsThePairsOfBruteForce) {
  for (unsigned seed = 1; seed <= 4; ++seed) {
    std::mt19937 random(seed);
    std::normal_distribution<double> normal(0, 1);
    // From a few corners that fold over to a heap.
    TriangleMesh mesh;
    constexpr int kAround = 24, kAlong = 14;
    for (int i = 0; i < kAround; ++i)
      for (int j = 0; j < kAlong; ++j) {
        const double a = 2 * std::numbers::pi * i / kAround, b = 2 * std::numbers::pi * j / kAlong,
                     r = 1 + 0.4 * std::cos(b);
        mesh.positions.push_back(Vec3(r * std::cos(a), r * std::sin(a), 0.4 * std::sin(b)) +
                                 (0.02 + 0.03 * seed) * Vec3(normal(random), normal(random), normal(random)));
        const int right = (i + 1) % kAround, up = (j + 1) % kAlong;
        mesh.triangles.push_back({kAlong * i + j, kAlong * right + j, kAlong * right + up});
        mesh.triangles.push_back({kAlong * i + j, kAlong * right + up, kAlong * i + up});
      }
    std::vector<std::array<int, 2>> expected;
    const int count = static_cast<int>(mesh.triangles.size());
    for (int i = 0; i < count; ++i)
      for (int j = i + 1; j < count; ++j)
        if (do_triangles_intersect(mesh, i, j)) expected.push_back({i, j});
    EXPECT_GT(expected.size(), 1u);
    EXPECT_EQ(find_self_intersections(mesh), expected) << "seed " << seed;
    // Of a query set the pairs that have one of its triangles.
    std::vector<int> query;
    for (int i = 0; i < count; ++i)
      if (random() % 5 == 0) query.push_back(i);
    const auto is_queried = [&](int i) { return std::binary_search(query.begin(), query.end(), i); };
    std::erase_if(expected, [&](const auto& pair) { return !is_queried(pair[0]) && !is_queried(pair[1]); });
    TriangleTree tree = build_triangle_tree(mesh);
    EXPECT_EQ(find_self_intersections(mesh, tree, query), expected) << "seed " << seed;
    EXPECT_TRUE(find_self_intersections(mesh, tree, {}).empty());

    // A tree that is made to fit moved triangles finds what one of its own does, also over a given order.
    std::vector<int> places;
    for (int place = 0; place < count; ++place)
      if (tree.order[place] < 100) places.push_back(place);
    for (int vertex = 0; vertex < kAlong * kAround; ++vertex)
      if (std::none_of(mesh.triangles.begin() + 100, mesh.triangles.end(),
                       [&](const Triangle& t) { return t[0] == vertex || t[1] == vertex || t[2] == vertex; }))
        mesh.positions[vertex] += 0.1 * Vec3(normal(random), normal(random), normal(random));
    update_triangle_tree(mesh, places, tree);
    std::vector<int> order(count);
    std::iota(order.begin(), order.end(), 0);
    const auto moved = find_self_intersections(mesh);
    EXPECT_EQ(find_self_intersections(mesh, tree), moved);
    EXPECT_EQ(find_self_intersections(mesh, build_triangle_tree(mesh, order)), moved);
    for (int i = 0; i < 50; ++i) {
      const Vec3 point(normal(random), normal(random), normal(random));
      double least = std::numeric_limits<double>::infinity();
      for (const auto& [a, b, c] : mesh.triangles)
        least = std::min(least,
                         offset_from_triangle(point, mesh.positions[a], mesh.positions[b], mesh.positions[c]).norm());
      EXPECT_EQ(find_nearest_triangle(mesh, tree, point).distance, least);
      EXPECT_EQ(find_nearest_triangle(mesh, tree, point, least).triangle, -1);
      EXPECT_EQ(find_nearest_triangle(mesh, tree, point, 1.01 * least).distance, least);
    }
  }
}

TEST(SelfIntersection, OrientationsKnowWhatRoundingHides) {
  EXPECT_EQ(orientation(Vec2(0, 0), Vec2(1, 0), Vec2(0, 1)), 1);
  EXPECT_EQ(orientation(Vec2(0, 0), Vec2(0, 1), Vec2(1, 0)), -1);
  EXPECT_EQ(orientation(Vec2(0.1, 0.1), Vec2(0.2, 0.2), Vec2(0.3, 0.3)), 0);
  EXPECT_EQ(orientation(Vec3(0, 0, 0), Vec3(1, 0, 0), Vec3(0, 1, 0), Vec3(0, 0, -1)), 1);
  EXPECT_EQ(orientation(Vec3(0, 0, 0), Vec3(1, 0, 0), Vec3(0, 1, 0), Vec3(0.3, 0.3, 1e-300)), -1);
  EXPECT_EQ(orientation(Vec3(0.1, 0.1, 0.1), Vec3(0.4, 0.2, 0.3), Vec3(0.7, 0.3, 0.5), Vec3(1, 0.4, 0.7)), 0);
}

TEST(SelfIntersection, TrianglesOfATiltedPlaneMeetNowhereElse) {
  // A polygon whose corners lie in a plane but for rounding.
  constexpr int kCorners = 24;
  TriangleMesh mesh;
  for (const Eigen::AngleAxisd& tilt :
       {Eigen::AngleAxisd(0.1, Vec3(1, 2, 3).normalized()), Eigen::AngleAxisd(1.3, Vec3(-2, 1, 0.3).normalized())}) {
    mesh = {};
    for (int i = 0; i < kCorners; ++i) {
      const double angle = 2 * std::numbers::pi * i / kCorners;
      mesh.positions.push_back(tilt * Vec3(2 + 0.4 * std::cos(angle), 0.4 * std::sin(angle), 0));
    }
    for (int i = 1, k = kCorners - 1, turn = 0; k - i > 0; ++turn) {
      if (turn % 2 == 0)
        mesh.triangles.push_back({i - 1, i, k}), ++i;
      else
        mesh.triangles.push_back({i - 1, k - 1, k}), --k;
    }
    EXPECT_EQ(find_self_intersections(mesh).size(), 0u);
  }
}

TEST(SelfIntersection, GeneratedShapesHaveNone) {
  for (const NamedShape& shape : all_shapes()) EXPECT_EQ(count_self_intersections(shape.shape.mesh), 0) << shape.name;
}

TEST(SelfIntersection, TwoTubesThroughEachOtherCrossAndALayerOverAnotherDoesNot) {
  TriangleMesh mesh = capsule_shape().mesh;
  const int count = static_cast<int>(mesh.triangles.size()), base = static_cast<int>(mesh.positions.size());
  const TriangleMesh other = mesh;
  for (const Vec3& p : other.positions) mesh.positions.emplace_back(p.z() + 0.013, p.x() + 0.007, p.y() + 0.003);
  for (const Triangle& t : other.triangles) mesh.triangles.push_back({t[0] + base, t[1] + base, t[2] + base});
  const auto pairs = find_self_intersections(mesh);
  EXPECT_GT(pairs.size(), 100u);
  for (const auto& [a, b] : pairs) {
    EXPECT_LT(a, count);
    EXPECT_GE(b, count);
  }
  for (std::size_t v = 0; v < other.positions.size(); ++v) mesh.positions[base + v] = 0.9 * other.positions[v];
  EXPECT_EQ(count_self_intersections(mesh), 0);
}

TEST(SelfIntersection, TheCountDoesNotDependOnTheOrderOfTheTriangles) {
  TriangleMesh mesh = load_standard_model("bear").mesh;
  std::mt19937 random(1);
  std::normal_distribution<double> noise(0, 2e-3 * bounding_box(mesh).diagonal());
  for (Vec3& p : mesh.positions) p += Vec3(noise(random), noise(random), noise(random));
  const long count = count_self_intersections(mesh);
  EXPECT_GT(count, 0);
  const std::vector<int> order = random_permutation(static_cast<int>(mesh.triangles.size()), 9);
  TriangleMesh shuffled = mesh;
  for (std::size_t t = 0; t < order.size(); ++t)
    shuffled.triangles[t] = {mesh.triangles[order[t]][1], mesh.triangles[order[t]][2], mesh.triangles[order[t]][0]};
  EXPECT_EQ(count_self_intersections(shuffled), count);
}

}  // namespace skeletex
