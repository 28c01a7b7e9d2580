// SPDX-License-Identifier: MIT
// What the guard of the finished lattice stands on: lattices whose points move, their crossings, and distances found
// from nearby.
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <random>
#include <set>

#include "skeletex/convert/encode_model.h"
#include "skeletex/convert/layout/row_profile.h"
#include "skeletex/convert/sample/device_maps.h"
#include "skeletex/convert/snap/lattice_crossings.h"
#include "skeletex/convert/snap/lattice_mesh.h"
#include "skeletex/geometry/point_triangle.h"
#include "skeletex/geometry/self_intersection.h"
#include "support/load_model.h"

namespace skeletex {
namespace {

ClContext& device() {
  static ClContext context;
  return context;
}

SkeletexModel encoded(const char* name, int size) {
  const TestModel model = load_standard_model(name);
  EncodeOptions options;
  options.width = options.height = size;
  return encode_model(device(), model.mesh, model.skeleton, options).model;
}

/// A model's points per texel, moved at random by up to `noise` diagonals, on the device.
struct Points {
  ClBuffer<PatchRecord> patches;
  std::array<std::vector<float>, 3> planes;
  TexelPoints on_device;
  Points(const SkeletexModel& model, double noise, std::mt19937& random)
      : patches(device().upload(
            frame_tables(model.skeleton, SeparationPlanes(model.skeleton), model.patches, model.origin).patches)) {
    std::uniform_real_distribution<double> unit(-1, 1);
    const Lattice lattice = number_lattice(model);
    const std::vector<Vec3> positions = lattice_positions(device(), model);
    for (auto& plane : planes) plane.assign(static_cast<std::size_t>(model.texture.width) * model.texture.height, 0);
    for (std::size_t bone = 0; bone < model.patches.size(); ++bone) {
      const Rectangle& r = model.patches[bone].rectangle;
      for (int row = 0; row < r.height; ++row)
        for (int j = 0; j < r.width; ++j) {
          const int pole = lattice.poles[bone][row == 0 ? 0 : 1];
          const bool is_end = row == 0 || row == r.height - 1;
          if (is_end && pole < 0) continue;
          const Vec3& p = positions[is_end ? pole : lattice.first_inner[bone] + (row - 1) * r.width + j];
          for (int axis = 0; axis < 3; ++axis)
            planes[axis][(r.y + row) * static_cast<std::size_t>(model.texture.width) + r.x + j] =
                static_cast<float>(p[axis] - model.origin[axis] + (is_end ? 0 : noise * model.diagonal * unit(random)));
        }
    }
    upload();
  }
  void upload() { on_device = {device().upload(planes[0]), device().upload(planes[1]), device().upload(planes[2])}; }
  LatticeMesh lattice(const SkeletexModel& model, DiagonalRule rule,
                      LatticeMesh::Parts parts = LatticeMesh::Parts::kAll) const {
    return {device(), model, rule, frame_lattice(model), patches, on_device, parts};
  }
  std::array<ClMapping<float>, 3> map() const {
    auto [x, y, z] = device().map(on_device.x, on_device.y, on_device.z);
    return {std::move(x), std::move(y), std::move(z)};
  }
  /// Every `step`-th texel of inner rows takes its point from others. \return those
  std::vector<int> take(const SkeletexModel& model, const Points& others, int step) {
    std::vector<int> taken;
    int count = 0;
    for (const Patch& patch : model.patches)
      for (int row = 1; row + 1 < patch.rectangle.height; ++row)
        for (int j = 0; j < patch.rectangle.width; ++j)
          if (count++ % step == 0)
            taken.push_back((patch.rectangle.y + row) * model.texture.width + patch.rectangle.x + j);
    for (int axis = 0; axis < 3; ++axis) {
      for (const int texel : taken) planes[axis][texel] = others.planes[axis][texel];
      device().write(axis == 0 ? on_device.x : axis == 1 ? on_device.y : on_device.z, planes[axis]);
    }
    return taken;
  }
};

/// All of a lattice, in the order of the decoder's mesh; with the numbers that its triangles have in the lattice.
TriangleMesh whole(const LatticeMesh& lattice, std::vector<int>& numbers) {
  const SkeletexModel& model = lattice.model();
  TriangleMesh mesh;
  numbers.clear();
  std::vector<int> vertices(lattice.vertex_count(), -1);
  const auto add_vertex = [&](int vertex) {
    vertices[vertex] = static_cast<int>(mesh.positions.size());
    mesh.positions.push_back(lattice.position(vertex));
  };
  for (const Patch& patch : model.patches)
    for (int row = 1; row + 1 < patch.rectangle.height; ++row)
      for (int j = 0; j < patch.rectangle.width; ++j) {
        const int texel = (patch.rectangle.y + row) * model.texture.width + patch.rectangle.x + j;
        add_vertex(texel);
        if (row + 2 < patch.rectangle.height) numbers.push_back(2 * texel), numbers.push_back(2 * texel + 1);
      }
  for (int vertex = lattice.texel_count(); vertex < lattice.vertex_count(); ++vertex) add_vertex(vertex);
  for (int i = lattice.first_end_triangle(); i < lattice.triangle_count(); ++i) numbers.push_back(i);
  for (const int i : numbers) {
    const Triangle t = lattice.triangle(i);
    mesh.triangles.push_back({vertices[t[0]], vertices[t[1]], vertices[t[2]]});
  }
  return mesh;
}

using Pairs = std::vector<std::array<int, 2>>;
Pairs without_shared_vertices(const TriangleMesh& mesh, Pairs pairs) {
  std::erase_if(pairs, [&](const auto& pair) {
    const Triangle &a = mesh.triangles[pair[0]], &b = mesh.triangles[pair[1]];
    return std::any_of(a.begin(), a.end(), [&](int v) { return std::find(b.begin(), b.end(), v) != b.end(); });
  });
  return pairs;
}

TEST(LatticeMesh, IsTheModelsAndWithMovedPointsWhatTheyWouldMake) {
  std::mt19937 random(3);
  for (const DiagonalRule rule : {DiagonalRule::kNearest, DiagonalRule::kSmooth}) {
    SkeletexModel model = encoded("bear", 48);
    model.diagonals = rule;
    Points points(model, 0, random);
    const Points others(model, 2e-3, random);
    LatticeMesh lattice = points.lattice(model, rule);
    std::vector<int> numbers;
    const TriangleMesh before = whole(lattice, numbers), expected = reconstruct_mesh(device(), model);
    EXPECT_EQ(before.triangles, expected.triangles);
    ASSERT_EQ(before.positions.size(), expected.positions.size());
    for (std::size_t i = 0; i < expected.positions.size(); ++i)
      EXPECT_LT((before.positions[i] - expected.positions[i]).norm(), 1e-6 * model.diagonal);

    // One that has what it is asked for.
    LatticeMesh asked_of = points.lattice(model, rule, LatticeMesh::Parts::kAsked);
    ASSERT_EQ(asked_of.triangle_count(), lattice.triangle_count());
    std::vector<int> quads;
    for (const int number : numbers)
      if (number < lattice.first_end_triangle() && number % 6 == 0) quads.push_back(number / 2);
    std::sort(quads.begin(), quads.end());
    asked_of.choose(quads);
    const auto triangles_of = [&](int end) { return lattice.triangles_of_end(end / 2, static_cast<BoneEnd>(end % 2)); };
    std::vector<int> ends;  // one after the other, in two calls
    for (int end = 0; end < static_cast<int>(2 * model.patches.size()); end += 1 + end % 3) ends.push_back(end);
    asked_of.fill_ends(std::span(ends).first(2));
    asked_of.fill_ends(std::span(ends).subspan(2));
    for (const int end : ends)
      for (int number = triangles_of(end).first; number < triangles_of(end).second; ++number)
        EXPECT_EQ(asked_of.triangle(number), lattice.triangle(number)) << number;
    for (const int number : numbers)
      if (number < lattice.first_end_triangle() && number % 6 < 2) {
        EXPECT_EQ(asked_of.triangle(number), lattice.triangle(number)) << number;
      }

    lattice.release();
    const std::vector<int> changed = lattice.move(points.take(model, others, 20), points.map());
    const LatticeMesh made = points.lattice(model, rule);
    const TriangleMesh now = whole(lattice, numbers), remade = whole(made, numbers);
    EXPECT_EQ(now.positions, remade.positions);
    EXPECT_EQ(now.triangles, remade.triangles);
    const std::vector<int> diagonals = device().download(lattice.device_diagonals());
    std::vector<int> differing;
    for (std::size_t t = 0; t < now.triangles.size(); ++t) {
      const Triangle& triangle = now.triangles[t];
      if (numbers[t] < lattice.first_end_triangle()) {
        EXPECT_EQ(diagonals[numbers[t] / 2] != 0, lattice.takes_second(numbers[t] / 2));
      }
      if (triangle != before.triangles[t] ||
          std::any_of(triangle.begin(), triangle.end(), [&](int v) { return now.positions[v] != before.positions[v]; }))
        differing.push_back(numbers[t]);
    }
    std::sort(differing.begin(), differing.end());
    EXPECT_EQ(changed, differing);
  }
}

TEST(LatticeCrossings, AreThoseThatTheTreeFinds) {
  std::mt19937 random(5);
  struct Case {
    const char* name;
    int size;
    double noise;
  };
  for (const Case& each : {Case{"man", 128, 0}, Case{"man", 96, 1e-3}, Case{"eight", 64, 5e-3}, Case{"bear", 40, 0.1},
                           Case{"armadillo", 160, 0}}) {
    const SkeletexModel model = encoded(each.name, each.size);
    Points points(model, each.noise, random);
    const Points others(model, each.noise + 2e-3, random);
    LatticeMesh other_lattice = others.lattice(model, DiagonalRule::kNearest);
    LatticeMesh lattice = points.lattice(model, DiagonalRule::kNearest);
    LatticeCrossings crossings(lattice);
    std::vector<int> numbers;
    const TriangleMesh mesh = whole(lattice, numbers);
    // Pairs of the lattice as pairs of the mesh, and sorted as these.
    std::vector<int> places(lattice.triangle_count());
    for (std::size_t i = 0; i < numbers.size(); ++i) places[numbers[i]] = static_cast<int>(i);
    crossings.measure(lattice);
    Pairs found = crossings.find(lattice, numbers);
    EXPECT_TRUE(std::is_sorted(found.begin(), found.end()));
    for (auto& pair : found)
      pair = {std::min(places[pair[0]], places[pair[1]]), std::max(places[pair[0]], places[pair[1]])};
    std::sort(found.begin(), found.end());
    const Pairs expected = find_self_intersections(mesh);
    ASSERT_GT(expected.size(), 10u) << each.name;
    const Pairs apart = without_shared_vertices(mesh, found), expected_apart = without_shared_vertices(mesh, expected);
    // Shaken by a tenth of its size a lattice is no surface any more: what bends little can cross itself there.
    if (each.noise < 0.05) {
      EXPECT_EQ(apart, expected_apart) << each.name;
    }
    EXPECT_TRUE(std::includes(expected_apart.begin(), expected_apart.end(), apart.begin(), apart.end())) << each.name;
    EXPECT_GE(static_cast<double>(apart.size()), 0.99 * static_cast<double>(expected_apart.size())) << each.name;
    // At a vertex that they share, contact in the last digits of single precision counts, or not.
    EXPECT_NEAR(static_cast<double>(found.size()), static_cast<double>(expected.size()),
                2 + 0.05 * static_cast<double>(expected.size()))
        << each.name;

    lattice.release();
    const std::vector<int> changed = lattice.move(points.take(model, others, 50), points.map());
    crossings.measure(lattice, changed);
    const Pairs found_of_changed = crossings.find(lattice, changed);
    const auto all_of = [&](const LatticeMesh& measured) {
      LatticeCrossings anew(measured);
      anew.measure(measured);
      return anew.find(measured, numbers);
    };
    Pairs all = all_of(lattice);
    // Measured again where it has changed, it is known as a whole; and any triangles can be asked for.
    EXPECT_EQ(crossings.find(lattice, numbers), all) << each.name;
    std::vector<int> some;
    std::mt19937 choice(7);
    for (const int triangle : numbers)
      if (choice() % 7 == 0) some.push_back(triangle);
    std::sort(some.begin(), some.end());
    Pairs with_some = all;
    std::erase_if(with_some, [&](const auto& pair) {
      return !std::binary_search(some.begin(), some.end(), pair[0]) &&
             !std::binary_search(some.begin(), some.end(), pair[1]);
    });
    EXPECT_FALSE(with_some.empty()) << each.name;
    EXPECT_EQ(crossings.find(lattice, some), with_some) << each.name;
    const LatticeCrossings::Others same = crossings.find_between_same(all, lattice, 1),
                                   different = crossings.find_between_same(all, other_lattice, 1);
    EXPECT_EQ(same.pairs, all) << each.name;
    EXPECT_EQ(same.given_there, all.size()) << each.name;
    EXPECT_EQ(same.counted, all.size()) << each.name;
    const LatticeCrossings::Others same_of_some = crossings.find_between_same(all, lattice, 3);
    EXPECT_EQ(same_of_some.pairs, all) << each.name;
    EXPECT_EQ(same_of_some.given_there, same_of_some.counted) << each.name;
    EXPECT_LT(same_of_some.counted, all.size()) << each.name;
    EXPECT_GT(same_of_some.counted, 0u) << each.name;
    // Of a lattice whose triangles are not there yet it asks for those that it needs.
    LatticeMesh asked_of = others.lattice(model, DiagonalRule::kNearest, LatticeMesh::Parts::kAsked);
    for (const int share : {1, 3}) {
      const LatticeCrossings::Others of_whole = crossings.find_between_same(all, other_lattice, share),
                                     of_asked = crossings.find_between_same(all, asked_of, share);
      EXPECT_EQ(of_asked.pairs, of_whole.pairs) << each.name;
      EXPECT_EQ(of_asked.counted, of_whole.counted) << each.name;
      EXPECT_EQ(of_asked.given_there, of_whole.given_there) << each.name;
    }
    EXPECT_FALSE(different.pairs.empty()) << each.name;
    EXPECT_GT(different.given_there, 0u) << each.name;
    EXPECT_LT(different.given_there, all.size()) << each.name;
    if (each.noise < 0.05) {
      const Pairs all_of_other = all_of(other_lattice);
      EXPECT_TRUE(
          std::includes(all_of_other.begin(), all_of_other.end(), different.pairs.begin(), different.pairs.end()))
          << each.name;
    }
    const std::set<int> is_changed(changed.begin(), changed.end());
    std::erase_if(all,
                  [&](const auto& pair) { return !is_changed.contains(pair[0]) && !is_changed.contains(pair[1]); });
    EXPECT_EQ(found_of_changed, all) << each.name;
  }
}

TEST(TriangleBlock, LeavesOutOnlyPairsThatDoNotMeet) {
  std::mt19937 random(11);
  std::uniform_real_distribution<double> unit(0, 1);
  std::uniform_int_distribution<int> vertex(0, 39);
  int met = 0, overlapping = 0, unsettled = 0;
  for (int run = 0; run < 60; ++run) {
    // Few vertices, some of them in one plane, so that many triangles share some.
    std::vector<Vec3> points(40);
    for (Vec3& p : points) p = Vec3(unit(random), unit(random), unit(random) < 0.3 ? 0.5 : unit(random));
    std::array<TriangleBlock, 2> blocks;
    std::array<BlockBox, 2> around, around_asked;
    const double share = run % 3 == 0 ? 0.05 : 0.7;
    for (int b : {0, 1}) {
      TriangleBlock& block = blocks[b];
      for (BlockBox* box : {&around[b], &around_asked[b]}) box->least.fill(2), box->greatest.fill(-2);
      for (int i = 0; i < TriangleBlock::kSize; ++i) {
        const int first = vertex(random), second = (first + 1 + vertex(random) % 13) % 40,
                  third = (second + 1 + vertex(random) % 13) % 40;
        const Triangle triangle{first, second, third};
        block.numbers[i] = i, block.is_asked[i] = unit(random) < share ? 1 : 0;
        for (int axis = 0; axis < 3; ++axis) {
          for (int corner = 0; corner < 3; ++corner)
            block.vertices[corner][i] = triangle[corner],
            block.corners[corner][axis][i] = points[triangle[corner]][axis];
          const auto [low, high] = std::minmax({points[first][axis], points[second][axis], points[third][axis]});
          block.least[axis][i] = static_cast<float>(low) - 1e-6f,
          block.greatest[axis][i] = static_cast<float>(high) + 1e-6f;
          for (BlockBox* box : {&around[b], &around_asked[b]})
            if (box == &around[b] || block.is_asked[i] != 0) {
              box->least[axis] = std::min(box->least[axis], block.least[axis][i]);
              box->greatest[axis] = std::max(box->greatest[axis], block.greatest[axis][i]);
            }
        }
      }
      find_planes(1e-10, block);
    }
    for (const int b : {0, 1}) {
      const TriangleBlock &one = blocks[0], &other = blocks[b];
      BlockOverlaps overlaps;
      find_overlaps(one, other, around[b], around_asked[b], overlaps);
      BlockPairs pairs;
      const int count = find_unsettled(one, other, overlaps, pairs);
      const std::set<std::array<unsigned char, 2>> found(pairs.begin(), pairs.begin() + count);
      EXPECT_EQ(static_cast<int>(found.size()), count);
      for (int i = 0; i < TriangleBlock::kSize; ++i)
        for (int j = 0; j < TriangleBlock::kSize; ++j) {
          const bool is_found = found.contains({static_cast<unsigned char>(i), static_cast<unsigned char>(j)});
          bool is_asked = one.is_asked[i] != 0 || other.is_asked[j] != 0;
          if (b == 0) is_asked = is_asked && i < j;
          for (int axis = 0; axis < 3; ++axis)
            is_asked = is_asked && one.least[axis][i] <= other.greatest[axis][j] &&
                       other.least[axis][j] <= one.greatest[axis][i];
          overlapping += is_asked, unsettled += is_found;
          if (!is_asked) {
            EXPECT_FALSE(is_found);
          } else if (do_triangles_intersect(one.triangle(i), one.corners_of(i), other.triangle(j),
                                            other.corners_of(j))) {
            EXPECT_TRUE(is_found);
            ++met;
          }
        }
    }
  }
  EXPECT_GT(met, 1000);
  EXPECT_LT(unsettled, overlapping);
}

/// A tube whose vertices are moved at random, with a vertex or two on top of others, and a lattice beside it.
struct TubeAndLattice {
  static constexpr int kAround = 9, kRings = 7, kWidth = 15, kHeight = 12;
  Chart chart;
  std::vector<Patch> patches{
      {{2, 1, kWidth, kHeight}, Method::kVsm, SegmentTopology::kAnnulus, spread_rows_uniformly(kHeight)}};
  Skeleton skeleton{{{"head", Vec3(0, 0, 0)}, {"tail", Vec3(0, 0, 4)}}, {{"bone", 0, 1, Vec3(1, 0, 0)}}};
  DeviceLayout layout;
  DeviceMaps maps;
  TriangleMesh lattice;        // vertices are texels
  std::vector<int> numbers;    // of its triangles: of texel t 2 t and 2 t + 1
  std::vector<int> diagonals;  // per texel
  ClBuffer<int> texel_triangles;
  std::array<ClBuffer<float>, 3> points;
  std::vector<int> seeds;  // per texel

  static Vec3 on_tube(double u, double v) { return {std::cos(2 * M_PI * v), std::sin(2 * M_PI * v), 4 * u}; }
  explicit TubeAndLattice(std::mt19937& random, double noise) {
    std::uniform_real_distribution<double> unit(-1, 1);
    const auto shaken = [&](const Vec3& p) { return Vec3(p + noise * Vec3(unit(random), unit(random), unit(random))); };
    chart.bone = 0, chart.topology = SegmentTopology::kAnnulus;
    for (int ring = 0; ring < kRings; ++ring)
      for (int k = 0; k < kAround; ++k) {
        chart.u.push_back(ring / (kRings - 1.0)), chart.v.push_back(static_cast<double>(k) / kAround);
        chart.positions.push_back(shaken(on_tube(chart.u.back(), chart.v.back())));
        chart.kinds.push_back(ring == 0            ? ChartVertex::kHeadRow
                              : ring == kRings - 1 ? ChartVertex::kTailRow
                                                   : ChartVertex::kInner);
      }
    if (noise > 0) chart.positions[2 * kAround + 3] = chart.positions[2 * kAround + 4];
    for (int ring = 0; ring + 1 < kRings; ++ring)
      for (int k = 0; k < kAround; ++k) {
        const int l = (k + 1) % kAround, a = ring * kAround + k, b = ring * kAround + l;
        const auto turn = static_cast<std::int8_t>(l == 0);
        chart.triangles.push_back({a, b, b + kAround});
        chart.turns.push_back({0, turn, turn});
        chart.triangles.push_back({a, b + kAround, a + kAround});
        chart.turns.push_back({0, turn, 0});
      }
    layout = upload_layout(device(), patches, frame_tables(skeleton, SeparationPlanes(skeleton), patches, Vec3::Zero()),
                           20, 14);
    chart.half_edges = link_half_edges(chart.triangles, static_cast<int>(chart.positions.size()));
    maps = upload_maps(device(), {&chart, 1}, patches, Vec3::Zero());
    seeds.assign(layout.size(), 0x7fffffff);
    lattice.positions.resize(layout.size(), Vec3::Zero());
    diagonals.resize(layout.size(), 0);
    const auto texel = [](int row, int column) { return (1 + row) * 20 + 2 + column % kWidth; };
    for (int row = 1; row + 1 < kHeight; ++row)
      for (int j = 0; j < kWidth; ++j) {
        lattice.positions[texel(row, j)] = shaken(on_tube(row / (kHeight - 1.0), static_cast<double>(j) / kWidth));
        seeds[texel(row, j)] = static_cast<int>(2 * (row * (kRings - 1) / kHeight * kAround + j * kAround / kWidth));
        diagonals[texel(row, j)] = static_cast<int>(random() % 2);
      }
    for (int row = 1; row + 2 < kHeight; ++row)
      for (int j = 0; j < kWidth; ++j) {
        const int own = texel(row, j), right = texel(row, j + 1), above = texel(row + 1, j),
                  beyond = texel(row + 1, j + 1);
        const bool is_second = diagonals[own] != 0;
        lattice.triangles.push_back({own, right, is_second ? above : beyond}), numbers.push_back(2 * own);
        lattice.triangles.push_back({is_second ? right : own, beyond, above}), numbers.push_back(2 * own + 1);
      }
    lattice.positions[texel(2, 5)] = lattice.positions[texel(2, 6)];
    texel_triangles = device().upload(seeds);
    for (int axis = 0; axis < 3; ++axis) {
      std::vector<float> plane;
      for (const Vec3& p : lattice.positions) plane.push_back(static_cast<float>(p[axis]));
      points[axis] = device().upload(plane);
    }
  }
  double distance(const Vec3& p, const Triangle& t, const std::vector<Vec3>& positions) const {
    return offset_from_triangle(p, positions[t[0]], positions[t[1]], positions[t[2]]).norm();
  }
  Vec3 normal(const Triangle& t, const std::vector<Vec3>& positions) const {
    return (positions[t[1]] - positions[t[0]]).cross(positions[t[2]] - positions[t[0]]);
  }
};

void launch_measuring(const TubeAndLattice& tube, const ClBuffer<int>& listed, int count, float middle_enough2,
                      float worth_a_look2, float enough2, ClBuffer<float>& distances, ClBuffer<int>& turned,
                      const std::array<std::vector<float>, 3>& ends = {{{0}, {0}, {0}}}) {
  device().launch({"guard.cl", "measure_triangles"}, ClRange(count), count, static_cast<int>(tube.layout.size()),
                  middle_enough2, worth_a_look2, enough2, tube.maps.triangle_count, listed, tube.texel_triangles,
                  tube.maps.corners, tube.maps.across, tube.maps.x, tube.maps.y, tube.maps.z, tube.points[0],
                  tube.points[1], tube.points[2], device().upload(ends[0]), device().upload(ends[1]),
                  device().upload(ends[2]), distances, turned);
}

TEST(GuardKernels, AWalkIsNeverNearerThanTheMeshAndOnASmoothOneAsFar) {
  std::mt19937 random(7);
  for (const double noise : {0.0, 0.02, 0.3}) {
    const TubeAndLattice tube(random, noise);
    const int count = static_cast<int>(tube.lattice.triangles.size());
    std::vector<int> listed(count);
    for (int i = 0; i < count; ++i) listed[i] = (7 * i) % count;
    std::vector<int> listed_corners;
    for (const int i : listed)
      listed_corners.insert(listed_corners.end(), tube.lattice.triangles[i].begin(), tube.lattice.triangles[i].end());
    for (const float worth : {0.0f, 1e9f}) {
      auto distances = device().allocate<float>(count);
      auto turned = device().allocate<int>(count);
      launch_measuring(tube, device().upload(listed_corners), count, 0, worth, 0, distances, turned);
      const std::vector<float> found2 = device().download(distances);
      const std::vector<int> is_turned = device().download(turned);
      int further = 0, differently_turned = 0;
      for (int i = 0; i < count; ++i) {
        const Triangle& t = tube.lattice.triangles[listed[i]];
        const Vec3 &a = tube.lattice.positions[t[0]], ab = tube.lattice.positions[t[1]] - a,
                   ac = tube.lattice.positions[t[2]] - a;
        std::vector<std::array<double, 2>> places{{1 / 3.0, 1 / 3.0}};
        if (worth == 0)
          places.insert(places.end(), {{0, 0},
                                       {1, 0},
                                       {0, 1},
                                       {0.25, 0},
                                       {0.5, 0},
                                       {0.75, 0},
                                       {0, 0.25},
                                       {0, 0.5},
                                       {0, 0.75},
                                       {0.75, 0.25},
                                       {0.5, 0.5},
                                       {0.25, 0.75},
                                       {0.6, 0.2},
                                       {0.2, 0.6},
                                       {0.2, 0.2}});
        double expected = 0;
        bool is_against = false;
        for (const auto& place : places) {
          double least = 1e9;
          for (const Triangle& m : tube.chart.triangles) {
            const double distance = tube.distance(a + place[0] * ab + place[1] * ac, m, tube.chart.positions);
            if (distance >= least) continue;
            least = distance;
            if (&place == &places[0]) is_against = ab.cross(ac).dot(tube.normal(m, tube.chart.positions)) < 0;
          }
          expected = std::max(expected, least);
        }
        const double found = std::sqrt(found2[i]);
        EXPECT_GT(found, expected - 1e-4);
        further += found > expected + 1e-4;
        if (noise == 0) {
          EXPECT_LT(found, expected + 0.03);
        }
        differently_turned += is_against != (is_turned[i] != 0);
      }
      // With coincident vertices, and shaken by a third of its radius, the tube has places to get stuck in.
      // Without them a point under an edge may be led to the side that is a little further.
      if (noise > 0) continue;
      EXPECT_LE(further, 0.1 * count);
      EXPECT_LE(differently_turned, 0.02 * count);
    }
  }
}

TEST(FitKernels, TheWayFromATriangleOfTheLatticeLeadsToThePointOfTheMeshThatTheWalkEndsAt) {
  constexpr int kPlanes = 5;  // of fit.cl: area, residual, direction
  std::mt19937 random(9);
  for (const double noise : {0.0, 0.05, 0.3}) {
    const TubeAndLattice tube(random, noise);
    const std::size_t size = tube.layout.size();
    std::vector<int> starts;  // four planes
    for (int i = 0; i < 4; ++i) starts.insert(starts.end(), tube.seeds.begin(), tube.seeds.end());
    auto lattice = device().allocate<float>(2 * kPlanes * size), costs = device().allocate<float>(size),
         areas = device().allocate<float>(size);
    device().fill(costs, 0.f), device().fill(areas, 0.f);
    device().launch({"fit.cl", "match_lattice"}, tube.layout.range(), tube.layout.width, tube.layout.height,
                    tube.maps.triangle_count, tube.layout.texel_patches, tube.layout.patches, device().upload(starts),
                    tube.maps.corners, tube.maps.across, tube.maps.x, tube.maps.y, tube.maps.z,
                    device().upload(tube.diagonals), tube.points[0], tube.points[1], tube.points[2], lattice, costs,
                    areas);
    const std::vector<float> found = device().download(lattice);
    for (std::size_t i = 0; i < tube.lattice.triangles.size(); ++i) {
      const Triangle& t = tube.lattice.triangles[i];
      const auto value = [&](int plane) {
        return found[(kPlanes * (tube.numbers[i] % 2) + plane) * size + tube.numbers[i] / 2];
      };
      const Vec3 middle =
          (tube.lattice.positions[t[0]] + tube.lattice.positions[t[1]] + tube.lattice.positions[t[2]]) / 3;
      const Vec3 led_to = middle - value(1) * Vec3(value(2), value(3), value(4));
      double least = 1e9;
      for (const Triangle& m : tube.chart.triangles)
        least = std::min(least, tube.distance(led_to, m, tube.chart.positions));
      EXPECT_LT(least, 2e-5) << noise << " " << i;
    }
  }
}

TEST(GuardKernels, AVertexIsMeasuredToTheQuadsAroundItsPlace) {
  std::mt19937 random(8);
  const TubeAndLattice tube(random, 0.05);
  std::vector<int> vertices, patches;
  std::vector<float> places;
  for (int i = 0; i < static_cast<int>(tube.chart.positions.size()); ++i) {
    vertices.push_back(i), patches.push_back(0);
    places.push_back(
        static_cast<float>(tube.chart.v[i] * TubeAndLattice::kWidth + (i % 3 - 1) * TubeAndLattice::kWidth));
    places.push_back(static_cast<float>(tube.chart.u[i] * (TubeAndLattice::kHeight - 1)));
  }
  const int count = static_cast<int>(vertices.size());
  const auto measure = [&](float limit2) {
    auto distances = device().allocate<float>(count);
    auto nearest = device().allocate<int>(count);
    device().launch({"guard.cl", "measure_vertices"}, ClRange(count), count, tube.layout.width, limit2,
                    device().upload(vertices), device().upload(patches), device().upload(places), tube.layout.patches,
                    device().upload(tube.diagonals), tube.maps.x, tube.maps.y, tube.maps.z, tube.points[0],
                    tube.points[1], tube.points[2], distances, nearest);
    return device().download(distances, nearest);
  };
  const auto [found2, found] = measure(0);
  for (int i = 0; i < count; ++i) {
    double expected = 1e9;
    for (const Triangle& t : tube.lattice.triangles)
      expected = std::min(expected, tube.distance(tube.chart.positions[i], t, tube.lattice.positions));
    EXPECT_NEAR(std::sqrt(found2[i]), expected, 1e-4) << i;
    const auto number = std::find(tube.numbers.begin(), tube.numbers.end(), found[i]) - tube.numbers.begin();
    ASSERT_LT(number, std::ssize(tube.numbers));
    EXPECT_NEAR(tube.distance(tube.chart.positions[i], tube.lattice.triangles[number], tube.lattice.positions),
                expected, 1e-4)
        << i;
  }
  // What is near enough is not looked at more closely, and what is not is found as without that.
  std::vector<float> sorted = found2;
  std::nth_element(sorted.begin(), sorted.begin() + count / 2, sorted.end());
  const float limit2 = sorted[count / 2];
  const auto [limited2, limited] = measure(limit2);
  int further = 0;
  for (int i = 0; i < count; ++i) {
    EXPECT_EQ(limited2[i] > limit2, found2[i] > limit2) << i;
    EXPECT_GE(limited2[i], found2[i]) << i;
    further += limited2[i] > found2[i];
    if (found2[i] > limit2) {
      EXPECT_EQ(limited2[i], found2[i]) << i;
      EXPECT_EQ(limited[i], found[i]) << i;
    }
  }
  EXPECT_GT(further, 0);
}

// What is near enough is not looked at more closely, and what is not is found as without that.
TEST(GuardKernels, WalksEndWhereTheyAreNearEnough) {
  std::mt19937 random(10);
  const TubeAndLattice tube(random, 0.02);
  std::vector<int> corners;
  for (const Triangle& t : tube.lattice.triangles) corners.insert(corners.end(), t.begin(), t.end());
  const auto listed = device().upload(corners);
  const int count = static_cast<int>(tube.lattice.triangles.size());
  auto distances = device().allocate<float>(count);
  auto turned = device().allocate<int>(count);
  launch_measuring(tube, listed, count, 0, 0, 0, distances, turned);
  const std::vector<float> exact2 = device().download(distances);
  std::vector<float> sorted = exact2;
  std::nth_element(sorted.begin(), sorted.begin() + count / 2, sorted.end());
  const float enough2 = sorted[count / 2];
  for (const float middle2 : {0.0f, 0.1f * enough2}) {
    launch_measuring(tube, listed, count, middle2, middle2, enough2, distances, turned);
    const std::vector<float> found2 = device().download(distances);
    int near = 0;
    for (int i = 0; i < count; ++i) {
      if (middle2 > 0 && found2[i] <= middle2) continue;  // its other places were not looked at
      // A walk that begins elsewhere can be led elsewhere, but not nearer than the mesh.
      if (found2[i] <= enough2) {
        ++near;
        EXPECT_LE(exact2[i], std::max(1.05f * enough2, found2[i])) << i;
      } else {
        EXPECT_NEAR(found2[i], exact2[i], 0.05 * exact2[i]) << i;
      }
    }
    EXPECT_GT(near, count / 5);
    EXPECT_LT(near, 2 * count / 3);
  }
}

TEST(GuardKernels, TrianglesAtEndsAreMeasuredByTheirTexels) {
  std::mt19937 random(11);
  const TubeAndLattice tube(random, 0.02);
  const int count = static_cast<int>(tube.lattice.triangles.size()), texels = static_cast<int>(tube.layout.size());
  std::vector<int> corners, of_ends;
  std::array<std::vector<float>, 3> ends;
  for (const Triangle& t : tube.lattice.triangles) {
    corners.insert(corners.end(), t.begin(), t.end());
    of_ends.insert(of_ends.end(), {t[0], texels + static_cast<int>(ends[0].size()), t[2]});
    for (int axis = 0; axis < 3; ++axis) ends[axis].push_back(static_cast<float>(tube.lattice.positions[t[1]][axis]));
  }
  // One that no texel is a corner of.
  of_ends.insert(of_ends.end(), {texels, texels + 1, texels + 2});
  auto distances = device().allocate<float>(count + 1);
  auto turned = device().allocate<int>(count + 1);
  launch_measuring(tube, device().upload(corners), count, 0, 0, 0, distances, turned);
  const std::vector<float> expected2 = device().download(distances);
  const std::vector<int> expected_turned = device().download(turned);
  launch_measuring(tube, device().upload(of_ends), count + 1, 0, 0, 0, distances, turned, ends);
  const std::vector<float> found2 = device().download(distances);
  const std::vector<int> found_turned = device().download(turned);
  for (int i = 0; i < count; ++i) {
    EXPECT_EQ(found2[i], expected2[i]) << i;
    EXPECT_EQ(found_turned[i], expected_turned[i]) << i;
  }
  EXPECT_EQ(found2[count], -1);
}

TEST(GuardKernels, AWalkThatGoesAstrayIsBegunFromTheOtherCorners) {
  std::mt19937 random(13);
  const TubeAndLattice tube(random, 0.3);
  const int count = static_cast<int>(tube.lattice.triangles.size()), texels = static_cast<int>(tube.layout.size());
  auto distances = device().allocate<float>(count);
  auto turned = device().allocate<int>(count);
  // From all corners, and from each alone: the others are vertices of ends.
  std::vector<int> corners;
  for (const Triangle& t : tube.lattice.triangles) corners.insert(corners.end(), t.begin(), t.end());
  launch_measuring(tube, device().upload(corners), count, 0, 1e30f, 0, distances, turned);
  const std::vector<float> all2 = device().download(distances);
  std::vector<float> first2, best2(count, std::numeric_limits<float>::max());
  for (const int k : {0, 1, 2}) {
    std::vector<int> from_one;
    std::array<std::vector<float>, 3> ends;
    for (const Triangle& t : tube.lattice.triangles)
      for (int corner = 0; corner < 3; ++corner) {
        from_one.push_back(corner == k ? t[corner] : texels + static_cast<int>(ends[0].size()));
        if (corner == k) continue;
        for (int axis = 0; axis < 3; ++axis)
          ends[axis].push_back(static_cast<float>(tube.lattice.positions[t[corner]][axis]));
      }
    launch_measuring(tube, device().upload(from_one), count, 0, 1e30f, 0, distances, turned, ends);
    const std::vector<float> own2 = device().download(distances);
    if (k == 0) first2 = own2;
    for (int i = 0; i < count; ++i) best2[i] = std::min(best2[i], own2[i]);
  }
  int astray = 0;
  for (int i = 0; i < count; ++i) {
    const auto [a, b, c] = tube.lattice.triangles[i];
    const std::vector<Vec3>& at = tube.lattice.positions;
    const double near2 = 0.0025 * std::max((at[b] - at[a]).squaredNorm(), (at[c] - at[a]).squaredNorm());
    if (all2[i] > near2) {
      EXPECT_FLOAT_EQ(all2[i], best2[i]) << i;
      astray += first2[i] > 1.1f * best2[i];
    }
  }
  EXPECT_GT(astray, 3);
}

TEST(GuardKernels, SuspicionsAreWhereTheMeshsPlanesMeet) {
  std::mt19937 random(9);
  const TubeAndLattice tube(random, 0.2);
  const int quads = static_cast<int>(tube.lattice.triangles.size()) / 2, triangle_count = tube.maps.triangle_count;
  auto normals = device().allocate<float>(3 * static_cast<std::size_t>(triangle_count)),
       suspicions = device().allocate<float>(tube.layout.size());
  const int texels = static_cast<int>(tube.layout.size());
  auto texel_normals = device().allocate<float>(3 * tube.layout.size());
  device().launch({"guard.cl", "find_normals"}, ClRange(triangle_count), triangle_count, tube.maps.corners, tube.maps.x,
                  tube.maps.y, tube.maps.z, normals);
  device().launch({"guard.cl", "normals_of_texels"}, ClRange(texels), texels, triangle_count, tube.texel_triangles,
                  normals, texel_normals);
  std::vector<LatticeRow> rows;
  for (int row = 1; row + 2 < TubeAndLattice::kHeight; ++row) rows.push_back({0, row, 0, 0});
  device().launch({"guard.cl", "suspect_quads"}, row_range(device(), rows.size()), static_cast<int>(rows.size()),
                  tube.layout.width, texels, device().upload(rows), tube.layout.patches,
                  device().upload(tube.diagonals), tube.texel_triangles, texel_normals, tube.points[0], tube.points[1],
                  tube.points[2], suspicions);
  const std::vector<float> found2 = device().download(suspicions);
  int against = 0;
  const auto normal_at = [&](int vertex) {
    return tube.normal(tube.chart.triangles[tube.seeds[vertex]], tube.chart.positions);
  };
  // Points of a side in both planes' half spaces: the least height over it where one of the planes is reached, at the
  // crease.
  const auto height_over = [&](int from, int to) {
    const Vec3 along = tube.lattice.positions[to] - tube.lattice.positions[from];
    const auto rise = [&](const Vec3& n) {
      return n.norm() > 1e-6 ? std::abs(along.dot(n.normalized())) : along.lpNorm<1>();
    };
    double most = 0;
    for (double share = 0; share <= 1; share += 1e-3)
      most = std::max(most, std::min(share * rise(normal_at(from)), (1 - share) * rise(normal_at(to))));
    return most;
  };
  for (int quad = 0; quad < quads; ++quad) {
    double expected = 0;
    bool is_against = false, is_unsure = false;
    for (const int side : {0, 1}) {
      const Triangle& t = tube.lattice.triangles[2 * quad + side];
      const Vec3 own = tube.normal(t, tube.lattice.positions);
      for (int k = 0; k < 3; ++k) {
        const int from = t[k], to = t[(k + 1) % 3];
        expected = std::max(expected, height_over(from, to));
        const double product = own.dot(normal_at(from));
        is_against = is_against || product < -1e-4;
        is_unsure = is_unsure || std::abs(product) <= 1e-4;
      }
    }
    if (is_unsure) continue;
    against += is_against;
    if (is_against)
      EXPECT_TRUE(std::isinf(found2[tube.numbers[2 * quad] / 2])) << quad;
    else
      EXPECT_NEAR(std::sqrt(found2[tube.numbers[2 * quad] / 2]), expected, 2e-3) << quad;
  }
  EXPECT_LT(against, quads / 2);

  // Of some quads the same.
  std::vector<int> listed;
  for (int quad = quads - 1; quad >= 0; quad -= 3) listed.push_back(tube.numbers[2 * quad] / 2);
  auto suspicions_of_listed = device().allocate<float>(listed.size());
  device().launch({"guard.cl", "suspect_listed_quads"}, ClRange(listed.size()), static_cast<int>(listed.size()),
                  tube.layout.width, texels, device().upload(listed), tube.layout.texel_patches, tube.layout.patches,
                  device().upload(tube.diagonals), tube.texel_triangles, texel_normals, tube.points[0], tube.points[1],
                  tube.points[2], suspicions_of_listed);
  const std::vector<float> of_listed2 = device().download(suspicions_of_listed);
  for (std::size_t i = 0; i < listed.size(); ++i) EXPECT_FLOAT_EQ(of_listed2[i], found2[listed[i]]) << listed[i];

  // Before diagonals are chosen: triangles of either count, and the sides that begin at the texel.
  device().launch({"guard.cl", "suspect_any_quads"}, row_range(device(), rows.size()), static_cast<int>(rows.size()),
                  tube.layout.width, texels, device().upload(rows), tube.layout.patches, tube.texel_triangles,
                  texel_normals, tube.points[0], tube.points[1], tube.points[2], suspicions);
  const std::vector<float> any2 = device().download(suspicions);
  int looser = 0, measured = 0;
  for (int quad = 0; quad < quads; ++quad) {
    const int own = tube.numbers[2 * quad] / 2, line = own - own % tube.layout.width + 2, column = own - line;
    const int right = line + (column + 1) % TubeAndLattice::kWidth, above = own + tube.layout.width,
              beyond = right + tube.layout.width;
    bool is_either_against = false, is_unsure = false;
    for (const Triangle& t : {Triangle{own, right, beyond}, Triangle{own, beyond, above}, Triangle{own, right, above},
                              Triangle{right, beyond, above}})
      for (const int vertex : t) {
        const double product = tube.normal(t, tube.lattice.positions).dot(normal_at(vertex));
        is_either_against = is_either_against || product < -1e-4;
        is_unsure = is_unsure || std::abs(product) <= 1e-4;
      }
    if (is_unsure) continue;
    looser += is_either_against && !std::isinf(found2[own]), measured += !is_either_against;
    if (is_either_against)
      EXPECT_TRUE(std::isinf(any2[own])) << quad;
    else
      EXPECT_NEAR(std::sqrt(any2[own]), std::max(height_over(own, right), height_over(own, above)), 2e-3) << quad;
  }
  EXPECT_GT(looser, 0);
  EXPECT_GT(measured, quads / 10);
}

// Walks over a mesh with thin legs end on the wrong side of one, far too far away; what the furthest seems to be then
// must not decide which others are measured.
TEST(Guard, DoesNotTakeTheRegularGridForNearerThanItIs) {
  for (const auto& [name, size] :
       {std::pair("triceratops", 64), std::pair("triceratops_17", 128), std::pair("diplodocus", 192)}) {
    const TestModel model = load_standard_model(name);
    EncodeOptions options;
    options.width = options.height = size;
    options.texel_share = TexelShare::kTriangles;
    options.has_snap = true, options.has_fit = false;
    const EncodeReport report = encode_model(device(), model.mesh, model.skeleton, options).report;
    const double share = static_cast<double>(report.snap->texels_put_back) / (size * size);
    RecordProperty(name, std::to_string(share));
    EXPECT_LT(share, 0.1) << name;  // then some three quarters
  }
}

TEST(Guard, LeavesNoPairsOfTrianglesThatSnappingHasMadeIntersect) {
  for (const char* name : {"bear", "diplodocus"}) {
    const TestModel model = load_standard_model(name);
    EncodeOptions options;
    options.width = options.height = 512;
    options.has_snap = options.has_fit = false;
    const auto pairs = [&] {
      return count_self_intersections(
          reconstruct_mesh(device(), encode_model(device(), model.mesh, model.skeleton, options).model));
    };
    const auto even = pairs();
    options.has_snap = true;
    EXPECT_LE(pairs(), even) << name;
  }
}

}  // namespace
}  // namespace skeletex
