// SPDX-License-Identifier: MIT
#include "skeletex/convert/parameterize/vsm.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <filesystem>
#include <limits>
#include <numbers>
#include <numeric>

#include "skeletex/convert/parameterize/direct_map.h"
#include "skeletex/convert/segment/segment_mesh.h"
#include "support/load_model.h"
#include "support/segments.h"
#include "support/vsm_twin.h"

namespace skeletex {
namespace {

using namespace skeletex::testing;

ClContext& context() {
  static ClContext the_context;
  return the_context;
}

Chart chart_of(const MadeSegment& made) {
  return make_chart(made.segment, made.skeleton, SeparationPlanes(made.skeleton));
}

std::vector<std::pair<std::string, MadeSegment>> all_kinds_of_segments() {
  std::vector<std::pair<std::string, MadeSegment>> all;
  std::mt19937 random(7);
  all.emplace_back("cylinder", revolve(cylinder_profile(9), {.columns = 12}));
  all.emplace_back("smallest tube", revolve(cylinder_profile(2), {.columns = 3}));
  all.emplace_back("noisy mushroom", revolve(mushroom_profile(25),
                                             {.columns = 17, .noise = 0.2, .has_random_diagonals = true, .seed = 3}));
  all.emplace_back("twisted tube",
                   revolve(cylinder_profile(31), {.columns = 12, .twist_turns = 2.3, .has_random_diagonals = true}));
  all.emplace_back("noisy cap", revolve(cap_profile(25), {.columns = 21, .noise = 0.1, .seed = 5}));
  all.emplace_back("capsule", revolve(capsule_profile(22), {.columns = 18, .noise = 0.02}));
  MadeSegment rough = revolve(mushroom_profile(12), {.columns = 12, .noise = 0.1});
  flip_random_edges(rough.segment, 400, random);
  insert_random_vertices(rough.segment, 300, random);
  raise_degree(rough.segment, 40, 60);
  raise_degree(rough.segment, rough.segment.loops[0].vertices[3], 30);
  all.emplace_back("flipped edges, slivers, degrees 3 to 60", rough);
  MadeSegment cap = revolve(cap_profile(12), {.columns = 12, .noise = 0.05});
  flip_random_edges(cap.segment, 300, random);
  insert_random_vertices(cap.segment, 200, random);
  for (int i = 0; i < 20; ++i)
    cap.segment.mesh.positions[random() % 100] = cap.segment.mesh.positions[random() % 100];  // no surface area
  for (const int v : cap.segment.loops[0].vertices)
    cap.segment.mesh.positions[v] = revolve(cap_profile(12), {.columns = 12}).segment.mesh.positions[v];
  all.emplace_back("rough cap with triangles of no area", cap);
  MadeSegment hub = revolve(cap_profile(12), {.columns = 200});
  hub.skeleton.nodes[2].position = {0.4, 0.1, 1.0};
  all.emplace_back("an inner vertex with 200 neighbours", hub);
  return all;
}

/// Largest difference of two maps of one chart, relative to the mean length of the second map's edges at that vertex.
double relative_difference(const Chart& a, const Chart& b) {
  std::vector<double> total(b.v.size(), 0), edges(b.v.size(), 0);
  for (const TwinEdge& e : twin_edges(b)) {
    if (is_twin_pole(b.kinds[e.i]) || is_twin_pole(b.kinds[e.j])) continue;
    const double length = std::hypot(b.u[e.j] - b.u[e.i], b.v[e.j] - b.v[e.i] + e.jump);
    for (const int i : {e.i, e.j}) total[i] += length, ++edges[i];
  }
  double shift = 0;  // a lone bone's v turns freely
  if (b.topology == SegmentTopology::kSphere) {
    int count = 0;
    for (std::size_t i = 0; i < b.v.size(); ++i)
      if (b.kinds[i] == ChartVertex::kInner) shift += a.v[i] - b.v[i], ++count;
    shift /= count;
  }
  double largest = 0;
  for (std::size_t i = 0; i < b.v.size(); ++i)
    if (b.kinds[i] == ChartVertex::kInner)
      largest = std::max(largest, std::hypot(a.u[i] - b.u[i], a.v[i] - b.v[i] - shift) * edges[i] / total[i]);
  return largest;
}

// Tutte and Floater: whatever the weights, the map is a bijection onto the rectangle.
TEST(Vsm, NoTriangleIsFlippedAndTheRectangleIsFilled) {
  for (const auto& [name, made] : all_kinds_of_segments())
    for (const int iterations : {0, 1, 4, 12})
      for (const double alpha : {0.0, 0.5}) {
        SCOPED_TRACE(name + ", iterations " + std::to_string(iterations) + ", alpha " + std::to_string(alpha));
        std::vector<Chart> charts{chart_of(made)};
        const auto report = solve_vsm(context(), charts, {.iterations = iterations, .alpha = alpha}).at(0);
        EXPECT_EQ(count_flipped(charts[0]), 0);
        EXPECT_EQ(report.flipped_triangles, 0);
        EXPECT_EQ(report.iterations, iterations);
        EXPECT_FALSE(report.used_direct_solver) << report.solver_steps << " steps, residual " << report.residual;
        const std::vector<double> areas = texture_areas(charts[0]);
        EXPECT_NEAR(std::accumulate(areas.begin(), areas.end(), 0.0), 1, 1e-9);
      }
}

// Single precision on the device against a sparse factorization in double precision, both solved to the end. With
// reweighting the weights' own rounding (1e-7 each, amplified by the spread of areas) comes in.
TEST(Vsm, AgreesWithADirectSolutionInDoublePrecision) {
  for (const auto& [name, made] : all_kinds_of_segments())
    for (const int iterations : {0, 1, 4}) {
      SCOPED_TRACE(name + ", iterations " + std::to_string(iterations));
      std::vector<Chart> charts{chart_of(made)};
      Chart expected = charts[0];
      const auto report =
          solve_vsm(context(), charts, {.iterations = iterations, .tolerance = 1e-6, .intermediate_tolerance = 1e-6})
              .at(0);
      EXPECT_LE(report.residual, 1e-6);
      twin_vsm(expected, iterations, 0.5);
      EXPECT_LT(relative_difference(charts[0], expected), iterations == 0 ? 1e-3 : 2e-3);
    }
}

TEST(Vsm, ARegularCylinderMapsToHeightAndAngle) {
  std::vector<Chart> charts{chart_of(revolve(cylinder_profile(21), {.columns = 24}))};
  solve_vsm(context(), charts, {.iterations = 0, .tolerance = 1e-6});
  for (int k = 0; k < 21; ++k)
    for (int j = 0; j < 24; ++j) {
      EXPECT_NEAR(charts[0].u[24 * k + j], k / 20.0, 1e-6);
      EXPECT_NEAR(std::remainder(charts[0].v[24 * k + j] - j / 24.0, 1.0), 0, 1e-6);
    }
}

TEST(Vsm, ReweightingEvensOutAreas) {
  const Chart chart =
      chart_of(revolve(cap_profile(40), {.columns = 30, .noise = 0.05, .has_random_diagonals = true, .seed = 3}));
  double last = HUGE_VAL;
  for (const int iterations : {0, 1, 2, 4, 8, 12}) {
    std::vector<Chart> charts{chart};
    const double spread = solve_vsm(context(), charts, {.iterations = iterations, .alpha = 0})[0].spread;
    EXPECT_LT(spread, iterations == 1 ? 0.5 * last : last) << iterations;
    last = spread;
  }
}

// Where every row of triangles is alike, weights in proportion to the areas even the rows out at once and stay so.
TEST(Vsm, OneReweightingEvensOutARegularCapCompletely) {
  const Chart chart = chart_of(revolve(cap_profile(40), {.columns = 30}));
  for (const int iterations : {1, 2, 12}) {
    std::vector<Chart> charts{chart};
    const auto report =
        solve_vsm(context(), charts,
                  {.iterations = iterations, .alpha = 0, .tolerance = 1e-5, .intermediate_tolerance = 1e-5})[0];
    EXPECT_LT(report.spread, 1e-4) << iterations;
  }
}

TEST(Vsm, StopsWhenTheSpreadHasSettled) {
  std::vector<Chart> charts{chart_of(revolve(cylinder_profile(30), {.columns = 20, .noise = 0.01})),
                            chart_of(revolve(mushroom_profile(30), {.columns = 20}))};
  std::vector<Chart> free = charts;
  const auto reports = solve_vsm(context(), charts, {.iterations = 30, .stop_spread_change = 0.05});
  for (std::size_t k = 0; k < charts.size(); ++k) {
    EXPECT_GT(reports[k].iterations, 0);
    EXPECT_LT(reports[k].iterations, 30);
    EXPECT_EQ(count_flipped(charts[k]), 0);
    std::vector<Chart> alone{free[k]};
    const auto report = solve_vsm(context(), alone, {.iterations = reports[k].iterations, .tolerance = 1e-4}).at(0);
    EXPECT_NEAR(report.spread, reports[k].spread, 0.01 * report.spread);
  }
}

TEST(Vsm, ChartsDoNotInfluenceEachOther) {
  // So many, that on a CPU one work-item takes all of a chart; one alone is shared.
  std::vector<Chart> before, together;
  for (const auto& [name, made] : all_kinds_of_segments()) before.push_back(chart_of(made));
  const int copies = 4 * context().device().compute_units;
  for (int i = 0; i < copies; ++i) together.insert(together.end(), before.begin(), before.end());
  solve_vsm(context(), together);
  for (std::size_t k = 0; k < before.size(); ++k) {
    std::vector<Chart> alone{before[k]};
    solve_vsm(context(), alone);
    EXPECT_EQ(alone[0].u, together[k].u);
    EXPECT_EQ(alone[0].v, together[k].v);
  }
}

TEST(Vsm, TheSameInputGivesTheSameBitsAndEveryWorkGroupSizeTheSameMap) {
  const std::vector<Chart> before{chart_of(revolve(mushroom_profile(25), {.columns = 30, .noise = 0.05})),
                                  chart_of(revolve(cap_profile(8), {.columns = 9})),
                                  chart_of(revolve(cylinder_profile(2), {.columns = 3}))};
  VsmOptions exact{.iterations = 2, .tolerance = 1e-6, .intermediate_tolerance = 1e-6, .work_group_size = 1};
  std::vector<Chart> alone = before;
  solve_vsm(context(), alone, exact);
  for (const int size : {1, 8}) {  // plain loops, and work-items that meet at barriers
    SCOPED_TRACE(size);
    exact.work_group_size = size;
    std::vector<Chart> first = before, second = before;
    solve_vsm(context(), first, exact);
    solve_vsm(context(), second, exact);
    for (std::size_t k = 0; k < before.size(); ++k) {
      EXPECT_EQ(first[k].u, second[k].u);
      EXPECT_EQ(first[k].v, second[k].v);
      EXPECT_LT(relative_difference(first[k], alone[k]), 2e-3);
    }
  }
}

TEST(Vsm, MovingTurningScalingAndRenumberingChangeNothing) {
  std::mt19937 random(3);
  const VsmOptions exact{.iterations = 3, .tolerance = 1e-6, .intermediate_tolerance = 1e-6};
  for (const auto& [name, made] : all_kinds_of_segments()) {
    SCOPED_TRACE(name);
    MadeSegment other = made;
    transform(other, Eigen::AngleAxisd(2.1, Vec3(1, 2, -1).normalized()).toRotationMatrix(), 37.5, Vec3(4, -9, 100));
    std::vector<Chart> charts{chart_of(made)}, moved{chart_of(other)};
    solve_vsm(context(), charts, exact);
    solve_vsm(context(), moved, exact);
    ASSERT_EQ(charts[0].triangles, moved[0].triangles);
    moved[0].turns = charts[0].turns;  // the cut may lie elsewhere
    for (std::size_t i = 0; i < charts[0].v.size(); ++i)
      moved[0].v[i] = charts[0].v[i] + std::remainder(moved[0].v[i] - charts[0].v[i], 1.0);
    EXPECT_LT(relative_difference(moved[0], charts[0]), 5e-3);

    if (made.segment.topology == SegmentTopology::kSphere) continue;
    MadeSegment shuffled = made;
    const std::vector<int> new_index = renumber(shuffled.segment, random);
    std::vector<Chart> again{chart_of(shuffled)};
    solve_vsm(context(), again, exact);
    Chart sorted = charts[0];
    for (std::size_t i = 0; i < new_index.size(); ++i) {
      sorted.u[i] = again[0].u[new_index[i]];
      sorted.v[i] = charts[0].v[i] + std::remainder(again[0].v[new_index[i]] - charts[0].v[i], 1.0);
    }
    EXPECT_LT(relative_difference(sorted, charts[0]), 5e-3);
  }
}

TEST(Vsm, AnUnfinishedSolutionIsReplacedByADirectOne) {
  for (const auto& [name, made] : all_kinds_of_segments()) {
    SCOPED_TRACE(name);
    std::vector<Chart> charts{chart_of(made)};
    for (std::size_t i = 0; i < charts[0].u.size(); ++i)
      if (charts[0].kinds[i] == ChartVertex::kInner) charts[0].u[i] = charts[0].v[i] = 0.3;  // a bad guess
    Chart expected = charts[0];
    const auto report = solve_vsm(context(), charts, {.iterations = 2, .max_steps = 0}).at(0);
    EXPECT_EQ(report.used_direct_solver,
              std::count(expected.kinds.begin(), expected.kinds.end(), ChartVertex::kInner) > 0);
    EXPECT_EQ(report.solver_steps, 0);
    EXPECT_EQ(report.flipped_triangles, 0);
    twin_vsm(expected, 2, 0.5);
    EXPECT_LT(relative_difference(charts[0], expected), 1e-6);
  }
}

/// Draws the last triangle out to a finger of `rings` rings of three vertices.
void draw_finger(TriangleMesh& mesh, int rings) {
  for (int ring = 0; ring < rings; ++ring) {
    const Triangle base = mesh.triangles.back();
    const auto [a, b, c] = base;
    const Vec3 out = (mesh.positions[b] - mesh.positions[a]).cross(mesh.positions[c] - mesh.positions[a]).normalized();
    const int first = static_cast<int>(mesh.positions.size());
    for (const int vertex : base) mesh.positions.push_back(mesh.positions[vertex] + 0.05 * out);
    mesh.triangles.pop_back();
    for (int i = 0; i < 3; ++i) {
      const int next = (i + 1) % 3;
      mesh.triangles.push_back({base[i], base[next], first + next});
      mesh.triangles.push_back({base[i], first + next, first + i});
    }
    mesh.triangles.push_back({first, first + 1, first + 2});
  }
}

TEST(Vsm, WhatNoReweightingHelpsKeepsTheMapWithTheFewestFlips) {
  // Every ring of the finger is a fraction as large in the map as the one below it: soon too small for the numbers.
  MadeSegment made = revolve(cylinder_profile(9), {.columns = 12});
  std::swap(made.segment.mesh.triangles[100], made.segment.mesh.triangles.back());
  draw_finger(made.segment.mesh, 60);
  int flipped = std::numeric_limits<int>::max();
  for (const int iterations : {0, 1, 2, 12}) {
    Chart chart = chart_of(made);
    EXPECT_LE(map_directly(chart, iterations, 0.5), iterations);
    EXPECT_LE(count_flipped(chart), flipped);
    flipped = count_flipped(chart);
  }
  EXPECT_GT(flipped, 0);
}

TEST(Vsm, NoChartsAreNoWork) { EXPECT_TRUE(solve_vsm(context(), {}).empty()); }

std::vector<Chart> charts_of_model(const std::string& name) {
  const TestModel model = load_standard_model(name);
  const SeparationPlanes separation(model.skeleton);
  std::vector<Chart> charts;
  for (const Segment& segment : segment_mesh(context(), model.mesh, model.skeleton).segments)
    charts.push_back(make_chart(segment, model.skeleton, separation));
  return charts;
}

TEST(Vsm, RealModelsAreMappedWithoutFlipsByTheDeviceAlone) {
  for (const auto& file : std::filesystem::directory_iterator(SKELETEX_SOURCE_DIR "/configs/models")) {
    SCOPED_TRACE(file.path().stem().string());
    std::vector<Chart> charts = charts_of_model(file.path().stem());
    const auto reports = solve_vsm(context(), charts);
    for (std::size_t k = 0; k < charts.size(); ++k) {
      SCOPED_TRACE("bone " + std::to_string(charts[k].bone));
      EXPECT_EQ(count_flipped(charts[k]), 0);
      EXPECT_FALSE(reports[k].used_direct_solver);
      EXPECT_LT(reports[k].spread, 4);
    }
  }
}

// Twelve reweightings spread the weights of one chart over more than a float's range. Each map is solved all the same.
TEST(Vsm, RealModelsAreMappedWithoutFlipsByAnyRecipe) {
  for (const char* name : {"armadillo", "bull", "bull_16", "knot1", "triceratops"}) {
    const std::vector<Chart> before = charts_of_model(name);
    for (const double alpha : {0.0, 0.5})
      for (const int iterations : {0, 1, 12}) {
        SCOPED_TRACE(std::string(name) + ", iterations " + std::to_string(iterations) + ", alpha " +
                     std::to_string(alpha));
        std::vector<Chart> charts = before;
        const auto reports = solve_vsm(context(), charts, {.iterations = iterations, .alpha = alpha});
        for (std::size_t k = 0; k < charts.size(); ++k) {
          SCOPED_TRACE("bone " + std::to_string(charts[k].bone));
          EXPECT_EQ(count_flipped(charts[k]), 0);
          EXPECT_LE(reports[k].residual, VsmOptions().tolerance);
          EXPECT_FALSE(reports[k].used_direct_solver);
        }
      }
  }
}

}  // namespace
}  // namespace skeletex
