// SPDX-License-Identifier: MIT
#include "skeletex/convert/snap/snap.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <numbers>
#include <numeric>
#include <random>

#include "skeletex/analysis/manifold.h"
#include "skeletex/analysis/metro.h"
#include "skeletex/convert/choose_placing.h"
#include "skeletex/convert/encode_model.h"
#include "skeletex/convert/layout/row_profile.h"
#include "skeletex/convert/snap/revert_texels.h"
#include "skeletex/geometry/self_intersection.h"
#include "skeletex/reconstruct/reconstruct_mesh.h"
#include "support/load_model.h"
#include "support/snap_twin.h"

namespace skeletex {
namespace {

constexpr int kTextureWidth = 70, kTextureHeight = 48;

ClContext& device() {
  static ClContext context;
  return context;
}

/// A texture with one patch.
struct OnePatch {
  Skeleton skeleton{{{"head", Vec3(0, 0, 0)}, {"tail", Vec3(0, 0, 1)}}, {{"bone", 0, 1, Vec3(1, 0, 0)}}};
  std::vector<Patch> patches;
  DeviceLayout layout;

  explicit OnePatch(const Rectangle& rectangle) {
    patches.push_back({rectangle, Method::kVsm, SegmentTopology::kSphere, spread_rows_uniformly(rectangle.height)});
    layout = upload_layout(device(), patches, frame_tables(skeleton, SeparationPlanes(skeleton), patches, Vec3::Zero()),
                           kTextureWidth, kTextureHeight);
  }
  const Rectangle& rectangle() const { return patches[0].rectangle; }
  std::size_t texel(int column, int row) const {
    return static_cast<std::size_t>(rectangle().y + row) * kTextureWidth + rectangle().x + column;
  }
};

/// Vertices and edges anywhere in a patch, some beyond v = 0 or 1, some of the edges long and some of no length.
SnapFeatures random_features(const Rectangle& r, std::mt19937& random) {
  std::uniform_real_distribution<double> unit(0, 1);
  SnapFeatures features;
  const int count = r.width * r.height / 3;
  for (int i = 0; i < count; ++i)
    features.vertices.push_back({0, i, (1.4 * unit(random) - 0.2) * r.width, unit(random) * (r.height - 1), 1 + i});
  for (int i = 0; i < count; ++i) {
    const double x = (1.4 * unit(random) - 0.2) * r.width, y = unit(random) * (r.height - 1);
    const double angle = 7 * unit(random), length = i % 10 == 0 ? 8 : 2 * unit(random);
    features.edges.push_back({0,
                              {2 * i, 2 * i + 1},
                              {x, x + length * std::cos(angle)},
                              {y, std::clamp(y + length * std::sin(angle), 0.0, r.height - 1.0)},
                              2 * std::pow(unit(random), 3)});
  }
  return features;
}

Rectangle random_rectangle(std::mt19937& random) {
  const int width = 4 + static_cast<int>(random() % 50), height = 4 + static_cast<int>(random() % 40);
  return {static_cast<int>(random() % (kTextureWidth - width + 1)),
          static_cast<int>(random() % (kTextureHeight - height + 1)), width, height};
}

struct HostPositions {
  std::vector<float> x, y, parameters;
  std::vector<int> anchors;
};
/// \param home_x, home_y  of all texels of the texture; 0 without
HostPositions snapped(const OnePatch& patch, const SnapFeatures& features, const std::vector<float>& home_x = {},
                      const std::vector<float>& home_y = {}) {
  ReadingPositions positions = even_positions(device(), patch.layout);
  std::vector<float> home = home_x;
  home.insert(home.end(), home_y.begin(), home_y.end());
  device().write(positions.home, home);
  const ReadingPositions snapped =
      snap_positions(device(), patch.layout, upload_tables(device(), tables_of(features, patch.patches)), positions);
  auto [x, y, parameters] = download_planes(device(), {snapped.offsets, patch.layout.size()});
  return {x, y, parameters, device().download(snapped.anchors)};
}

/// A box of a tube, square across, with a vertex on every edge and in the middle of every side.
Chart square_tube(int rows) {
  Chart chart;
  chart.bone = 0;
  chart.topology = SegmentTopology::kAnnulus;
  const double side[8][2] = {{1, 0}, {1, 1}, {0, 1}, {-1, 1}, {-1, 0}, {-1, -1}, {0, -1}, {1, -1}};
  for (int r = 0; r < rows; ++r)
    for (int j = 0; j < 8; ++j) {
      chart.u.push_back(static_cast<double>(r) / (rows - 1));
      chart.v.push_back(j / 8.0);
      chart.positions.emplace_back(side[j][0], side[j][1], 0.25 * r);
      chart.kinds.push_back(r == 0          ? ChartVertex::kHeadRow
                            : r == rows - 1 ? ChartVertex::kTailRow
                                            : ChartVertex::kInner);
    }
  for (int r = 0; r + 1 < rows; ++r)
    for (int j = 0; j < 8; ++j) {
      const int k = (j + 1) % 8, a = 8 * r + j, b = 8 * r + k, c = b + 8, d = a + 8;
      const auto turn = static_cast<std::int8_t>(k == 0);
      chart.triangles.push_back({a, b, c});
      chart.turns.push_back({0, turn, turn});
      chart.triangles.push_back({a, c, d});
      chart.turns.push_back({0, turn, 0});
    }
  chart.half_edges = link_half_edges(chart.triangles, static_cast<int>(chart.positions.size()));
  return chart;
}

}  // namespace

TEST(SnapFeatures, OfASquareTubeAreItsFourEdgesAndTheVerticesOnThem) {
  const OnePatch patch({3, 2, 20, 13});
  const std::vector charts{square_tube(7)};
  const MapFeatures found = find_features(charts, std::vector{Method::kVsm}, 0.1);
  const SnapFeatures features = place_features(found, charts, patch.patches);
  EXPECT_EQ(features.edges.size(), 4u * 6);
  for (const SnapFeatures::Edge& edge : features.edges) {
    EXPECT_NEAR(edge.dihedral, std::numbers::pi / 2, 1e-12);
    EXPECT_NEAR(edge.x[0], edge.x[1], 1e-12);
    EXPECT_NEAR(std::abs(edge.y[1] - edge.y[0]), 2, 1e-12) << "6 rows of quads over 12 cells";
    EXPECT_NEAR(std::fmod(edge.x[0], 5), 2.5, 1e-12) << "8 columns over 20 cells";
  }
  EXPECT_EQ(features.vertices.size(), 4u * 5);
  ASSERT_EQ(found.vertices[0].size(), features.vertices.size());
  for (const SnapFeatures::Vertex& vertex : features.vertices) EXPECT_NEAR(std::fmod(vertex.x, 5), 2.5, 1e-12);
  for (const MapFeatures::Vertex& vertex : found.vertices[0])
    EXPECT_NEAR(vertex.strength, std::numbers::pi / 2 * 0.5, 1e-12);
}

TEST(SnapFeatures, RankVerticesOfAllPatchesByStrength) {
  std::vector charts{square_tube(7), square_tube(4)};
  for (Chart& chart : charts)
    for (std::size_t i = 0; i < chart.positions.size(); ++i)
      chart.positions[i] *= 1 + 0.3 * std::sin(3.0 * static_cast<double>(i));
  const MapFeatures features = find_features(charts, std::vector{Method::kVsm, Method::kVsm}, 0.1);
  std::vector<std::pair<int, double>> by_rank;
  for (const auto& vertices : features.vertices)
    for (const MapFeatures::Vertex& vertex : vertices) by_rank.emplace_back(vertex.rank, vertex.strength);
  std::sort(by_rank.begin(), by_rank.end());
  ASSERT_EQ(by_rank.size(), 8u * 5 + 8 * 2);
  for (std::size_t i = 0; i < by_rank.size(); ++i) {
    EXPECT_EQ(by_rank[i].first, static_cast<int>(i) + 1);
    if (i > 0) {
      EXPECT_GE(by_rank[i].second, by_rank[i - 1].second);
    }
  }
}

TEST(SnapFeatures, ComeByRowsAndAlongThemWhateverTheOrderOfTrianglesAndTheTurn) {
  const OnePatch patch({3, 2, 20, 13});
  for (const int turn : {0, -1, -20, 30}) {
    Chart chart = square_tube(7);
    std::reverse(chart.triangles.begin(), chart.triangles.end());
    std::reverse(chart.turns.begin(), chart.turns.end());
    for (auto& turns : chart.turns)
      for (std::int8_t& corner : turns) corner = static_cast<std::int8_t>(corner + turn);
    chart.half_edges = link_half_edges(chart.triangles, static_cast<int>(chart.positions.size()));
    const std::vector charts{chart};
    const SnapFeatures features =
        place_features(find_features(charts, std::vector{Method::kVsm}, 0.1), charts, patch.patches);
    ASSERT_EQ(features.edges.size(), 4u * 6);
    using Place = std::pair<int, int>;  // row, bin of eight columns
    const auto place_of = [](double x, double y) {
      return Place(static_cast<int>(y), (static_cast<int>(std::floor(x)) % 20 + 20) % 20 / 8);
    };
    std::vector<Place> of_edges, of_vertices;
    for (const SnapFeatures::Edge& edge : features.edges)
      of_edges.push_back(place_of(std::min(edge.x[0], edge.x[1]), std::min(edge.y[0], edge.y[1])));
    for (const SnapFeatures::Vertex& vertex : features.vertices) of_vertices.push_back(place_of(vertex.x, vertex.y));
    EXPECT_TRUE(std::is_sorted(of_edges.begin(), of_edges.end())) << turn;
    EXPECT_TRUE(std::is_sorted(of_vertices.begin(), of_vertices.end())) << turn;
  }
}

TEST(SnapFeatures, LieInTheRowsThatBisectionFinds) {
  std::mt19937 random(12);
  std::uniform_real_distribution<double> uniform(0, 1);
  for (const int height : {3, 4, 5, 17, 300}) {
    for (const double unevenness : {0.0, 1.0, 6.0}) {
      std::vector<double> row_u(height);
      for (int row = 0; row < height; ++row)
        row_u[row] = std::pow(static_cast<double>(row) / (height - 1), 1 + unevenness);
      if (height > 10) row_u[5] = row_u[6] = row_u[7];  // rows of no length
      std::vector<double> u{0, 1};
      for (int i = 0; i < 1000; ++i) u.push_back(uniform(random));
      u.insert(u.end(), row_u.begin(), row_u.end());
      for (int i = 0; i <= 4 * height; ++i) u.push_back(static_cast<double>(i) / (4 * height));
      const std::vector<double> rows = rows_of(row_u, u);
      ASSERT_EQ(rows.size(), u.size());
      for (std::size_t i = 0; i < u.size(); ++i) {
        const auto above = std::upper_bound(row_u.begin() + 1, row_u.end() - 1, u[i]);
        const double low = *(above - 1), high = *above;
        EXPECT_EQ(rows[i],
                  static_cast<double>(above - 1 - row_u.begin()) + (high > low ? (u[i] - low) / (high - low) : 0))
            << height << " " << u[i];
      }
    }
  }
}

TEST(Snap, PutsTexelsWhereItsTwinDoes) {
  for (unsigned seed = 1; seed <= 24; ++seed) {
    SCOPED_TRACE(seed);
    std::mt19937 random(seed);
    Rectangle rectangle = random_rectangle(random);
    // Half of them with nothing that is looked for again: whole bins alone, and flat edges.
    const bool is_flat = seed > 12;
    if (is_flat) rectangle.width = 8 + rectangle.width / 16 * 8;
    if (is_flat) rectangle.x = 0;
    const OnePatch patch(rectangle);
    SnapFeatures features = random_features(patch.rectangle(), random);
    for (SnapFeatures::Edge& edge : features.edges)
      if (is_flat) edge.dihedral = 0.09;
    twin::SnapLattice expected(patch.rectangle().width, patch.rectangle().height);
    // Where the regular grid is unfolded: in few rows.
    std::vector<float> home_x(patch.layout.size(), 0), home_y(patch.layout.size(), 0);
    std::uniform_real_distribution<float> unfolded(-0.2f, 0.2f);
    for (int r = 1; r + 1 < expected.height; r += 3)
      for (int j = static_cast<int>(seed) % 5; j < expected.width; j += 5) {
        home_x[patch.texel(j, r)] = unfolded(random), home_y[patch.texel(j, r)] = unfolded(random);
        expected.x[expected.at(j, r)] = home_x[patch.texel(j, r)],
                                  expected.y[expected.at(j, r)] = home_y[patch.texel(j, r)];
      }
    const HostPositions got = snapped(patch, features, home_x, home_y);
    expected.snap(features);
    // Rounding can turn a decision that stands on edge, and with it those beside it.
    int different = 0;
    for (int r = 0; r < expected.height; ++r)
      for (int j = 0; j < expected.width; ++j) {
        const std::size_t texel = patch.texel(j, r);
        different += got.anchors[texel] != expected.anchors[expected.at(j, r)] ||
                     std::abs(got.x[texel] - expected.x[expected.at(j, r)]) > 1e-4 ||
                     std::abs(got.y[texel] - expected.y[expected.at(j, r)]) > 1e-4;
      }
    EXPECT_LE(different, expected.width * expected.height / 200);
  }
}

TEST(Snap, LooksForEdgesAgainOnlyWhereTheyAreSharp) {
  // Which edge is the nearest does not depend on a dihedral angle that all have.
  const auto texels_on_edges = [](double dihedral) {
    std::ptrdiff_t count = 0;
    for (unsigned seed = 1; seed <= 12; ++seed) {
      std::mt19937 random(seed);
      const OnePatch patch(random_rectangle(random));
      SnapFeatures features = random_features(patch.rectangle(), random);
      for (SnapFeatures::Edge& edge : features.edges) edge.dihedral = dihedral;
      const std::vector<int> anchors = snapped(patch, features).anchors;
      count += std::count_if(anchors.begin(), anchors.end(), [](int anchor) { return anchor < 0; });
    }
    return count;
  };
  EXPECT_GT(texels_on_edges(0.101), texels_on_edges(0.099));
}

TEST(Snap, NeverFoldsTheMapAndHoldsTexelsExactlyOnTheirVertexOrEdge) {
  for (unsigned seed = 100; seed < 112; ++seed) {
    SCOPED_TRACE(seed);
    std::mt19937 random(seed);
    const OnePatch patch(random_rectangle(random));
    const SnapFeatures features = random_features(patch.rectangle(), random);
    const HostPositions got = snapped(patch, features);
    const int width = patch.rectangle().width, height = patch.rectangle().height;
    twin::SnapLattice lattice(width, height);
    int anchored = 0;
    for (int r = 0; r < height; ++r)
      for (int j = 0; j < width; ++j) {
        const std::size_t texel = patch.texel(j, r);
        const double dx = got.x[texel], dy = got.y[texel];
        lattice.x[lattice.at(j, r)] = dx, lattice.y[lattice.at(j, r)] = dy;
        EXPECT_LE(std::max(std::abs(dx), std::abs(dy)), 1);
        if (r == 0 || r == height - 1) {
          EXPECT_TRUE(dx == 0 && dy == 0);
        }
        const int anchor = got.anchors[texel];
        if (anchor == 0) continue;
        ++anchored;
        double x, y;
        if (anchor > 0) {
          x = features.vertices[anchor - 1].x, y = features.vertices[anchor - 1].y;
        } else {
          const SnapFeatures::Edge& edge = features.edges[-1 - anchor];
          x = edge.x[0] + got.parameters[texel] * (edge.x[1] - edge.x[0]),
          y = edge.y[0] + got.parameters[texel] * (edge.y[1] - edge.y[0]);
        }
        EXPECT_NEAR(std::remainder(j + dx - x, width), 0, 2e-5);
        EXPECT_NEAR(r + dy, y, 2e-5);
      }
    if (width * height > 60) {
      EXPECT_GT(anchored, 0);
    }
    for (int r = 0; r + 1 < height; ++r)
      for (int j = 0; j < width; ++j) EXPECT_GE(lattice.quad_cross(j, r), 0.05 - 1e-4) << r << " " << j;
  }
}

TEST(Snap, DoesNotDependOnTheOrderOfTheVertices) {
  std::mt19937 random(7);
  const OnePatch patch({5, 3, 47, 39});
  SnapFeatures features = random_features(patch.rectangle(), random);
  const HostPositions first = snapped(patch, features);
  std::shuffle(features.vertices.begin(), features.vertices.end(), random);
  const HostPositions second = snapped(patch, features);
  EXPECT_EQ(first.x, second.x);
  EXPECT_EQ(first.y, second.y);
}

TEST(Snap, WithTexelsThatRevertGoesWhatThenFoldsAndNothingElse) {
  std::mt19937 random(11);
  const OnePatch patch({4, 2, 31, 29});
  const int width = patch.rectangle().width, height = patch.rectangle().height;
  std::normal_distribution<float> normal(0, 0.5f);
  const std::size_t size = patch.layout.size();
  // A tube, and the same with half of its points thrown about.
  std::array<std::vector<float>, 3> even, moved;
  for (int i = 0; i < 3; ++i) even[i].resize(size, 0);
  for (int r = 0; r < height; ++r)
    for (int j = 0; j < width; ++j) {
      const double angle = 2 * std::numbers::pi * j / width;
      even[0][patch.texel(j, r)] = static_cast<float>(4 * std::cos(angle));
      even[1][patch.texel(j, r)] = static_cast<float>(4 * std::sin(angle));
      even[2][patch.texel(j, r)] = static_cast<float>(r);
    }
  moved = even;
  for (int r = 1; r + 1 < height; ++r)
    for (int j = 0; j < width; ++j)
      if (random() % 2 == 0)
        for (int i = 0; i < 3; ++i) moved[i][patch.texel(j, r)] += normal(random);
  SkeletexModel model;
  model.skeleton = patch.skeleton, model.patches = patch.patches, model.ends.resize(1);
  model.texture.width = kTextureWidth, model.texture.height = kTextureHeight;
  const LatticeFrame frame = frame_lattice(device(), model);
  const std::vector<float> no_offsets(size, 0);
  const PlacedTexels regular{even, no_offsets, no_offsets, std::vector<int>(size, 0), std::vector<int>(size, 0)};
  PlacedTexels texels = regular;
  texels.points = moved;
  std::vector<int> marks(size, 0);
  std::vector<int> marked;
  for (int r = 1; r + 1 < height; ++r)
    for (int j = 0; j < width; ++j)
      if (random() % 10 == 0) marks[patch.texel(j, r)] = 1, marked.push_back(static_cast<int>(patch.texel(j, r)));
  // In three calls: what a quad was in one of them may no longer hold in the next.
  std::vector<int> back;
  std::shuffle(marked.begin(), marked.end(), random);
  for (std::size_t call = 0, third = marked.size() / 3 + 1; call < 3; ++call) {
    const std::vector<int> some(marked.begin() + std::min(marked.size(), call * third),
                                marked.begin() + std::min(marked.size(), (call + 1) * third));
    const std::vector<int> more = revert_texels(frame, some, true, regular, texels);
    EXPECT_FALSE(more.empty());
    back.insert(back.end(), more.begin(), more.end());
  }
  const TexelPlanes& got = texels.points;

  const auto point = [&](const std::array<std::vector<float>, 3>& planes, int j, int r) {
    const std::size_t texel = patch.texel((j + width) % width, r);
    return Vec3(planes[0][texel], planes[1][texel], planes[2][texel]);
  };
  // The tube's own quads are flat but for their bend of 2 pi / 31: none of its triangles is turned itself.
  const auto is_bad = [&](const std::array<std::vector<float>, 3>& planes, int j, int r) {
    const Vec3 e[4] = {point(even, j, r), point(even, j + 1, r), point(even, j + 1, r + 1), point(even, j, r + 1)};
    const Vec3 n[4] = {point(planes, j, r), point(planes, j + 1, r), point(planes, j + 1, r + 1),
                       point(planes, j, r + 1)};
    const Vec3 direction = (e[2] - e[0]).cross(e[3] - e[1]).normalized();
    const auto cosine = [&](int a, int b, int c) {
      return (n[b] - n[a]).cross(n[c] - n[a]).normalized().dot(direction);
    };
    return std::min(cosine(0, 1, 2), cosine(0, 2, 3)) < 0.2 && std::min(cosine(0, 1, 3), cosine(1, 2, 3)) < 0.2;
  };
  const auto is_back = [&](int j, int r) {
    return point(moved, j, r) != point(even, j, r) && point(got, j, r) == point(even, j, r);
  };
  const auto backs_of_quad = [&](int j, int r) {
    return is_back(j, r) + is_back(j + 1, r) + is_back(j, r + 1) + is_back(j + 1, r + 1);
  };
  int counted = 0, unmarked = 0, still_bad = 0;
  for (int r = 1; r + 1 < height; ++r)
    for (int j = 0; j < width; ++j) {
      if (is_bad(got, j, r)) {
        EXPECT_EQ(backs_of_quad(j, r), 0) << r << " " << j;
      }
      still_bad += is_bad(got, j, r);
      counted += is_back(j, r);
      if (!is_back(j, r)) {
        EXPECT_EQ(point(got, j, r), point(moved, j, r));
        EXPECT_TRUE(!marks[patch.texel(j, r)] || point(got, j, r) == point(even, j, r));
      } else if (!marks[patch.texel(j, r)]) {
        ++unmarked;
        EXPECT_TRUE(backs_of_quad(j, r) > 1 || backs_of_quad(j - 1, r) > 1 || backs_of_quad(j, r - 1) > 1 ||
                    backs_of_quad(j - 1, r - 1) > 1);
      }
    }
  EXPECT_EQ(static_cast<int>(back.size()), counted);
  EXPECT_GT(unmarked, 0);
  EXPECT_GT(still_bad, 0);
}

TEST(Snap, BringsABearToAThirdOfTheErrorWithoutFoldingIt) {
  const TestModel model = load_standard_model("bear");
  EncodeOptions options;
  options.width = options.height = 256;
  options.has_snap = options.has_fit = false;
  const TriangleMesh plain =
      reconstruct_mesh(device(), encode_model(device(), model.mesh, model.skeleton, options).model);
  options.has_snap = true;
  const EncodeResult encoded = encode_model(device(), model.mesh, model.skeleton, options);
  const TriangleMesh snapped_mesh = reconstruct_mesh(device(), encoded.model);
  const SnapReport& report = encoded.report.snap.value();
  EXPECT_GT(report.snapped_vertices, 0.95 * report.vertices);
  EXPECT_LT(report.reverted_texels, 0.02 * 256 * 256);
  const MetroReport before = measure_metro(device(), model.mesh, plain),
                    after = measure_metro(device(), model.mesh, snapped_mesh);
  EXPECT_LT(symmetric_mean(after), 0.3 * symmetric_mean(before));
  EXPECT_LT(after.vertex.mean, 0.05 * before.vertex.mean);
  // Without the prefilter every texel lies on the mesh, wherever it reads.
  options.has_prefilter = false;
  const EncodeResult unfiltered = encode_model(device(), model.mesh, model.skeleton, options);
  EXPECT_LT(measure_metro(device(), reconstruct_mesh(device(), unfiltered.model), model.mesh).vertex.max, 2e-6);
  // With it only what reverts to the regular grid lies elsewhere.
  int differing = 0;
  for (std::size_t i = 0; i < unfiltered.model.texture.out.size(); ++i)
    differing += unfiltered.model.texture.out[i] != encoded.model.texture.out[i];
  EXPECT_LE(differing, report.reverted_texels + unfiltered.report.snap->reverted_texels);
  options.has_prefilter = true;
  EXPECT_TRUE(measure_manifold(snapped_mesh).is_closed_manifold());
  EXPECT_LE(static_cast<double>(count_self_intersections(snapped_mesh)),
            1.2 * static_cast<double>(count_self_intersections(plain)) + 10);
  const EncodeResult again = encode_model(device(), model.mesh, model.skeleton, options);
  EXPECT_EQ(encoded.model.texture.out, again.model.texture.out);
  EXPECT_EQ(encoded.model.texture.around, again.model.texture.around);
}

TEST(Placing, IsWhatIsExpectedToBeNearestButForTheFitsTime) {
  const auto chosen = [](std::size_t texels, std::size_t vertices, std::optional<bool> snap = {},
                         std::optional<bool> fit = {}) {
    const TexelPlacing placing = choose_placing(texels, vertices, snap, fit);
    return std::pair{placing.has_snap, placing.fit_steps};
  };
  using Chosen = std::pair<bool, double>;
  EXPECT_EQ(chosen(128 * 128, 40000), Chosen(false, 4));
  EXPECT_EQ(chosen(128 * 128, 20000), Chosen(true, 4));
  EXPECT_EQ(chosen(256 * 256, 1000), Chosen(true, 4));
  EXPECT_EQ(chosen(512 * 512, 14000), Chosen(true, 0));
  EXPECT_EQ(chosen(512 * 512, 150000), Chosen(true, 4));
  for (double per_vertex = 4, before = 4; per_vertex < 7.2; per_vertex += 0.1) {
    const double steps = chosen(512 * 512, static_cast<std::size_t>(512 * 512 / per_vertex)).second;
    EXPECT_LE(steps, before);
    EXPECT_GT(steps, before - 0.25);
    before = steps;
  }
  EXPECT_EQ(chosen(512 * 512, 37450), Chosen(true, 0));
  EXPECT_EQ(chosen(2048 * 2048, 4000000), Chosen(true, 0));
  EXPECT_EQ(chosen(512 * 512, 300000, {}, false), Chosen(false, 0));
  EXPECT_EQ(chosen(512 * 512, 14000, {}, true), Chosen(true, 4));
  EXPECT_EQ(chosen(512 * 512, 14000, false, {}), Chosen(false, 0));
}

TEST(Placing, IsReportedAndCanBeChosen) {
  const TestModel model = load_standard_model("bear");
  const auto reported = [&](const auto& change) {
    EncodeOptions options;
    options.width = options.height = 96;
    change(options);
    const EncodeReport report = encode_model(device(), model.mesh, model.skeleton, options).report;
    EXPECT_EQ(report.snap.has_value(), report.placing.has_snap);
    EXPECT_EQ(report.fit.has_value(), report.placing.is_fitted());
    return std::pair{report.snap.has_value(), report.fit.has_value()};
  };
  EXPECT_EQ(reported([](EncodeOptions&) {}), std::pair(true, true));
  EXPECT_EQ(reported([](EncodeOptions& o) { o.has_fit = false; }), std::pair(false, false));
  EXPECT_EQ(reported([](EncodeOptions& o) { o.has_snap = true, o.has_fit = false; }), std::pair(true, false));
  EXPECT_EQ(reported([](EncodeOptions& o) { o.has_snap = false; }), std::pair(false, true));
  EXPECT_EQ(reported([](EncodeOptions& o) { o.has_prefilter = false, o.width = 256; }),
            std::pair(true, false));  // texels on the mesh were asked for
  EXPECT_EQ(reported([](EncodeOptions& o) { o.method = Method::kSpd; }), std::pair(false, false));
}

TEST(Placing, LeavesNoSizeAtWhichTheErrorGrows) {
  const TestModel model = load_standard_model("bunny00");
  double last = 1;
  for (const int size : {128, 160, 192, 224, 256, 288, 320}) {
    EncodeOptions options;
    options.width = options.height = size;
    const double mean = symmetric_mean(
        measure_metro(device(), model.mesh,
                      reconstruct_mesh(device(), encode_model(device(), model.mesh, model.skeleton, options).model)));
    EXPECT_LT(mean, last) << size;
    last = mean;
  }
}

TEST(Snap, LeavesNoWideGapsBetweenSeamSamples) {
  const TestModel model = load_standard_model("bunny00");
  EncodeOptions options;
  options.width = options.height = 256;
  double widest_snapped = 0;
  for (const bool is_snapped : {false, true}) {
    options.has_snap = is_snapped;
    const SkeletexModel encoded = encode_model(device(), model.mesh, model.skeleton, options).model;
    const std::vector<Vec3> positions = lattice_positions(device(), encoded);
    const Lattice lattice = number_lattice(encoded);
    for (std::size_t arc = 0; arc < encoded.arcs.size(); ++arc) {
      std::vector<double> gaps;
      for (std::size_t i = 1; i < encoded.arcs[arc].samples.size(); ++i)
        gaps.push_back(
            (positions[lattice.first_sample[arc] + i] - positions[lattice.first_sample[arc] + i - 1]).norm());
      if (gaps.size() < 20) continue;
      const double mean = std::accumulate(gaps.begin(), gaps.end(), 0.0) / static_cast<double>(gaps.size());
      const double widest = *std::max_element(gaps.begin(), gaps.end()) / mean;
      // Chords of bends are shorter than the arc.
      EXPECT_LT(widest, is_snapped ? 1.6 : 1.1) << arc;
      if (is_snapped) widest_snapped = std::max(widest_snapped, widest);
    }
  }
  EXPECT_GT(widest_snapped, 1.3);  // they do move
}

}  // namespace skeletex
