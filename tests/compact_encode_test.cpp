// SPDX-License-Identifier: MIT
#include <gtest/gtest.h>

#include <algorithm>

#include "skeletex/analysis/metro.h"
#include "skeletex/compact/compact_file.h"
#include "skeletex/compact/decode_model.h"
#include "skeletex/compact/encode/reduce_intersections.h"
#include "skeletex/compact/encode/search_compact.h"
#include "skeletex/compact/refine.h"
#include "skeletex/convert/encode_model.h"
#include "skeletex/geometry/self_intersection.h"
#include "skeletex/reconstruct/reconstruct_mesh.h"
#include "support/load_model.h"
#include "support/synthetic_model.h"

namespace skeletex {
namespace {

ClContext& context() {
  static ClContext context;
  return context;
}

/// The bear as its compact file is made from it.
struct Bear {
  SkeletexModel model;
  SourceSurface source;
};
const Bear& bear() {
  static const Bear result = [] {
    const TestModel test = load_standard_model("bear");
    EncodeOptions options;
    options.method = Method::kVsm;
    options.width = options.height = 512;
    Bear made{in_unit_frame(encode_model(context(), test.mesh, test.skeleton, options).model), {}};
    made.source = source_surface(context(), PreparedModel(made.model));
    return made;
  }();
  return result;
}

/// About what an error of 1e-4 takes.
CompactOptions usual_options() {
  CompactOptions options;
  options.step = 2.2e-4;
  options.bare_levels = 4;
  return options;
}

TriangleMesh mesh_of(const CompactModel& compact) { return reconstruct_mesh(context(), decode_model(compact)); }
double mean_distance(const CompactModel& compact) {
  const TriangleMesh original = reconstruct_mesh(context(), bear().model);
  return SymmetricMetro(context(), original, 100'000).measure(mesh_of(compact)).mean;
}

TEST(ReduceIntersections, LeavesFewOfThemAndNoLargerError) {
  CompactOptions options = usual_options();
  CompactModel compact = encode_compact(bear().model, bear().source, options);
  const std::size_t before = find_self_intersections(mesh_of(compact)).size();
  const double mean = mean_distance(compact);
  ASSERT_GT(before, 20u);
  reduce_intersections(context(), bear().model, bear().source, options, compact);
  EXPECT_LE(find_self_intersections(mesh_of(compact)).size(), before / 2);
  EXPECT_LE(mean_distance(compact), 1.005 * mean);
  EXPECT_EQ(compact_bytes(encode_compact(bear().model, bear().source, options)), compact_bytes(compact));
}

TEST(ReduceIntersections, ChangesNothingWhereThereAreNone) {
  const SyntheticSurface surface(lone_bone(), 0.2);
  const SkeletexModel model = in_unit_frame(surface.model({{96, 96}}));
  const SourceSurface source = source_surface(context(), PreparedModel(model));
  CompactOptions options;
  options.size = 128;
  CompactModel compact = encode_compact(model, source, options);
  const std::string bytes = compact_bytes(compact);
  reduce_intersections(context(), model, source, options, compact);
  EXPECT_EQ(compact_bytes(compact), bytes);
  EXPECT_TRUE(options.fixed_places.empty());
}

TEST(ResidualOptions, PointsThatAreNearEnoughNeedNoNumbersAlongTheSurface) {
  const auto tangential_count = [](const CompactModel& compact) {
    std::ptrdiff_t count = 0;
    for (const CompactPatch& patch : compact.patches)
      for (const StepResiduals& step : patch.steps)
        count += std::count_if(step.side.begin(), step.side.end(), [](int value) { return value != 0; });
    return count;
  };
  CompactOptions options = usual_options();
  const CompactModel with = encode_compact(bear().model, bear().source, options);
  options.residuals.near_enough = 0;
  const CompactModel without = encode_compact(bear().model, bear().source, options);
  EXPECT_LT(tangential_count(with), tangential_count(without));
  EXPECT_LT(compact_bytes(with).size(), compact_bytes(without).size());
  EXPECT_LT(mean_distance(with), 1.05 * mean_distance(without));
}

/// Without the limit one of the horns vanishes between coarse samples: 0.058.
TEST(CompactSearch, KeepsHornsOfAVerySmallFile) {
  const TestModel test = load_standard_model("triceratops_17");
  EncodeOptions options;
  options.method = Method::kVsm;
  options.width = options.height = 512;
  const SkeletexModel model = encode_model(context(), test.mesh, test.skeleton, options).model;
  CompactGoal goal;
  goal.max_error = 1e-3;
  const CompactResult result = search_compact(context(), model, nullptr, goal);
  EXPECT_LE(result.mean, 1.02e-3);
  EXPECT_LT(result.max, 0.021);
  EXPECT_LT(result.bytes.size(), 2500u);
}

/// A tube of unit radius, whose rows are a quarter apart.
PatchGrid tube() {
  PatchGrid grid{4, 8, {false, false}, {}};
  for (int row = 0; row <= grid.intervals; ++row)
    for (int column = 0; column < grid.columns; ++column) {
      const double turn = 2 * M_PI * column / grid.columns;
      grid.points.emplace_back(std::cos(turn), std::sin(turn), 0.25 * row);
    }
  return grid;
}
/// \param bump  added to a new point of the first row
std::vector<Site> sites_with_bump(const PatchGrid& grid, const Vec3& bump) {
  const EndRow row = [&](BoneEnd end, int columns) {
    std::vector<Vec3> points;
    for (int column = 0; column < columns; ++column) {
      const double turn = 2 * M_PI * column / columns;
      points.emplace_back(std::cos(turn), std::sin(turn), end == BoneEnd::kHead ? 0 : 1);
    }
    if (end == BoneEnd::kHead) points[3] += bump;
    return points;
  };
  return Refinement(grid, false, row).sites();
}

TEST(Refinement, FollowsTheEndsLessTheFurtherAwayTheyAre) {
  const PatchGrid grid = tube();
  const Vec3 bump(0.1, 0.2, -0.3);
  const std::vector<Site> plain = sites_with_bump(grid, Vec3::Zero()), moved = sites_with_bump(grid, bump);
  double last = 1;
  for (std::size_t i = 0; i < plain.size(); ++i) {
    const Vec3 move = moved[i].predicted - plain[i].predicted;
    if (plain[i].column != 3) {
      EXPECT_EQ(move, Vec3(Vec3::Zero()));
      continue;
    }
    const double share = move.norm() / bump.norm();
    EXPECT_LT((move - share * bump).norm(), 1e-12);
    EXPECT_LT(share, last);
    EXPECT_GT(share, 0);
    last = share;
  }
  EXPECT_LT(last, 0.1);
}

}  // namespace
}  // namespace skeletex
