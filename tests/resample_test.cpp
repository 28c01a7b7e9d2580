// SPDX-License-Identifier: MIT
#include "skeletex/convert/resample/resample.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>
#include <random>

#include "reconstruct_structs.h"
#include "skeletex/analysis/metro.h"
#include "skeletex/convert/encode_model.h"
#include "skeletex/convert/resample/resample_snapped.h"
#include "skeletex/model/error.h"
#include "skeletex/reconstruct/displace.h"
#include "skeletex/reconstruct/lattice.h"
#include "skeletex/reconstruct/reconstruct_mesh.h"
#include "support/load_model.h"
#include "support/mesh_topology.h"
#include "support/reconstruct_twin.h"
#include "support/synthetic_model.h"

namespace skeletex {
namespace {

ClContext& device() {
  static ClContext context;
  return context;
}

constexpr ResampleFilter kFilters[] = {ResampleFilter::kSample, ResampleFilter::kAverage, ResampleFilter::kProject};

/// New samples of a function of the lattice coordinate, by the weights.
std::vector<double> apply_taps(const FilterTaps& taps, const std::vector<double>& old) {
  std::vector<double> result;
  for (const auto& tap : taps.taps) {
    double sum = 0;
    for (int i = 0; i < tap[1]; ++i)
      sum += static_cast<double>(taps.weights[tap[2] + i]) * old[(tap[0] + i) % old.size()];
    result.push_back(sum);
  }
  return result;
}

double distance_to_segment(const Vec3& p, const Vec3& a, const Vec3& b) { return distance_to_bone(p, a, b); }

}  // namespace

TEST(Resample, ToTheSameSizeChangesNothing) {
  const SyntheticSurface surface(cross(5), 0.3);
  const SkeletexModel model = surface.model(random_sizes(5, 4, 30, 1));
  const SkeletexModel same = resample_model(device(), model, std::max(model.texture.width, model.texture.height));
  EXPECT_EQ(same.texture.along, model.texture.along);
  EXPECT_EQ(same.texture.around, model.texture.around);
  EXPECT_EQ(same.texture.out, model.texture.out);
  ASSERT_EQ(same.arcs.size(), model.arcs.size());
  for (std::size_t a = 0; a < model.arcs.size(); ++a)
    EXPECT_EQ(same.arcs[a].samples.size(), model.arcs[a].samples.size());
}

TEST(Resample, IsClosedAtEverySizeWithTheSameGenus) {
  const std::vector<std::pair<Skeleton, double>> cases{{lone_bone(), 0.3},      {y_branch(), 0.25},
                                                       {cross(7), 0.3},         {ring(5), 0.2},
                                                       {ring_with_arm(6), 0.2}, {random_tree(20, 6), 0.15}};
  for (const auto& [skeleton, radius] : cases) {
    const SyntheticSurface surface(skeleton, radius);
    const int bones = static_cast<int>(skeleton.bones.size());
    const SkeletexModel model = surface.model(std::vector<std::pair<int, int>>(bones, {20, 24}));
    for (const int size : {32, 33, 47, 64, 100, 128, 200, 256}) {
      const SkeletexModel other = resample_model(device(), model, size);
      ASSERT_EQ(std::max(other.texture.width, other.texture.height), size);
      EXPECT_EQ(broken_rule(reconstruct_mesh(device(), other), surface.genus()), "") << bones << " bones at " << size;
    }
  }
}

TEST(Resample, FortyBonesFitThirtyTwoTexels) {
  const SyntheticSurface surface(random_tree(40, 9), 0.15);
  // 40 rectangles of 16 x 16 in a square of 112: at 32 they no longer scale, and are packed anew.
  const SkeletexModel model = surface.model(std::vector<std::pair<int, int>>(40, {16, 16}));
  const SkeletexModel small = resample_model(device(), model, 32);
  EXPECT_EQ(broken_rule(reconstruct_mesh(device(), small), 0), "");
  EXPECT_THROW(resample_model(device(), model, 16), InputError);
}

TEST(Resample, RectanglesKeepCoveringTheTexture) {
  std::mt19937 random(3);
  for (int trial = 0; trial < 200; ++trial) {
    // A kd-tree of splits at random places, then other sizes.
    std::vector<Patch> patches(1);
    patches[0].rectangle = {0, 0, 300, 200};
    for (int split = 0; split < 10; ++split) {
      const std::size_t i = random() % patches.size();
      const Rectangle r = patches[i].rectangle;
      Patch other;
      if (r.width >= r.height && r.width >= 40) {
        const int w = 15 + static_cast<int>(random() % (r.width - 30));
        patches[i].rectangle.width = w;
        other.rectangle = {r.x + w, r.y, r.width - w, r.height};
      } else if (r.height >= 40) {
        const int h = 15 + static_cast<int>(random() % (r.height - 30));
        patches[i].rectangle.height = h;
        other.rectangle = {r.x, r.y + h, r.width, r.height - h};
      } else {
        continue;
      }
      patches.push_back(other);
    }
    const int width = 100 + static_cast<int>(random() % 500), height = 70 + static_cast<int>(random() % 400);
    const std::vector<Rectangle> scaled = scale_rectangles(patches, 300, 200, width, height);
    ASSERT_FALSE(scaled.empty());
    std::vector<int> covered(width * height, 0);
    for (const Rectangle& r : scaled)
      for (int y = r.y; y < r.y + r.height; ++y)
        for (int x = r.x; x < r.x + r.width; ++x) ++covered[y * width + x];
    EXPECT_EQ(std::count(covered.begin(), covered.end(), 1), width * height);
  }
}

TEST(Resample, FinerThenCoarserComesBack) {
  const SyntheticSurface surface(y_branch(), 0.25);
  const SkeletexModel model = surface.model({{40, 32}, {40, 32}, {40, 32}});
  const int size = std::max(model.texture.width, model.texture.height);
  const SkeletexModel back = resample_model(device(), resample_model(device(), model, 2 * size), size);
  ASSERT_EQ(back.patches[0].rectangle.width, 40);
  const TriangleMesh a = reconstruct_mesh(device(), model);
  const TriangleMesh b = reconstruct_mesh(device(), back);
  const int inner = number_lattice(model).inner_count;
  double worst = 0;
  for (int i = 0; i < inner; ++i) worst = std::max(worst, (a.positions[i] - b.positions[i]).norm());
  EXPECT_LT(worst, 2e-3 * model.diagonal);
}

TEST(Resample, CoarserVolumeStaysCloserThanThatOfSampledPoints) {
  const SyntheticSurface surface(lone_bone(), 0.3, 0);
  const double exact = 0.3 * 0.3 * std::numbers::pi * (bone_length(surface.skeleton(), 0) + 0.4);
  const SkeletexModel model = surface.model({{256, 256}});
  for (const int size : {16, 32, 64}) {
    const double projected =
        signed_volume(reconstruct_mesh(device(), resample_model(device(), model, size))) / exact - 1;
    const double sampled = signed_volume(reconstruct_mesh(device(), surface.model({{size, size}}))) / exact - 1;
    EXPECT_LT(std::abs(projected), 0.25 * std::abs(sampled)) << size;
  }
}

TEST(Resample, ASurfaceThatJumpsGrowsNoSpikes) {
  // Half of the columns lie twice as far out: a fit without limits swings out beside both edges.
  const SyntheticSurface surface(lone_bone(), 0.3, 0);
  SkeletexModel model = surface.model({{256, 256}});
  for (std::size_t i = 0; i < model.texture.out.size(); ++i)
    if (static_cast<int>(i) % 256 >= 128) model.texture.out[i] *= 2;
  for (const int size : {40, 64, 100}) {
    const TriangleMesh mesh = reconstruct_mesh(device(), resample_model(device(), model, size));
    const Vec3 head = surface.skeleton().nodes[0].position, tail = surface.skeleton().nodes[1].position;
    for (const Vec3& p : mesh.positions) EXPECT_LT(distance_to_bone(p, head, tail), 0.6 * 1.05) << size;
  }
}

TEST(Resample, SeamSamplesStayOnTheSeparationPlaneAndNearTheOldPolyline) {
  const SyntheticSurface surface(cross(6), 0.3);
  const SkeletexModel model = surface.model(std::vector<std::pair<int, int>>(6, {60, 20}));
  const int size = std::max(model.texture.width, model.texture.height);
  for (const int other_size : {size / 2, size / 4, 2 * size}) {
    const SkeletexModel other = resample_model(device(), model, other_size);
    for (std::size_t a = 0; a < model.arcs.size(); ++a) {
      const SeamArc &was = model.arcs[a], &is = other.arcs[a];
      ASSERT_GE(is.samples.size(), 1u);
      EXPECT_EQ(is.corners, was.corners);
      const BoneEnd end = model.skeleton.bones[was.bones[0]].head == was.node ? BoneEnd::kHead : BoneEnd::kTail;
      const auto corner = [&](int index) {
        const SeamCorner& c = model.corners[index];
        const BoneEnd at = model.skeleton.bones[c.bones[0]].head == c.node ? BoneEnd::kHead : BoneEnd::kTail;
        return surface.separation().seam_point(c.bones[0], at, c.sample.turn, c.sample.distance);
      };
      std::vector<Vec3> line{corner(was.corners[0])};
      for (const SeamSample& s : was.samples)
        line.push_back(surface.separation().seam_point(was.bones[0], end, s.turn, s.distance));
      line.push_back(corner(was.corners[1]));
      double cell = 0;
      for (std::size_t i = 0; i + 1 < line.size(); ++i) cell += (line[i + 1] - line[i]).norm();
      cell /= static_cast<double>(std::min(is.samples.size(), was.samples.size()) + 1);  // the longer of old and new
      for (const SeamSample& s : is.samples) {
        EXPECT_EQ(surface.separation().neighbour(was.bones[0], end, s.turn), was.bones[1]);
        const Vec3 p = surface.separation().seam_point(was.bones[0], end, s.turn, s.distance);
        double nearest = 1e9;
        for (std::size_t i = 0; i + 1 < line.size(); ++i)
          nearest = std::min(nearest, distance_to_segment(p, line[i], line[i + 1]));
        // The fitted polygon straddles the curve: off by a share of its sagitta, cell^2 / (8 radius).
        EXPECT_LT(nearest, cell * cell / (4 * 0.3)) << "arc " << a << " at " << other_size;
      }
    }
  }
}

TEST(ResampleSnapped, FinerRowsAndColumnsHaveAllOldOnes) {
  const TestModel bear = load_standard_model("bear");
  EncodeOptions options;
  options.width = options.height = 96;
  const SkeletexModel encoded = encode_model(device(), bear.mesh, bear.skeleton, options).model;
  const PreparedModel model(encoded);
  const auto has_all = [](const std::vector<double>& places, int count, int made) {
    EXPECT_EQ(places.size(), static_cast<std::size_t>(made));
    EXPECT_TRUE(std::is_sorted(places.begin(), places.end()));
    for (int i = 0; i < count; ++i) EXPECT_TRUE(std::find(places.begin(), places.end(), i) != places.end());
  };
  int seams = 0, poles = 0;
  for (std::size_t bone = 0; bone < model.model.patches.size(); ++bone) {
    const auto& [x, y, width, height] = model.model.patches[bone].rectangle;
    for (const auto& [numerator, denominator] : {std::pair{1, 1}, std::pair{5, 4}, std::pair{2, 1}, std::pair{7, 2}}) {
      const int rows_made = height * numerator / denominator, columns_made = width * numerator / denominator;
      const std::vector<double> rows = rows_of_finer(model, static_cast<int>(bone), rows_made),
                                columns = columns_of_finer(width, columns_made);
      has_all(rows, height, rows_made);
      has_all(columns, width, columns_made);
      EXPECT_EQ(rows.back(), height - 1);
      EXPECT_LT(columns.back(), width);
      const auto [head, tail] = model.lattice.poles[bone];
      if (head < 0) {
        EXPECT_EQ(rows[1], 1);
      }
      if (tail < 0) {
        EXPECT_EQ(rows[rows_made - 2], height - 2);
      }
      if (numerator == 7 && head >= 0) {
        EXPECT_LT(rows[1], 1);
      }
      if (numerator == 7 && tail >= 0) {
        EXPECT_GT(rows[rows_made - 2], height - 2);
      }
      seams += (head < 0) + (tail < 0), poles += (head >= 0) + (tail >= 0);
    }
  }
  EXPECT_GT(seams, 0);
  EXPECT_GT(poles, 0);
}

TEST(ResampleSnapped, ChartsCoverTheMeshOnceAndTheirMapsDoNotFold) {
  const TestModel model = load_standard_model("bear");
  EncodeOptions options;
  options.width = options.height = 96;
  const SkeletexModel encoded = encode_model(device(), model.mesh, model.skeleton, options).model;
  const PreparedModel prepared(encoded);
  const TriangleMesh mesh = reconstruct_mesh(device(), prepared);
  double area = 0;
  std::size_t triangles = 0;
  for (const Chart& chart : charts_of_mesh(prepared, mesh)) {
    area += surface_area({chart.positions, chart.triangles});
    triangles += chart.triangles.size();
    double texture_area = 0;
    for (const double each : texture_areas(chart)) {
      EXPECT_GE(each, -1e-12);
      texture_area += each;
    }
    EXPECT_NEAR(texture_area, 1, 1e-9);
  }
  EXPECT_NEAR(area, surface_area(mesh), 1e-9 * area);
  EXPECT_EQ(triangles, mesh.triangles.size());
}

TEST(ResampleSnapped, KeepsTheSurfaceAtLargerSizesAndIsAsGoodAsEncodedAtSmallerOnes) {
  for (const char* const name : {"bear", "bunny00"}) {
    const TestModel model = load_standard_model(name);
    const auto encoded = [&](int size) {
      EncodeOptions options;
      options.width = options.height = size;
      return encode_model(device(), model.mesh, model.skeleton, options).model;
    };
    const auto mean_of = [&](const SkeletexModel& made) {
      const TriangleMesh mesh = reconstruct_mesh(device(), made);
      EXPECT_EQ(broken_rule(mesh, 0), "") << name;
      return symmetric_mean(measure_metro(device(), model.mesh, mesh));
    };
    const SkeletexModel from = encoded(256);
    const double mean = mean_of(from);
    // Where sizes are multiples the triangles stay; else texels between them cut corners.
    for (const auto& [size, limit] : {std::pair{512, 1.05}, std::pair{384, 1.5}}) {
      const double finer = mean_of(resample_model(device(), from, size));
      RecordProperty(name + std::to_string(size), std::to_string(finer / mean));
      EXPECT_LT(finer, limit * mean) << name << ' ' << size;
    }
    const double coarser = mean_of(resample_model(device(), from, 128)), own = mean_of(encoded(128));
    RecordProperty(name + std::string("128"), std::to_string(coarser / own));
    EXPECT_LT(coarser, 1.3 * own) << name;
  }
}

TEST(ResampleSnapped, SnapsToTheVerticesOfTheOriginalAndNotToAllTexels) {
  const TestModel model = load_standard_model("bear");
  const auto encoded = [&](int size) {
    EncodeOptions options;
    options.width = options.height = size;
    return encode_model(device(), model.mesh, model.skeleton, options).model;
  };
  const auto mean_of = [&](const SkeletexModel& made) {
    return symmetric_mean(measure_metro(device(), model.mesh, reconstruct_mesh(device(), made)));
  };
  EXPECT_LT(mean_of(resample_model(device(), encoded(512), 256)), 1.5 * mean_of(encoded(256)));
}

TEST(FilterTaps, KeepConstantsAndStraightLines) {
  for (const ResampleFilter filter : kFilters)
    for (const auto& [from, to] : {std::pair{4, 4}, {4, 9}, {9, 4}, {40, 11}, {41, 40}, {40, 41}, {300, 7}, {7, 300}}) {
      const FilterTaps rows = filter_taps(from, to, false, filter, 1.0 / 16);
      std::vector<double> line(from);
      std::iota(line.begin(), line.end(), 0.0);
      const std::vector<double> result = apply_taps(rows, line);
      ASSERT_EQ(static_cast<int>(result.size()), to);
      for (int i = 0; i < to; ++i) EXPECT_NEAR(result[i], static_cast<double>(i) * (from - 1) / (to - 1), 1e-5 * from);
      EXPECT_EQ(result.front(), 0);
      EXPECT_EQ(result.back(), from - 1);
      for (const double one : apply_taps(filter_taps(from, to, true, filter, 1.0 / 16), std::vector<double>(from, 1.0)))
        EXPECT_NEAR(one, 1, 1e-6);
    }
}

TEST(FilterTaps, ProjectionIsTheLeastSquaresFit) {
  // Independent: minimise the integral of the squared difference of both polygons by brute force over a fine grid.
  std::mt19937 random(4);
  std::normal_distribution<double> normal;
  for (const bool is_periodic : {false, true})
    for (const auto& [from, to] : {std::pair{23, 7}, {40, 31}, {64, 16}, {200, 9}}) {
      std::vector<double> old(from);
      for (double& value : old) value = normal(random);
      const std::vector<double> fit = apply_taps(filter_taps(from, to, is_periodic, ResampleFilter::kProject, 0), old);
      const auto read = [&](const std::vector<double>& values, double t) {  // t in [0,1]
        const int count = static_cast<int>(values.size());
        const double at = t * (is_periodic ? count : count - 1);
        const int cell = std::min(static_cast<int>(at), is_periodic ? count - 1 : count - 2);
        return values[cell] + (at - cell) * (values[(cell + 1) % count] - values[cell]);
      };
      const auto error = [&](const std::vector<double>& values) {
        double sum = 0;
        constexpr int kFine = 20000;
        for (int k = 0; k < kFine; ++k) {
          const double t = (k + 0.5) / kFine, d = read(values, t) - read(old, t);
          sum += d * d / kFine;
        }
        return sum;
      };
      const double least = error(fit);
      for (int i = is_periodic ? 0 : 1; i < (is_periodic ? to : to - 1); ++i)
        for (const double step : {-0.02, 0.02}) {
          std::vector<double> moved = fit;
          moved[i] += step;
          EXPECT_GT(error(moved), least) << from << " -> " << to << ", sample " << i;
        }
    }
}

TEST(FilterTaps, FinerSamplesOfASmoothCurveTakeBackThePrefilter) {
  const int from = 32, to = 128;
  std::vector<double> old(from);
  for (int i = 0; i < from; ++i) {
    const auto f = [&](int k) { return std::sin(2 * std::numbers::pi * k / from); };
    old[i] = f(i) - (f(i + 1) - 2 * f(i) + f(i - 1)) / 16;
  }
  const std::vector<double> fine = apply_taps(filter_taps(from, to, true, ResampleFilter::kSample, 1.0 / 16), old);
  for (int i = 0; i < to; ++i) EXPECT_NEAR(fine[i], std::sin(2 * std::numbers::pi * i / to), 4e-4);
  // And without one passes through the samples.
  const std::vector<double> through = apply_taps(filter_taps(from, to, true, ResampleFilter::kSample, 0), old);
  for (int i = 0; i < from; ++i) EXPECT_NEAR(through[4 * i], old[i], 1e-6);
}

TEST(ResamplePolyline, KeepsEndsAndEvenSpacing) {
  std::vector<Vec3> points;
  for (int i = 0; i <= 50; ++i) points.push_back(Vec3(std::cos(0.04 * i), std::sin(0.04 * i), 0.1));
  for (const ResampleFilter filter : kFilters)
    for (const int cells : {2, 5, 20, 200}) {
      const std::vector<Vec3> result = resample_polyline(points, false, cells, filter);
      ASSERT_EQ(static_cast<int>(result.size()), cells + 1);
      EXPECT_EQ(result.front(), points.front());
      EXPECT_EQ(result.back(), points.back());
      if (filter == ResampleFilter::kAverage) continue;
      double shortest = 1e9, longest = 0;
      for (int i = 0; i < cells; ++i) {
        shortest = std::min(shortest, (result[i + 1] - result[i]).norm());
        longest = std::max(longest, (result[i + 1] - result[i]).norm());
      }
      EXPECT_LT(longest, 1.1 * shortest);
    }
}

TEST(ResamplePolyline, ProjectionOfACircleKeepsItsAreaToFourthOrder) {
  std::vector<Vec3> points;
  for (int i = 0; i < 4000; ++i)
    points.push_back(Vec3(std::cos(2 * std::numbers::pi * i / 4000), std::sin(2 * std::numbers::pi * i / 4000), 0));
  const auto area = [](const std::vector<Vec3>& p) {
    double sum = 0;
    for (std::size_t i = 0; i < p.size(); ++i)
      sum += 0.5 * (p[i].x() * p[(i + 1) % p.size()].y() - p[i].y() * p[(i + 1) % p.size()].x());
    return sum;
  };
  for (const int cells : {6, 12, 24}) {
    const double sampled = std::numbers::pi - area(resample_polyline(points, true, cells, ResampleFilter::kSample));
    const double projected = std::numbers::pi - area(resample_polyline(points, true, cells, ResampleFilter::kProject));
    EXPECT_LT(std::abs(projected), 0.1 * sampled) << cells;
  }
}

// --- Kernels against their twins -----------------------------------------------------------------------------------

TEST(ResampleKernels, FiltersAgreeWithTheirTwinOnRandomPlanes) {
  const SyntheticSurface surface(random_tree(6, 1), 0.2);
  const std::vector<std::pair<int, int>> old_sizes = random_sizes(6, 4, 150, 2), new_sizes = random_sizes(6, 4, 150, 3);
  std::vector<std::pair<int, int>> middle_sizes = old_sizes;
  for (std::size_t i = 0; i < 6; ++i) middle_sizes[i].second = new_sizes[i].second;
  const SkeletexModel old_model = surface.model(old_sizes), middle = surface.model(middle_sizes),
                      target = surface.model(new_sizes);
  const FrameTables tables = frame_tables(target.skeleton, surface.separation(), target.patches, Vec3::Zero());
  std::mt19937 random(12);
  std::normal_distribution<float> normal;

  for (const bool is_rows : {true, false}) {
    FilterTaps taps;
    std::vector<int> widths, first_in;
    std::size_t in_size = 0, out_size = 0;
    for (std::size_t i = 0; i < 6; ++i) {
      const FilterTaps one =
          is_rows ? filter_taps(old_sizes[i].second, new_sizes[i].second, false, ResampleFilter::kProject, 1.0 / 16)
                  : filter_taps(old_sizes[i].first, new_sizes[i].first, true, ResampleFilter::kProject, 1.0 / 16);
      for (std::array<int, 4> tap : one.taps) {
        tap[2] += static_cast<int>(taps.weights.size());
        taps.taps.push_back(tap);
      }
      taps.weights.insert(taps.weights.end(), one.weights.begin(), one.weights.end());
      widths.push_back(old_sizes[i].first);
      first_in.push_back(static_cast<int>(in_size));
      in_size += static_cast<std::size_t>(old_sizes[i].first) * (is_rows ? old_sizes[i].second : new_sizes[i].second);
      out_size += static_cast<std::size_t>(is_rows ? old_sizes[i].first : new_sizes[i].first) * new_sizes[i].second;
    }
    std::vector<float> planes[3];
    for (auto& plane : planes) {
      plane.resize(in_size);
      for (float& value : plane) value = random() % 20 ? normal(random) : 1e6f;
    }
    const std::vector<LatticeRow> rows = lattice_rows(is_rows ? middle.patches : target.patches, RowChoice::kAll);
    DevicePlanes out = allocate_planes(device(), out_size);
    device().launch(
        {"reconstruct.cl", is_rows ? "filter_rows" : "filter_columns"}, row_range(device(), rows.size()),
        ResampleParameters{static_cast<int>(rows.size()), static_cast<int>(in_size), static_cast<int>(out_size), 0},
        device().upload(rows), device().upload(tables.patches), device().upload(widths), device().upload(first_in),
        device().upload(taps.taps), device().upload(taps.weights),
        upload_planes(device(), planes[0], planes[1], planes[2]).values, out.values);
    const auto results = download_planes(device(), out);
    std::size_t at = 0;
    for (std::size_t i = 0; i < 6; ++i)
      for (int r = 0; r < new_sizes[i].second; ++r)
        for (int j = 0; j < (is_rows ? old_sizes[i].first : new_sizes[i].first); ++j, ++at)
          for (int p = 0; p < 3; ++p) {
            const auto& tap = taps.taps[is_rows ? tables.patches[i].row_begin + r : tables.patches[i].column_begin + j];
            const int first = first_in[i] + (is_rows ? j : r * widths[i]), stride = is_rows ? widths[i] : 1;
            const int count = is_rows ? old_sizes[i].second : old_sizes[i].first;
            double magnitude = 0;
            for (int k = 0; k < tap[1]; ++k)
              magnitude +=
                  std::abs(double(taps.weights[tap[2] + k]) * planes[p][first + (tap[0] + k) % count * stride]);
            const double expected = twin::filter(tap, taps.weights, planes[p], first, stride, count);
            // n products and n sums, each exact to half an ulp of a partial sum.
            ASSERT_NEAR(results[p][at], expected, 6e-8 * (tap[1] + 2) * magnitude);
          }
    EXPECT_EQ(at, out_size);
  }
}

TEST(ResampleKernels, FitsAreLimitedAsByTheirTwin) {
  const SyntheticSurface surface(random_tree(6, 1), 0.2);
  const SkeletexModel model = surface.model(random_sizes(6, 4, 90, 9));
  const FrameTables tables = frame_tables(model.skeleton, surface.separation(), model.patches, model.origin);
  const std::vector<LatticeRow> rows = lattice_rows(model.patches, RowChoice::kAll);
  std::size_t size = 0;
  for (const Patch& patch : model.patches)
    size += static_cast<std::size_t>(patch.rectangle.width) * patch.rectangle.height;
  std::mt19937 random(14);
  std::normal_distribution<float> normal;
  std::vector<float> sampled[3], fitted[3];
  for (auto* planes : {sampled, fitted})
    for (int p = 0; p < 3; ++p)
      for (std::size_t i = 0; i < size; ++i)
        planes[p].push_back((planes == fitted ? sampled[p][i] + 0.3f * normal(random) : normal(random)));
  for (int p = 0; p < 3; ++p) {
    sampled[p][7] = sampled[p][8] = sampled[p][6];  // edges of no length
    fitted[p][20] = sampled[p][20];
  }
  DevicePlanes points = upload_planes(device(), fitted[0], fitted[1], fitted[2]);
  device().launch(
      {"reconstruct.cl", "limit_fit"}, row_range(device(), rows.size()),
      ResampleParameters{static_cast<int>(rows.size()), static_cast<int>(size), static_cast<int>(size), 0.25f},
      device().upload(rows), device().upload(tables.patches),
      upload_planes(device(), sampled[0], sampled[1], sampled[2]).values, points.values);
  const auto [x, y, z] = download_planes(device(), points);
  std::size_t first = 0;
  for (const Patch& patch : model.patches) {
    const int width = patch.rectangle.width, height = patch.rectangle.height;
    const auto at = [&](const std::vector<float>* planes, int r, int j) {
      const std::size_t i = first +
                            static_cast<std::size_t>(r < 0         ? 1
                                                     : r == height ? height - 2
                                                                   : r) *
                                width +
                            (j + width) % width;
      return Vec3(planes[0][i], planes[1][i], planes[2][i]);
    };
    for (int r = 0; r < height; ++r)
      for (int j = 0; j < width; ++j) {
        const Vec3 here = at(sampled, r, j);
        const Vec3 expected = twin::limit_fit(here, at(fitted, r, j),
                                              {at(sampled, r - 1, j) - here, at(sampled, r + 1, j) - here,
                                               at(sampled, r, j - 1) - here, at(sampled, r, (j + 1) % width) - here},
                                              0.25);
        const std::size_t i = first + static_cast<std::size_t>(r) * width + j;
        ASSERT_LE((Vec3(x[i], y[i], z[i]) - expected).norm(), 1e-6 * (here.norm() + expected.norm()))
            << "row " << r << " column " << j;
      }
    first += static_cast<std::size_t>(width) * height;
  }
}

TEST(ResampleKernels, TangentSpaceIsEnteredAsByItsTwin) {
  const SyntheticSurface surface(random_tree(8, 5), 0.2);
  const SkeletexModel model = surface.model(random_sizes(8, 4, 150, 6));
  const FrameTables tables = frame_tables(model.skeleton, surface.separation(), model.patches, model.origin);
  const std::vector<LatticeRow> rows = lattice_rows(model.patches, RowChoice::kAll);
  std::size_t size = 0;
  for (const Patch& patch : model.patches)
    size += static_cast<std::size_t>(patch.rectangle.width) * patch.rectangle.height;
  std::mt19937 random(13);
  std::normal_distribution<float> normal;
  std::vector<float> p[3];
  for (auto& plane : p) plane.resize(size);
  for (std::size_t i = 0; i < size; ++i) {
    const float scale = std::pow(10.0f, normal(random));
    for (auto& plane : p) plane[i] = random() % 10 ? scale * normal(random) : 0.0f;
  }
  const DeviceTables device_tables = upload_tables(device(), tables);
  const std::size_t area = static_cast<std::size_t>(model.texture.width) * model.texture.height;
  DevicePlanes texels = allocate_planes(device(), area);
  enter_tangent_space(device(), device_tables, device().upload(rows), model.texture.width,
                      upload_planes(device(), p[0], p[1], p[2]), texels);
  const auto [along, around, out] = download_planes(device(), texels);
  std::size_t at = 0;
  for (const PatchRecord& patch : tables.patches)
    for (int r = 0; r < patch.height; ++r)
      for (int j = 0; j < patch.width; ++j, ++at) {
        const Vec3 point(p[0][at], p[1][at], p[2][at]);
        const Vec3 expected = twin::enter_tangent_space(patch, tables.rows[patch.row_begin + r],
                                                        tables.columns[patch.column_begin + j], point);
        const std::size_t texel = static_cast<std::size_t>(patch.y + r) * model.texture.width + patch.x + j;
        const Vec3 got(along[texel], around[texel], out[texel]);
        // The foot is exact to eps times the bone's length; where the point is that close to it, its direction is lost.
        const double foot = tables.rows[patch.row_begin + r].axial * patch.length,
                     length = (point - Vec3(0, 0, foot)).norm();
        const double eps = 1.2e-7;
        ASSERT_LE((got - expected).norm(),
                  16 * eps * expected.norm() * (1 + (point.norm() + patch.length) / std::max(length, 1e-30)) +
                      16 * eps * (point.norm() + patch.length))
            << point.transpose();
      }
}

}  // namespace skeletex
