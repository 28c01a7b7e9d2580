// SPDX-License-Identifier: MIT
#include "skeletex/analysis/metro.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <limits>
#include <numbers>
#include <random>
#include <set>

#include "bench/stages/embree_scene.h"
#include "metro_structs.h"
#include "skeletex/geometry/hilbert_order.h"
#include "skeletex/geometry/parallel.h"
#include "skeletex/geometry/point_triangle.h"
#include "skeletex/geometry/triangle_tree.h"
#include "skeletex/model/error.h"
#include "support/load_model.h"
#include "support/metro_twin.h"
#include "support/shapes.h"

namespace skeletex {
namespace {

ClContext& context() {
  static ClContext instance;
  return instance;
}

TriangleMesh sphere(double radius, int rings, int around) {
  TriangleMesh mesh;
  mesh.positions.emplace_back(0, 0, radius);
  for (int i = 1; i < rings; ++i)
    for (int j = 0; j < around; ++j) {
      const double a = std::numbers::pi * i / rings, b = 2 * std::numbers::pi * j / around;
      mesh.positions.emplace_back(radius * std::sin(a) * std::cos(b), radius * std::sin(a) * std::sin(b),
                                  radius * std::cos(a));
    }
  mesh.positions.emplace_back(0, 0, -radius);
  const auto at = [&](int i, int j) {
    return i == 0 ? 0 : i == rings ? static_cast<int>(mesh.positions.size()) - 1 : 1 + (i - 1) * around + j % around;
  };
  for (int i = 0; i < rings; ++i)
    for (int j = 0; j < around; ++j) {
      if (i + 1 < rings) mesh.triangles.push_back({at(i, j), at(i + 1, j), at(i + 1, j + 1)});
      if (i > 0) mesh.triangles.push_back({at(i, j), at(i + 1, j + 1), at(i, j + 1)});
    }
  return mesh;
}

TriangleMesh unit_cube(const Vec3& corner) {
  TriangleMesh mesh;
  for (int i = 0; i < 8; ++i) mesh.positions.push_back(corner + Vec3(i & 1, (i >> 1) & 1, (i >> 2) & 1));
  const int faces[6][4] = {{0, 4, 6, 2}, {1, 3, 7, 5}, {0, 1, 5, 4}, {2, 6, 7, 3}, {0, 2, 3, 1}, {4, 5, 7, 6}};
  for (const auto& f : faces) {
    mesh.triangles.push_back({f[0], f[1], f[2]});
    mesh.triangles.push_back({f[0], f[2], f[3]});
  }
  return mesh;
}

class Random {
 public:
  explicit Random(unsigned seed) : engine_(seed) {}
  double uniform(double low, double high) { return std::uniform_real_distribution<double>(low, high)(engine_); }
  Vec3 in_box(double half = 1) { return {uniform(-half, half), uniform(-half, half), uniform(-half, half)}; }
  Vec3 normal() {
    std::normal_distribution<double> d;
    return {d(engine_), d(engine_), d(engine_)};
  }

 private:
  std::mt19937 engine_;
};

/// Triangles of all sizes and shapes: fat, needles, slivers, segments and points.
TriangleMesh soup(Random& random, int triangles, double largest) {
  TriangleMesh mesh;
  for (int t = 0; t < triangles; ++t) {
    const Vec3 a = random.in_box();
    const double size = largest * std::pow(10, random.uniform(-4, 0));
    const Vec3 ab = size * random.normal(), across = size * random.normal();
    const int first = static_cast<int>(mesh.positions.size());
    Vec3 c = a + across;
    switch (t % 8) {
      case 0: c = a + random.uniform(-1, 2) * ab; break;                 // a segment
      case 1: c = a + random.uniform(0, 1) * ab + 1e-6 * across; break;  // a sliver with an obtuse corner
      case 2: c = a + 1e-5 * across; break;                              // a needle
      case 3: c = t % 16 == 3 ? a : Vec3(a + ab); break;                 // two corners in one place
      default: break;
    }
    mesh.positions.insert(mesh.positions.end(), {a, Vec3(t % 64 == 11 ? a : Vec3(a + ab)), Vec3(t % 64 == 11 ? a : c)});
    mesh.triangles.push_back({first, first + 1, first + 2});
  }
  return mesh;
}

/// The bound on an error that choosing a triangle in single precision can make: rounding of two points to 2^-24 of half
/// the diagonal in three coordinates each, and some more for the arithmetic.
constexpr double kFloatChoice = 2e-7;

}  // namespace

TEST(Metro, ShiftedCubesGiveTheClosedForm) {
  for (const double t : {0.3, 0.01, 1e-4, 1e-6}) {
    SCOPED_TRACE(t);
    const TriangleMesh a = unit_cube({5, 6, 7}), b = unit_cube({5 + t, 6, 7});
    const MetroReport report = measure_metro(context(), a, b, {.samples = 200000});
    // Of A's faces, one lies t before B; the opposite one inside B, nearer to B's sides around its rim; four lie on B
    // but for a strip of width t.
    const double mean = (t + (1 - std::pow(1 - 2 * t, 3)) / 6 + 2 * t * t) / 6;
    const double mean_square = (t * t + t * t - 8 * t * t * t / 3 + 2 * std::pow(t, 4) + 4 * t * t * t / 3) / 6;
    const double diagonal = std::sqrt(3.0);
    EXPECT_NEAR(report.diagonal, diagonal, 1e-12);
    for (const DistanceStatistics& s : {report.forward, report.backward}) {
      EXPECT_NEAR(s.mean * diagonal, mean, 2e-4 * mean);
      EXPECT_NEAR(s.rms * diagonal, std::sqrt(mean_square), 2e-4 * t);
      EXPECT_NEAR(s.std * diagonal, std::sqrt(mean_square - mean * mean), 4e-4 * t);
      EXPECT_NEAR(s.max * diagonal, t, kFloatChoice);
    }
    // Four of A's vertices lie t before B, four on edges of B's sides.
    EXPECT_NEAR(report.vertex.mean * diagonal, t / 2, 1e-12);
    EXPECT_NEAR(report.vertex.std * diagonal, t / 2, 1e-12);
    EXPECT_NEAR(report.vertex.max * diagonal, t, 1e-12);
    for (int v = 0; v < 8; ++v) EXPECT_NEAR(report.vertex_distances[v], v & 1 ? 0 : t, 1e-7 * t + 1e-14);
  }
}

TEST(Metro, AScaledSphereIsAsFarAwayAsItsRadiusSays) {
  const double radius = 3, growth = 0.01 * radius, h = std::numbers::pi / 200;
  const TriangleMesh small = sphere(radius, 200, 400);
  const MetroReport report = measure_metro(context(), small, sphere(radius + growth, 200, 400));
  // The facets lie within radius h^2 / 4 of the spheres, both alike.
  for (const DistanceStatistics& s : {report.forward, report.backward, report.vertex}) {
    EXPECT_NEAR(s.mean * report.diagonal, growth, h * h * growth);
    EXPECT_NEAR(s.max * report.diagonal, growth, radius * h * h / 4);
    EXPECT_NEAR(s.rms, std::hypot(s.mean, s.std), 1e-9 * s.rms);
  }
  EXPECT_NEAR(report.diagonal, 2 * std::sqrt(3.0) * radius, 1e-12);
}

TEST(Metro, PointsFollowAreaWhateverTheTriangles) {
  // A slope over the plane z = 0, made of triangles whose areas span a factor of thousands.
  TriangleMesh slope, plane;
  const std::vector<double> cuts{0, 0.001, 0.003, 0.01, 0.05, 0.2, 0.9, 1};
  for (const double x : cuts)
    for (const double y : cuts) slope.positions.emplace_back(x, y, x);
  const int n = static_cast<int>(cuts.size());
  for (int i = 0; i + 1 < n; ++i)
    for (int j = 0; j + 1 < n; ++j) {
      const int at = i * n + j;
      slope.triangles.push_back({at, at + n, at + n + 1});
      slope.triangles.push_back({at, at + n + 1, at + 1});
    }
  plane.positions = {{-9, -9, 0}, {9, -9, 0}, {9, 9, 0}, {-9, 9, 0}};
  plane.triangles = {{0, 1, 2}, {0, 2, 3}};
  const MetroReport report = measure_metro(context(), slope, plane, {.samples = 10000});
  EXPECT_NEAR(report.forward.mean * report.diagonal, 0.5, 1e-3);
  EXPECT_NEAR(report.forward.rms * report.diagonal, std::sqrt(1.0 / 3), 1e-3);
  EXPECT_GT(report.forward.max * report.diagonal, 0.99);
  EXPECT_LE(report.forward.max * report.diagonal, 1);
}

TEST(Metro, AMeshIsAtNoDistanceFromItself) {
  const TriangleMesh mesh = load_standard_model("bear").mesh;
  const MetroReport report = measure_metro(context(), mesh, mesh);
  EXPECT_LT(report.forward.mean, 1e-12);
  EXPECT_LT(report.forward.max, kFloatChoice);
  EXPECT_EQ(report.vertex.max, 0);
}

TEST(Metro, ForwardOfTheOneIsBackwardOfTheOther) {
  const TriangleMesh a = y_shape().mesh, b = creature_shape().mesh;
  const MetroReport there = measure_metro(context(), a, b), back = measure_metro(context(), b, a);
  const double unit = there.diagonal / back.diagonal;
  EXPECT_NEAR(there.forward.mean * unit, back.backward.mean, 1e-14);
  EXPECT_NEAR(there.backward.rms * unit, back.forward.rms, 1e-14);
  EXPECT_NEAR(there.backward.max * unit, back.forward.max, 1e-14);
}

TEST(Metro, ARigidMotionOfBothMeshesChangesNothing) {
  const TriangleMesh a = y_shape().mesh;
  TriangleMesh b = a;
  Random random(3);
  for (Vec3& p : b.positions) p += 1e-3 * random.normal();
  const MetroReport still = measure_metro(context(), a, b);
  Similarity map = random_similarity(5);
  map.scale = 1;
  map.translation = Vec3(300, -200, 100);
  const MetroReport moved = measure_metro(context(), transformed(a, map), transformed(b, map));
  for (std::size_t v = 0; v < a.positions.size(); ++v)
    EXPECT_NEAR(still.vertex_distances[v], moved.vertex_distances[v], kFloatChoice * still.diagonal);
  // The box turns with the mesh, and so do the diagonal and the curve that the samples follow.
  const double unit = moved.diagonal / still.diagonal;
  EXPECT_NEAR(still.vertex.mean, moved.vertex.mean * unit, 1e-9);
  EXPECT_NEAR(still.forward.mean, moved.forward.mean * unit, 2e-3 * still.forward.mean);
  EXPECT_NEAR(still.backward.rms, moved.backward.rms * unit, 2e-3 * still.backward.rms);
}

TEST(Metro, UnitsDoNotMatter) {
  const TriangleMesh a = y_shape().mesh, b = transformed(a, {.translation = Vec3(0.01, 0.02, -0.03)});
  const MetroReport metres = measure_metro(context(), a, b);
  for (const double scale : {1e-15, 1e-3, 1e12}) {
    const MetroReport other =
        measure_metro(context(), transformed(a, {.scale = scale}), transformed(b, {.scale = scale}));
    EXPECT_NEAR(other.forward.mean, metres.forward.mean, 1e-6 * metres.forward.mean) << scale;
    EXPECT_NEAR(other.vertex.max, metres.vertex.max, 1e-6 * metres.vertex.max) << scale;
  }
}

TEST(Metro, TheSameInputGivesTheSameNumbers) {
  const TriangleMesh a = y_shape().mesh, b = x_shape().mesh;
  const MetroReport one = measure_metro(context(), a, b), two = measure_metro(context(), a, b);
  EXPECT_EQ(one.forward.mean, two.forward.mean);
  EXPECT_EQ(one.backward.std, two.backward.std);
  EXPECT_EQ(one.vertex_distances, two.vertex_distances);
}

TEST(Metro, PointsOnFacesEdgesAndVerticesAreAtNoDistance) {
  const TriangleMesh mesh = load_standard_model("bunny00").mesh;
  const double diagonal = bounding_box(mesh).diagonal();
  Random random(11);
  std::vector<Vec3> points;
  for (std::size_t t = 0; t < mesh.triangles.size(); t += 7) {
    const auto [a, b, c] = mesh.triangles[t];
    const double s = random.uniform(0, 1), u = random.uniform(0, 1 - s);
    points.push_back(mesh.positions[a]);
    points.push_back(mesh.positions[a] + s * (mesh.positions[b] - mesh.positions[a]));
    points.push_back(mesh.positions[a] + s * (mesh.positions[b] - mesh.positions[a]) +
                     u * (mesh.positions[c] - mesh.positions[a]));
  }
  const std::vector<float> distances = closest_distances(context(), mesh, points);
  double sum = 0;
  for (const float d : distances) {
    EXPECT_LT(d, kFloatChoice * diagonal);
    sum += d;
  }
  EXPECT_LT(sum / static_cast<double>(distances.size()), 1e-9 * diagonal);
}

TEST(Metro, TheDistanceToATriangleIsThatOfTheTwin) {
  Random random(17);
  for (int i = 0; i < 200000; ++i) {
    const TriangleMesh one = soup(random, 1 + i % 16, 0.3);
    const auto [a, b, c] = one.triangles.back();
    const Vec3 &pa = one.positions[a], &pb = one.positions[b], &pc = one.positions[c];
    // Far away, near, and on the triangle.
    Vec3 p = random.in_box(2);
    if (i % 3 > 0) p = pa + random.uniform(-0.5, 1.5) * (pb - pa) + random.uniform(-0.5, 1.5) * (pc - pa);
    if (i % 3 > 1) p += 1e-6 * random.normal();
    const double expected = static_cast<double>(twin_distance_to_triangle(p, pa, pb, pc));
    ASSERT_NEAR(offset_from_triangle(p, pa, pb, pc).norm(), expected, 1e-11) << "round " << i;
  }
}

TEST(Metro, TheKernelFindsTheTwinsTriangles) {
  int sooner = 0;  // not the nearest, but near enough
  for (const int triangles : {1, 7, 8, 9, 64, 65, 513, 3000}) {
    for (const double largest : {1.0, 0.02}) {
      Random random(static_cast<unsigned>(triangles));
      SCOPED_TRACE(triangles);
      const TriangleMesh mesh = soup(random, triangles, largest);
      const TriangleTree tree = build_triangle_tree(mesh);
      std::vector<Vec3> points;
      for (int i = 0; i < 300; ++i) {
        const auto [a, b, c] = mesh.triangles[i % triangles];
        points.push_back(random.in_box(i % 5 == 0 ? 30 : 1.2));
        points.push_back(mesh.positions[a] + random.uniform(0, 1) * (mesh.positions[b] - mesh.positions[c]) +
                         1e-6 * random.normal());
      }
      std::vector<float> planes(3 * points.size());
      std::vector<double> expected;
      for (const Vec3& p : points) {
        expected.push_back(static_cast<double>(twin_distance_to_mesh(mesh, p)));
        const Vec3 local = (p - tree.origin) / tree.scale;
        for (std::size_t axis = 0; axis < 3; ++axis)
          planes[axis * points.size() + expected.size() - 1] = static_cast<float>(local[axis]);
      }
      // Whatever the points an item follows one another with: the first has no block to start from, the others do.
      for (const int run : {1, 3, 1000})
        for (const double enough : {0.0, 0.05 * tree.scale}) {
          const int count = static_cast<int>(points.size());
          const auto enough_squared = static_cast<float>(enough / tree.scale * enough / tree.scale);
          auto nearest = context().allocate<int>(count);
          auto squared = context().allocate<float>(count);
          context().launch({"metro.cl", "find_nearest_triangles"}, ClRange(block_count(count, run)),
                           NearestParameters{count, run, tree.top_level(), enough_squared}, context().upload(planes),
                           context().upload(tree.boxes), context().upload(triangles_of_blocks(mesh, tree)),
                           context().upload(tree.level_begin), nearest, squared);
          const std::vector<int> places = context().download(nearest);
          const std::vector<float> squares = context().download(squared);
          for (int i = 0; i < count; ++i) {
            ASSERT_GE(places[i], 0);
            ASSERT_LT(places[i], triangles);
            const auto [a, b, c] = mesh.triangles[tree.order[places[i]]];
            const double found = static_cast<double>(
                twin_distance_to_triangle(points[i], mesh.positions[a], mesh.positions[b], mesh.positions[c]));
            const double measured = std::sqrt(squares[i]) * tree.scale;
            // Far away single precision is relative to the distance. A sliver's edges may stand in for its inside.
            const double tolerance = kFloatChoice * (tree.scale + expected[i]) + 2e-6 * largest;
            EXPECT_NEAR(measured, found, tolerance) << "point " << i << ", run " << run;
            EXPECT_GE(found, expected[i] - tolerance) << "point " << i << ", run " << run;
            EXPECT_LE(found, std::max(expected[i], enough) + tolerance) << "point " << i << ", run " << run;
            sooner += found > expected[i] + tolerance;
          }
        }
    }
  }
  EXPECT_GT(sooner, 100);
}

TEST(Metro, RandomSoupsGiveTheTwinsDistances) {
  for (unsigned seed = 1; seed <= 6; ++seed) {
    Random random(seed);
    SCOPED_TRACE(seed);
    const TriangleMesh mesh = soup(random, 700, seed % 2 ? 0.5 : 0.05);
    const double diagonal = bounding_box(mesh).diagonal();
    std::vector<Vec3> points;
    for (int i = 0; i < 1500; ++i) points.push_back(random.in_box(1.1));
    const std::vector<float> distances = closest_distances(context(), mesh, points);
    double error = 0;
    for (std::size_t i = 0; i < points.size(); ++i) {
      const double expected = static_cast<double>(twin_distance_to_mesh(mesh, points[i]));
      EXPECT_NEAR(distances[i], expected, kFloatChoice * diagonal);
      error += std::abs(distances[i] - expected);
    }
    EXPECT_LT(error / 1500, 2e-8 * diagonal);
  }
}

TEST(Metro, TreesBiggerThanOneLevelOfBoxesAreComplete) {
  for (const int triangles : {1, 8, 9, 64, 65, 600}) {
    Random random(5);
    const TriangleTree tree = build_triangle_tree(soup(random, triangles, 0.1));
    std::set<int> seen(tree.order.begin(), tree.order.end());
    EXPECT_EQ(static_cast<int>(seen.size()), triangles);
    int nodes = (triangles + 7) / 8;
    for (int level = 1; level <= tree.top_level(); ++level) nodes = (nodes + 7) / 8;
    EXPECT_EQ(nodes, 1);
    EXPECT_EQ(static_cast<int>(tree.boxes.size()), 48 * (tree.level_begin.back() + 1));
  }
}

TEST(Metro, TheHilbertCurveVisitsEveryCellFromANeighbour) {
  std::vector<Vec3> cells;
  for (int i = 0; i < 4096; ++i) cells.emplace_back(i % 16, (i / 16) % 16, i / 256);
  const std::vector<int> order = hilbert_order(cells);
  for (int i = 1; i < 4096; ++i) EXPECT_EQ((cells[order[i]] - cells[order[i - 1]]).lpNorm<1>(), 1);
  Random random(2);
  std::vector<Vec3> points;
  for (int i = 0; i < 10000; ++i) points.push_back(random.in_box());
  std::vector<int> sorted = hilbert_order(points);
  std::sort(sorted.begin(), sorted.end());
  for (int i = 0; i < 10000; ++i) ASSERT_EQ(sorted[i], i);
}

namespace {

double twin_distance(const Vec3& point, const Vec3& a, const Vec3& b, const Vec3& c) {
  return static_cast<double>(twin_distance_to_triangle(point, a, b, c));
}

/// Distances by Embree's tree, with the twin at its leaves.
std::vector<double> embree_distances(const TriangleMesh& mesh, const std::vector<Vec3>& points) {
  const EmbreeScene scene(mesh.positions, mesh.triangles, twin_distance);
  std::vector<double> distances;
  for (const Vec3& p : points) distances.push_back(scene.closest_distance(p));
  return distances;
}

}  // namespace

TEST(Metro, EmbreeAgreesOnRealModels) {
  for (const char* name : {"bear", "armadillo"}) {
    SCOPED_TRACE(name);
    const TriangleMesh mesh = load_standard_model(name).mesh;
    const double diagonal = bounding_box(mesh).diagonal();
    for (const double noise : {0.0, 1e-7, 1e-5, 1e-2}) {
      SCOPED_TRACE(noise);
      Random random(1);
      TriangleMesh other = mesh;
      for (Vec3& p : other.positions) p += noise * diagonal * random.normal();
      // Vertices and centres of the disturbed mesh against the mesh.
      std::vector<Vec3> points = other.positions;
      for (const auto& [a, b, c] : other.triangles)
        points.push_back((other.positions[a] + other.positions[b] + other.positions[c]) / 3);
      const std::vector<double> expected = embree_distances(mesh, points);
      const std::vector<float> distances = closest_distances(context(), mesh, points);
      double sum = 0, expected_sum = 0;
      for (std::size_t i = 0; i < points.size(); ++i) {
        EXPECT_NEAR(distances[i], expected[i], kFloatChoice * diagonal);
        sum += distances[i];
        expected_sum += expected[i];
      }
      EXPECT_NEAR(sum, expected_sum, 2e-9 * diagonal * static_cast<double>(points.size()));
      const MetroReport report = measure_metro(context(), other, mesh, {.samples = 1000});
      double vertex_sum = 0;
      for (std::size_t v = 0; v < other.positions.size(); ++v) vertex_sum += expected[v];
      EXPECT_NEAR(report.vertex.mean * report.diagonal, vertex_sum / static_cast<double>(other.positions.size()),
                  2e-9 * diagonal);
    }
  }
}

TEST(Metro, MeshesThatCannotBeMeasuredAreNamed) {
  const TriangleMesh good = unit_cube(Vec3::Zero());
  const auto message = [&](const TriangleMesh& a, const TriangleMesh& b, long samples = 100) -> std::string {
    try {
      measure_metro(context(), a, b, {.samples = samples});
    } catch (const InputError& error) {
      return error.what();
    }
    return "";
  };
  EXPECT_NE(message({}, good).find("the first mesh has no triangles"), std::string::npos);
  EXPECT_NE(message(good, {}).find("the second mesh has no triangles"), std::string::npos);
  TriangleMesh bad = good;
  bad.triangles[3][1] = 8;
  EXPECT_NE(message(good, bad).find("triangle 3 names vertex 8"), std::string::npos);
  bad = good;
  bad.positions[5].y() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_NE(message(bad, good).find("vertex 5"), std::string::npos);
  bad = good;
  for (Vec3& p : bad.positions) p.y() = p.z() = 0;
  EXPECT_NE(message(good, bad).find("no area"), std::string::npos);
  EXPECT_NE(message(good, good, -1).find("-1"), std::string::npos);
  EXPECT_THROW(
      closest_distances(context(), good, std::vector<Vec3>{Vec3(0, std::numeric_limits<double>::infinity(), 0)}),
      InputError);
  EXPECT_TRUE(closest_distances(context(), good, {}).empty());
}

TEST(Metro, OneSampleIsEnoughToBeSmall) {
  const MetroReport report = measure_metro(context(), unit_cube(Vec3::Zero()), unit_cube(Vec3::Zero()), {.samples = 1});
  EXPECT_LT(report.forward.max, 1e-7);
}

}  // namespace skeletex
