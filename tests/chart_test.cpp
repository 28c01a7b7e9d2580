// SPDX-License-Identifier: MIT
#include "skeletex/convert/parameterize/chart.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <map>
#include <numbers>
#include <numeric>

#include "skeletex/model/error.h"
#include "support/segments.h"
#include "support/vsm_twin.h"

namespace skeletex {
namespace {

using namespace skeletex::testing;

struct NamedSegment {
  std::string name;
  MadeSegment made;
};

std::vector<NamedSegment> all_kinds_of_segments() {
  std::vector<NamedSegment> all;
  const auto add = [&](const std::string& name, MadeSegment made) { all.push_back({name, std::move(made)}); };
  std::mt19937 random(7);
  add("cylinder", revolve(cylinder_profile(9), {.columns = 12}));
  add("smallest tube", revolve(cylinder_profile(2), {.columns = 3}));
  add("noisy mushroom",
      revolve(mushroom_profile(15), {.columns = 17, .noise = 0.2, .has_random_diagonals = true, .seed = 3}));
  add("twisted tube", revolve(cylinder_profile(31), {.columns = 12, .twist_turns = 2.3, .has_random_diagonals = true}));
  add("cap with a vertex at the pole", revolve(cap_profile(12), {.columns = 10}));
  add("noisy cap", revolve(cap_profile(15), {.columns = 11, .noise = 0.1, .seed = 5}));
  add("capsule", revolve(capsule_profile(12), {.columns = 8}));
  MadeSegment rough = revolve(mushroom_profile(12), {.columns = 12, .noise = 0.1});
  flip_random_edges(rough.segment, 400, random);
  insert_random_vertices(rough.segment, 300, random);
  raise_degree(rough.segment, 40, 60);
  raise_degree(rough.segment, rough.segment.loops[0].vertices[3], 30);
  add("flipped edges, slivers, degrees 3 to 60", rough);
  MadeSegment cap = revolve(cap_profile(12), {.columns = 12, .noise = 0.05});
  flip_random_edges(cap.segment, 300, random);
  insert_random_vertices(cap.segment, 100, random);
  add("rough cap", cap);
  MadeSegment tilted = revolve(cap_profile(15), {.columns = 12});
  tilted.skeleton.nodes[2].position = {0.21, 0.13, 1.0};  // the ray leaves the cap inside some triangle
  add("pole inside a triangle", tilted);
  MadeSegment hub = revolve(cap_profile(12), {.columns = 200});
  hub.skeleton.nodes[2].position = {0.4, 0.1, 1.0};
  add("an inner vertex with 200 neighbours", hub);
  return all;
}

Chart chart_of(const MadeSegment& made) {
  return make_chart(made.segment, made.skeleton, SeparationPlanes(made.skeleton));
}

double surface(const Chart& chart) {
  TriangleMesh mesh{chart.positions, chart.triangles};
  return surface_area(mesh);
}

TEST(Chart, LiftedDifferencesAgreeAcrossEveryEdge) {
  for (const auto& [name, made] : all_kinds_of_segments()) {
    SCOPED_TRACE(name);
    const Chart chart = chart_of(made);
    std::map<std::pair<int, int>, int> seen;
    for (std::size_t t = 0; t < chart.triangles.size(); ++t)
      for (int c = 0; c < 3; ++c) {
        const int d = (c + 1) % 3, i = chart.triangles[t][c], j = chart.triangles[t][d];
        if (is_pole(chart.kinds[i]) || is_pole(chart.kinds[j])) continue;
        seen[{i, j}] = chart.turns[t][d] - chart.turns[t][c];
      }
    for (const auto& [edge, jump] : seen)
      if (const auto twin = seen.find({edge.second, edge.first}); twin != seen.end()) {
        EXPECT_EQ(twin->second, -jump);
      }
  }
}

TEST(Chart, RowsWindOnceInStrictlyGrowingSteps) {
  for (const auto& [name, made] : all_kinds_of_segments()) {
    SCOPED_TRACE(name);
    const Chart chart = chart_of(made);
    for (const int e : {0, 1}) {
      const auto& loop = made.segment.loops[e].vertices;
      std::map<std::pair<int, int>, double> step;
      for (std::size_t t = 0; t < chart.triangles.size(); ++t)
        for (int c = 0; c < 3; ++c)
          for (const int d : {(c + 1) % 3, (c + 2) % 3}) {
            const int i = chart.triangles[t][c], j = chart.triangles[t][d];
            step[{i, j}] = chart.v[j] + chart.turns[t][d] - chart.v[i] - chart.turns[t][c];
          }
      double total = 0;
      for (std::size_t k = 0; k < loop.size(); ++k) {
        const double s = step.at({loop[k], loop[(k + 1) % loop.size()]});
        EXPECT_GT(s, 0);
        total += s;
        EXPECT_EQ(chart.u[loop[k]], e);
        EXPECT_GE(chart.v[loop[k]], 0);
        EXPECT_LT(chart.v[loop[k]], 1);
      }
      if (!loop.empty()) {
        EXPECT_NEAR(total, 1, 1e-12);
      }
    }
  }
}

TEST(Chart, RowsTakeTheAngleAboutTheBone) {
  for (const auto& [name, made] : all_kinds_of_segments()) {
    SCOPED_TRACE(name);
    const SeparationPlanes separation(made.skeleton);
    const Chart chart = make_chart(made.segment, made.skeleton, separation);
    for (const int e : {0, 1})
      for (const int v : made.segment.loops[e].vertices) {
        const double angle = separation.turn_of(
            made.bone(), chart.positions[v] - end_position(made.skeleton, made.bone(), static_cast<BoneEnd>(e)));
        EXPECT_NEAR(std::remainder(chart.v[v] - angle, 1.0), 0, 1e-15);
      }
  }
}

TEST(Chart, SurfaceAndTopologyAreThoseOfTheSegment) {
  for (const auto& [name, made] : all_kinds_of_segments()) {
    SCOPED_TRACE(name);
    const Chart chart = chart_of(made);
    EXPECT_NEAR(surface(chart), surface_area(made.segment.mesh), 1e-12 * surface(chart));
    const int edges = static_cast<int>(twin_edges(chart).size());
    const int euler = static_cast<int>(chart.positions.size()) - edges + static_cast<int>(chart.triangles.size());
    const int poles = static_cast<int>(std::count_if(chart.kinds.begin(), chart.kinds.end(), is_pole));
    EXPECT_EQ(euler, poles);
    EXPECT_EQ(poles, made.segment.topology == SegmentTopology::kAnnulus ? 0
                     : made.segment.topology == SegmentTopology::kDisk  ? 1
                                                                        : 2);
    for (const TwinEdge& e : twin_edges(chart)) {
      EXPECT_LE(e.triangles.size(), 2u);
      if (e.triangles.size() == 2) {
        EXPECT_FALSE(chart.kinds[e.i] == chart.kinds[e.j] && chart.kinds[e.i] != ChartVertex::kInner);
      }
    }
  }
}

// Tutte, with any positive weights: the strongest statement about turns, rows, poles and chords at once.
TEST(Chart, UnitWeightsGiveABijectionOfTheWholeRectangle) {
  for (const auto& [name, made] : all_kinds_of_segments()) {
    SCOPED_TRACE(name);
    Chart chart = chart_of(made);
    twin_vsm(chart, 0, 0);
    EXPECT_EQ(count_flipped(chart), 0);
    const std::vector<double> areas = texture_areas(chart);
    EXPECT_NEAR(std::accumulate(areas.begin(), areas.end(), 0.0), 1, 1e-12);
  }
}

// A tube whose vertices wind 2.3 times around: u = height, v = angle is its barycentric map; a wrong count of turns
// between the rows would give another one, just as free of flips.
TEST(Chart, TurnsBetweenTheRowsFollowTheSurface) {
  for (const double twist : {0.0, 0.4, 0.5, 1.0, -2.3, 7.7}) {
    SCOPED_TRACE(twist);
    MadeSegment made = revolve(cylinder_profile(61), {.columns = 12, .twist_turns = twist});
    Chart chart = chart_of(made);
    twin_vsm(chart, 0, 0);
    EXPECT_EQ(count_flipped(chart), 0);
    for (int k = 0; k < 61; ++k)
      for (int j = 0; j < 12; ++j) {
        EXPECT_NEAR(chart.u[12 * k + j], k / 60.0, 1e-9);
        EXPECT_NEAR(std::remainder(chart.v[12 * k + j] - j / 12.0 - twist * k / 60, 1.0), 0, 1e-9);
      }
  }
}

TEST(Chart, ALoopThatTurnsBackIsMadeStrictlyGrowingAndStaysNear) {
  MadeSegment made = revolve(cylinder_profile(8), {.columns = 20});
  for (const double back : {0.02, 0.04, 0.11}) {
    auto& positions = made.segment.mesh.positions;
    const double turn = 4.0 / 20 - back;  // vertex 4 steps back behind vertex 3 (and 2)
    positions[4] = 1.3 * Vec3(std::cos(2 * std::numbers::pi * turn), std::sin(2 * std::numbers::pi * turn), 0);
    Chart chart = chart_of(made);
    for (int j = 0; j + 1 < 20; ++j) EXPECT_LT(chart.v[j], chart.v[j + 1]);
    for (int j = 0; j < 20; ++j) EXPECT_NEAR(chart.v[j], j == 4 ? turn : j / 20.0, 0.08);
    EXPECT_EQ(chart.v[10], 0.5);
    twin_vsm(chart, 0, 0);
    EXPECT_EQ(count_flipped(chart), 0);
  }
}

TEST(Chart, LinksThatCloseARowInOneTriangleAreSplit) {
  // The corner cut off by an edge between two row vertices, and a second one over it.
  MadeSegment made = revolve(cylinder_profile(4), {.columns = 8});
  auto& mesh = made.segment.mesh;
  auto& loop = made.segment.loops[0].vertices;
  const auto add_ear = [&](std::size_t k) {
    const int a = loop[k], b = loop[k + 1], v = static_cast<int>(mesh.positions.size());
    const Vec3 middle = 0.5 * (mesh.positions[a] + mesh.positions[b]);
    mesh.positions.push_back(Vec3(1.5 * middle.x(), 1.5 * middle.y(), 0));
    made.segment.source_vertices.push_back(v);
    mesh.triangles.push_back({a, v, b});
    loop.insert(loop.begin() + static_cast<std::ptrdiff_t>(k) + 1, v);
  };
  add_ear(2);
  add_ear(2);
  add_ear(4);
  add_ear(7);
  Chart chart = chart_of(made);
  EXPECT_GE(chart.positions.size(), mesh.positions.size() + 4);
  for (const TwinEdge& e : twin_edges(chart))
    if (e.triangles.size() == 2) {
      EXPECT_FALSE(chart.kinds[e.i] == ChartVertex::kHeadRow && chart.kinds[e.j] == ChartVertex::kHeadRow);
    }
  twin_vsm(chart, 0, 0);
  EXPECT_EQ(count_flipped(chart), 0);
}

TEST(Chart, PolesLieWhereTheBoneLeavesTheSurface) {
  for (const double x : {0.0, 1e-7, 0.05, 0.31}) {
    MadeSegment made = revolve(cap_profile(15), {.columns = 12});
    made.skeleton.nodes[2].position = {x, x / 3, 1.0};
    const Chart chart = chart_of(made);
    const auto pole = std::find(chart.kinds.begin(), chart.kinds.end(), ChartVertex::kTailPole) - chart.kinds.begin();
    ASSERT_LT(pole, static_cast<int>(chart.positions.size()));
    const Vec3 o = Vec3(x, x / 3, 1).normalized(), p = chart.positions[pole] - made.skeleton.nodes[2].position;
    EXPECT_GT(p.dot(o), 0.5);
    EXPECT_LT((p - p.dot(o) * o).norm(), 1e-3);
  }
}

TEST(Chart, TheLastOfSeveralHitsIsThePole) {
  // A cap with a dent: along the axis only its bottom is hit; moved aside, the ray meets the fold three times.
  std::vector<ProfilePoint> profile = {{1, 0},     {1, 0.5},   {1, 1},     {0.8, 2},
                                       {0.6, 1.2}, {0.4, 2.2}, {0.2, 2.3}, {0, 2.4}};
  profile[4] = {0.75, 2.6};
  profile[5] = {0.2, 2.1};
  profile[6] = {0.5, 3.0};
  MadeSegment made = revolve(profile, {.columns = 16});
  made.skeleton.nodes[1].position = {0.27, 0.01, 0};
  made.skeleton.nodes[2].position = {0.27, 0.01, 1};
  const Chart chart = chart_of(made);
  const auto pole = std::find(chart.kinds.begin(), chart.kinds.end(), ChartVertex::kTailPole) - chart.kinds.begin();
  EXPECT_GT(chart.positions[pole].z(), 2.6);
}

TEST(Chart, AFreeEndThatPointsPastItsSurfaceIsNamed) {
  MadeSegment made = revolve(cap_profile(15), {.columns = 12});
  made.skeleton.nodes[2].position = {5, 0, 1};
  made.skeleton.nodes[2].name = "tip";
  made.skeleton.bones[1].name = "tail bone";
  try {
    chart_of(made);
    FAIL();
  } catch (const TopologyError& error) {
    EXPECT_NE(std::string(error.what()).find("tail bone"), std::string::npos);
    EXPECT_NE(std::string(error.what()).find("tip"), std::string::npos);
  }
}

TEST(Chart, ARigidMotionChangesNothingButPositions) {
  for (const auto& [name, made] : all_kinds_of_segments()) {
    SCOPED_TRACE(name);
    const Chart before = chart_of(made);
    MadeSegment moved = made;
    transform(moved, Eigen::AngleAxisd(1.1, Vec3(1, 2, -1).normalized()).toRotationMatrix(), 37.5, Vec3(4, -9, 100));
    const Chart after = chart_of(moved);
    ASSERT_EQ(before.triangles, after.triangles);
    for (std::size_t i = 0; i < before.v.size(); ++i)
      if (before.kinds[i] == ChartVertex::kHeadRow || before.kinds[i] == ChartVertex::kTailRow) {
        EXPECT_NEAR(std::remainder(before.v[i] - after.v[i], 1.0), 0, 1e-12);
      }
  }
}

TEST(Chart, RenumberingChangesTheMapByWholeTurnsOnly) {
  std::mt19937 random(11);
  for (const auto& [name, made] : all_kinds_of_segments()) {
    if (made.segment.topology == SegmentTopology::kSphere) continue;  // a lone bone's v turns freely
    SCOPED_TRACE(name);
    MadeSegment other = made;
    const std::vector<int> new_index = renumber(other.segment, random);
    Chart a = chart_of(made), b = chart_of(other);
    twin_vsm(a, 0, 0);
    twin_vsm(b, 0, 0);
    for (std::size_t i = 0; i < made.segment.mesh.positions.size(); ++i) {
      if (is_pole(a.kinds[i])) continue;
      EXPECT_NEAR(a.u[i], b.u[new_index[i]], 1e-8);
      EXPECT_NEAR(std::remainder(a.v[i] - b.v[new_index[i]], 1.0), 0, 1e-8);
    }
  }
}

}  // namespace
}  // namespace skeletex
