// SPDX-License-Identifier: MIT
#include "skeletex/convert/snap/revert_faults.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "skeletex/convert/encode_model.h"
#include "skeletex/convert/layout/row_profile.h"
#include "skeletex/geometry/self_intersection.h"
#include "support/load_model.h"

namespace skeletex {
namespace {

ClContext& device() {
  static ClContext context;
  return context;
}

TriangleMesh lattice_mesh(const LatticeFrame& frame, DiagonalRule rule, const TexelPlanes& points) {
  TriangleMesh mesh;
  build_lattice_mesh(device(), frame, rule, upload_planes(device(), points[0], points[1], points[2]), mesh);
  return mesh;
}

DevicePlanes upload(const TexelPlanes& points) { return upload_planes(device(), points[0], points[1], points[2]); }

/// An egg around one bone with poles at both ends, and a lattice of half its resolution whose texels sit on every other
/// of its vertices.
struct Egg {
  static constexpr int kWidth = 24, kHeight = 21, kAround = 2 * kWidth, kRings = 2 * (kHeight - 1);
  SkeletexModel model;
  TriangleMesh mesh;
  TriangleTree tree;
  std::vector<Chart> charts{1};
  PlacedTexels regular;

  static Vec3 point(double u, double v) {
    const double angle = 2 * std::numbers::pi * v, radius = std::sin(std::numbers::pi * u);
    return {radius * std::cos(angle), radius * std::sin(angle), 2 - 2 * std::cos(std::numbers::pi * u)};
  }
  static int texel(int row, int column) { return (2 + row) * 32 + 3 + (column + kWidth) % kWidth; }
  static int vertex(int ring, int k) { return 1 + (ring - 1) * kAround + k % kAround; }

  /// \param spike  added to the radius of the vertex under the texel of row 9, column 7
  explicit Egg(double spike = 0) {
    model.skeleton = {{{"head", Vec3(0, 0, 1)}, {"tail", Vec3(0, 0, 3)}}, {{"bone", 0, 1, Vec3(1, 0, 0)}}};
    model.patches = {{{3, 2, kWidth, kHeight}, Method::kVsm, SegmentTopology::kSphere, spread_rows_uniformly(kHeight)}};
    model.ends.resize(1);
    model.texture.width = 32, model.texture.height = 24, model.diagonal = 5;
    add_mesh();
    const int tip = vertex(2 * 9, 2 * 7);
    mesh.positions[tip].head<2>() *= 1 + spike;
    charts[0].positions = mesh.positions, charts[0].triangles = mesh.triangles;
    tree = build_triangle_tree(mesh);
    const std::size_t size = 32 * 24;
    for (auto& plane : regular.points) plane.assign(size, 0);
    regular.offset_x.assign(size, 0), regular.offset_y.assign(size, 0), regular.anchors.assign(size, 0);
    regular.map_triangles.assign(size, 1 << 30);
    for (int row = 0; row < kHeight; ++row)
      for (int column = 0; column < kWidth; ++column)
        place(texel(row, column),
              row == 9 && column == 7 ? mesh.positions[tip] : point(row / (kHeight - 1.0), column / double{kWidth}),
              regular);
  }
  void add_mesh() {
    Chart& chart = charts[0];
    const auto add = [&](double u, double v, ChartVertex kind) {
      mesh.positions.push_back(point(u, v)), chart.u.push_back(u), chart.v.push_back(v), chart.kinds.push_back(kind);
    };
    add(0, 0, ChartVertex::kHeadPole);
    for (int ring = 1; ring < kRings; ++ring)
      for (int k = 0; k < kAround; ++k) add(ring / double{kRings}, k / double{kAround}, ChartVertex::kInner);
    add(1, 0, ChartVertex::kTailPole);
    for (int k = 0; k < kAround; ++k) {
      mesh.triangles.push_back({0, vertex(1, k + 1), vertex(1, k)});
      for (int ring = 1; ring + 1 < kRings; ++ring) {
        mesh.triangles.push_back({vertex(ring, k), vertex(ring, k + 1), vertex(ring + 1, k + 1)});
        mesh.triangles.push_back({vertex(ring, k), vertex(ring + 1, k + 1), vertex(ring + 1, k)});
      }
      mesh.triangles.push_back(
          {vertex(kRings - 1, k), vertex(kRings - 1, k + 1), static_cast<int>(mesh.positions.size()) - 1});
    }
  }
  void place(int at, const Vec3& p, PlacedTexels& texels) const {
    for (int axis = 0; axis < 3; ++axis) texels.points[axis][at] = static_cast<float>(p[axis]);
    texels.map_triangles[at] = find_nearest_triangle(mesh, tree, p).triangle;
  }
  RevertReport revert(PlacedTexels& texels) const {
    PlacedTexels grid = regular;
    grid.on_device = upload(grid.points), texels.on_device = upload(texels.points);
    const RevertReport report = revert_faults(device(), {model, mesh, tree, charts}, {}, grid, texels);
    EXPECT_EQ(download_planes(device(), texels.on_device), texels.points);
    return report;
  }
  TriangleMesh lattice(const PlacedTexels& texels) const {
    return lattice_mesh(frame_lattice(device(), model), model.diagonals, texels.points);
  }
  /// The texels whose points are not the same.
  static std::vector<int> differing(const PlacedTexels& one, const PlacedTexels& other) {
    std::vector<int> texels;
    for (int i = 0; i < static_cast<int>(one.anchors.size()); ++i)
      if (!one.has_same_point(i, other)) texels.push_back(i);
    return texels;
  }
};

TEST(RevertFaults, LeavesWhatHasNone) {
  const Egg egg;
  PlacedTexels texels = egg.regular;
  EXPECT_EQ(egg.revert(texels).reverted_texels, 0);
  EXPECT_EQ(texels.points, egg.regular.points);
  // A tenth of a cell along the surface, where cells are small.
  egg.place(Egg::texel(17, 5), Egg::point(17.1 / (Egg::kHeight - 1), 5.1 / Egg::kWidth), texels);
  const PlacedTexels moved = texels;
  const RevertReport report = egg.revert(texels);
  EXPECT_EQ(report.reverted_texels, 0);
  EXPECT_EQ(report.inverted_triangles, 0);
  EXPECT_EQ(texels.points, moved.points);
}

TEST(RevertFaults, FindsAPlantedFaultAndLeavesTheRest) {
  const Egg egg;
  const int own = Egg::texel(10, 5), beside = Egg::texel(10, 6);
  struct Case {
    const char* name;
    std::vector<std::pair<int, Vec3>> moves;
  };
  const double rows = Egg::kHeight - 1, columns = Egg::kWidth;
  for (const Case& each : {
           Case{"far outside", {{own, 1.3 * Egg::point(10 / rows, 5 / columns)}}},
           Case{"through the other side", {{own, Egg::point(10 / rows, 17 / columns) * 1.1}}},
           Case{"inverted", {{own, Egg::point(10 / rows, 6 / columns)}, {beside, Egg::point(10 / rows, 5 / columns)}}},
           Case{"over its neighbour", {{own, Egg::point(10.2 / rows, 6.6 / columns)}}},
       }) {
    PlacedTexels texels = egg.regular;
    // One that is in order elsewhere.
    const int elsewhere = Egg::texel(17, 17);
    egg.place(elsewhere, Egg::point(17.1 / rows, 17.1 / columns), texels);
    for (const auto& [texel, p] : each.moves) egg.place(texel, p, texels);
    PlacedTexels again = texels;
    const RevertReport report = egg.revert(texels);
    EXPECT_EQ(report.reverted_texels, static_cast<int>(each.moves.size())) << each.name;
    EXPECT_EQ(Egg::differing(texels, egg.regular), std::vector{elsewhere}) << each.name;
    EXPECT_EQ(report.inverted_triangles, 0) << each.name;
    EXPECT_EQ(count_self_intersections(egg.lattice(texels)), 0) << each.name;
    egg.revert(again);
    EXPECT_EQ(again.points, texels.points) << each.name;
  }
}

TEST(RevertFaults, FindsAVertexOfTheOriginalThatTheLatticeLeavesOut) {
  const Egg egg(0.5);
  PlacedTexels texels = egg.regular;
  egg.place(Egg::texel(9, 7), Egg::point(9.0 / (Egg::kHeight - 1), 7.4 / Egg::kWidth), texels);
  EXPECT_EQ(egg.revert(texels).reverted_texels, 1);
  EXPECT_EQ(texels.points, egg.regular.points);
}

TEST(RevertFaults, MovedTexelsMakeTheMeshOfTheirPoints) {
  const Egg egg;
  const LatticeFrame frame = frame_lattice(device(), egg.model);
  for (const DiagonalRule rule : {DiagonalRule::kNearest, DiagonalRule::kSmooth}) {
    PlacedTexels texels = egg.regular;
    DevicePlanes on_device = upload(texels.points);
    TriangleMesh moved = lattice_mesh(frame, rule, texels.points);
    const TriangleMesh before = moved;
    std::vector<int> listed;
    for (const auto& [row, column] : {std::pair(1, 3), std::pair(8, 0), std::pair(8, 23), std::pair(19, 7)}) {
      listed.push_back(Egg::texel(row, column));
      egg.place(listed.back(), Egg::point((row + 0.3) / (Egg::kHeight - 1), (column + 0.4) / Egg::kWidth), texels);
    }
    const std::vector<int> changed = move_texels(device(), frame, rule, listed, texels.points, on_device, moved);
    const TriangleMesh expected = lattice_mesh(frame, rule, texels.points);
    EXPECT_EQ(moved.positions, expected.positions);
    EXPECT_EQ(moved.triangles, expected.triangles);
    std::vector<int> differing;
    for (std::size_t i = 0; i < before.triangles.size(); ++i) {
      const Triangle& t = expected.triangles[i];
      if (t != before.triangles[i] ||
          std::any_of(t.begin(), t.end(), [&](int v) { return before.positions[v] != expected.positions[v]; }))
        differing.push_back(static_cast<int>(i));
    }
    EXPECT_EQ(changed, differing);
  }
}

TEST(RevertFaults, TheLatticeIsTheDecodersMesh) {
  const TestModel model = load_standard_model("bear");
  EncodeOptions options;
  options.width = options.height = 64;
  const SkeletexModel encoded = encode_model(device(), model.mesh, model.skeleton, options).model;
  const TriangleMesh expected = reconstruct_mesh(device(), encoded);
  const LatticeFrame frame = frame_lattice(device(), encoded);
  TexelPlanes points;
  for (auto& plane : points) plane.assign(encoded.texture.out.size(), 0);
  for (std::size_t vertex = 0; vertex < frame.texels.size(); ++vertex)
    for (int axis = 0; axis < 3; ++axis)
      if (frame.texels[vertex] >= 0)
        points[axis][frame.texels[vertex]] =
            static_cast<float>(expected.positions[vertex][axis] - encoded.origin[axis]);
  const TriangleMesh mesh = lattice_mesh(frame, encoded.diagonals, points);
  EXPECT_EQ(mesh.triangles, expected.triangles);
  for (std::size_t i = 0; i < expected.positions.size(); ++i)
    EXPECT_LT((mesh.positions[i] - expected.positions[i]).norm(), 1e-6 * encoded.diagonal);
}

TEST(RevertFaults, LeavesHardlyAnyPairsOfTrianglesThatSnappingHasMadeIntersect) {
  const TestModel model = load_standard_model("bear");
  EncodeOptions options;
  options.width = options.height = 512;
  options.has_snap = options.has_fit = false;
  const auto pairs = [&] {
    return count_self_intersections(
        reconstruct_mesh(device(), encode_model(device(), model.mesh, model.skeleton, options).model));
  };
  const auto of_regular_grid = pairs();
  options.has_snap = true;
  // Texels are rounded once more when they are stored: slivers that touch can intersect by that.
  EXPECT_LE(pairs(), of_regular_grid + 5);
}

// The limit is the regular grid's furthest: were it measured as too near, nearly all texels would revert.
TEST(RevertFaults, DoesNotTakeTheRegularGridForNearerThanItIs) {
  for (const auto& [name, size] : {std::pair("triceratops", 64), std::pair("triceratops_17", 128)}) {
    const TestModel model = load_standard_model(name);
    EncodeOptions options;
    options.width = options.height = size;
    options.texel_share = TexelShare::kTriangles;
    options.has_snap = true, options.has_fit = false;
    const EncodeReport report = encode_model(device(), model.mesh, model.skeleton, options).report;
    EXPECT_LT(static_cast<double>(report.snap->reverted_texels) / (size * size), 0.1) << name;
  }
}

}  // namespace
}  // namespace skeletex
