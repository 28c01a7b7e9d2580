// SPDX-License-Identifier: MIT
#include <gtest/gtest.h>

#include <cstdio>
#include <numbers>
#include <random>
#include <set>

#include "skeletex/model/error.h"
#include "skeletex/reconstruct/displace.h"
#include "skeletex/reconstruct/lattice.h"
#include "skeletex/reconstruct/reconstruct_mesh.h"
#include "skeletex/reconstruct/seam_strip.h"
#include "support/mesh_topology.h"
#include "support/reconstruct_twin.h"
#include "support/synthetic_model.h"

namespace skeletex {
namespace {

ClContext& device() {
  static ClContext context;
  return context;
}

std::vector<std::pair<int, int>> same_sizes(const Skeleton& skeleton, int width, int height) {
  return std::vector<std::pair<int, int>>(skeleton.bones.size(), {width, height});
}

}  // namespace

TEST(Reconstruct, IsClosedOrientedManifoldOfTheRightGenusForEverySkeletonAndSize) {
  for (const NamedSkeleton& named : all_skeletons()) {
    const SyntheticSurface surface(named.skeleton, named.radius);
    for (const auto& [width, height] : {std::pair{4, 4}, {5, 4}, {4, 9}, {17, 6}, {64, 23}, {65, 5}, {90, 20}}) {
      const TriangleMesh mesh = reconstruct_mesh(device(), surface.model(same_sizes(named.skeleton, width, height)));
      EXPECT_EQ(broken_rule(mesh, surface.genus()), "") << named.name << " " << width << " x " << height;
    }
  }
}

TEST(Reconstruct, IsClosedForRandomTreesAndRandomRectanglesDownToFourByFour) {
  for (unsigned seed = 1; seed <= 25; ++seed) {
    const int bones = 2 + static_cast<int>(seed) * 7 % 39;
    const SyntheticSurface surface(random_tree(bones, seed), 0.15);
    const SkeletexModel model = surface.model(random_sizes(bones, 4, seed % 2 ? 9 : 40, seed));
    const TriangleMesh mesh = reconstruct_mesh(device(), model);
    ASSERT_EQ(broken_rule(mesh, 0), "") << "seed " << seed << ", " << bones << " bones";
    EXPECT_EQ(static_cast<int>(mesh.triangles.size()), number_lattice(model).triangle_count);
  }
}

TEST(Reconstruct, VerticesLieOnTheSurfaceThatWasSampled) {
  for (const NamedSkeleton& named : all_skeletons()) {
    const SyntheticSurface surface(named.skeleton, named.radius);
    const SkeletexModel model = surface.model(same_sizes(named.skeleton, 37, 23));
    const Lattice lattice = number_lattice(model);
    const TriangleMesh mesh = reconstruct_mesh(device(), model);
    double worst = 0;
    for (int bone = 0; bone < static_cast<int>(model.patches.size()); ++bone) {
      const Patch& patch = model.patches[bone];
      for (int r = 1; r + 1 < patch.rectangle.height; ++r)
        for (int j = 0; j < patch.rectangle.width; ++j) {
          const int vertex = lattice.first_inner[bone] + (r - 1) * patch.rectangle.width + j;
          const Vec3 expected = surface.point(bone, patch.row_u[r], static_cast<double>(j) / patch.rectangle.width);
          worst = std::max(worst, (mesh.positions[vertex] - expected).norm());
        }
      for (int end = 0; end < 2; ++end)
        if (lattice.poles[bone][end] >= 0)
          worst = std::max(worst, (mesh.positions[lattice.poles[bone][end]] - surface.point(bone, end, 0)).norm());
    }
    for (int v = lattice.first_sample.empty() ? lattice.first_corner : lattice.first_sample[0];
         v < lattice.vertex_count; ++v) {
      double nearest = 1e9;
      for (const Node& node : surface.skeleton().nodes) {
        const Vec3 d = (mesh.positions[v] - node.position).normalized();
        nearest = std::min(nearest, (surface.seam_point(static_cast<int>(&node - surface.skeleton().nodes.data()), d) -
                                     mesh.positions[v])
                                        .norm());
      }
      worst = std::max(worst, nearest);
    }
    EXPECT_LT(worst, 1e-6 * model.diagonal) << named.name;
  }
}

TEST(Reconstruct, VolumeOfACapsuleComesOutPositiveAndConvergesToItsClosedForm) {
  const double radius = 0.3;
  const SyntheticSurface surface(lone_bone(), radius, 0);
  const double length = bone_length(surface.skeleton(), 0), pi = 3.14159265358979;
  const double exact = pi * radius * radius * length + 4.0 / 3 * pi * radius * radius * radius;
  double last = 1;
  for (const int size : {16, 32, 64, 128}) {
    const double missing = 1 - signed_volume(reconstruct_mesh(device(), surface.model({{size, size}}))) / exact;
    EXPECT_GT(missing, 0) << size;           // inscribed
    EXPECT_LT(missing, 0.3 * last) << size;  // second order
    last = missing;
  }
}

TEST(Reconstruct, VolumeIsPositiveWhereTheSurfaceIsEmbedded) {
  for (const NamedSkeleton& named : all_skeletons()) {
    const SyntheticSurface surface(named.skeleton, named.radius);
    EXPECT_GT(signed_volume(reconstruct_mesh(device(), surface.model(same_sizes(named.skeleton, 24, 12)))), 0)
        << named.name;
  }
}

TEST(Reconstruct, TrianglesOfAPlainCapsuleAllFaceOutward) {
  const SyntheticSurface surface(lone_bone(), 0.3, 0);
  const TriangleMesh mesh = reconstruct_mesh(device(), surface.model({{33, 30}}));
  const Vec3 head = surface.skeleton().nodes[0].position, tail = surface.skeleton().nodes[1].position;
  for (const Triangle& t : mesh.triangles) {
    const Vec3 centre = (mesh.positions[t[0]] + mesh.positions[t[1]] + mesh.positions[t[2]]) / 3;
    const double along = std::clamp((centre - head).dot(tail - head) / (tail - head).squaredNorm(), 0.0, 1.0);
    EXPECT_GT(area_vector(mesh, t).dot(centre - head - along * (tail - head)), 0);
  }
}

TEST(Reconstruct, TrianglesOfAPlainRingOfBonesAllFaceOutward) {
  const SyntheticSurface surface(ring(7), 0.2, 0);
  for (const auto& [width, height] : {std::pair{40, 9}, {7, 4}, {12, 30}}) {
    const TriangleMesh mesh = reconstruct_mesh(device(), surface.model(same_sizes(surface.skeleton(), width, height)));
    for (const Triangle& t : mesh.triangles) {
      const Vec3 centre = (mesh.positions[t[0]] + mesh.positions[t[1]] + mesh.positions[t[2]]) / 3;
      Vec3 foot = Vec3::Zero();
      double nearest = 1e9;
      for (int bone = 0; bone < 7; ++bone) {
        const Vec3 head = end_position(surface.skeleton(), bone, BoneEnd::kHead),
                   axis = end_position(surface.skeleton(), bone, BoneEnd::kTail) - head;
        const Vec3 q = head + std::clamp((centre - head).dot(axis) / axis.squaredNorm(), 0.0, 1.0) * axis;
        if ((centre - q).norm() < nearest) {
          nearest = (centre - q).norm();
          foot = q;
        }
      }
      EXPECT_GT(area_vector(mesh, t).normalized().dot((centre - foot).normalized()), 0.5);
    }
  }
}

TEST(Reconstruct, GarbageInTheTextureChangesPositionsOnly) {
  const SyntheticSurface surface(ring_with_arm(5), 0.2);
  std::mt19937 random(7);
  std::normal_distribution<float> normal(0, 1);
  SkeletexModel model = surface.model(random_sizes(6, 4, 20, 5));
  for (const float scale : {0.0f, 1e-30f, 1.0f, 1e6f, 1e30f}) {
    for (auto* plane : {&model.texture.along, &model.texture.around, &model.texture.out})
      for (float& value : *plane) value = scale * normal(random);
    for (SeamArc& arc : model.arcs)
      for (SeamSample& sample : arc.samples)
        sample = {std::uniform_real_distribution<double>(0, 1)(random), scale * std::abs(normal(random))};
    EXPECT_EQ(broken_rule(reconstruct_mesh(device(), model), 1), "") << "scale " << scale;
  }
}

TEST(Reconstruct, GivesTheSameBytesTwice) {
  const SyntheticSurface surface(cross(5), 0.3);
  const SkeletexModel model = surface.model(random_sizes(5, 4, 90, 11));
  const TriangleMesh a = reconstruct_mesh(device(), model), b = reconstruct_mesh(device(), model);
  EXPECT_EQ(a.triangles, b.triangles);
  EXPECT_TRUE(a.positions == b.positions);
}

TEST(Reconstruct, RefusesArcsThatDoNotMeetAndNamesTheBone) {
  const SyntheticSurface surface(y_branch(), 0.25);
  SkeletexModel model = surface.model(same_sizes(surface.skeleton(), 8, 8));
  model.ends[1][1].arcs[0].is_reversed = !model.ends[1][1].arcs[0].is_reversed;
  try {
    reconstruct_mesh(device(), model);
    FAIL();
  } catch (const InputError& error) {
    EXPECT_NE(std::string(error.what()).find("tail of bone \"bone1\""), std::string::npos) << error.what();
  }
}

// --- Seam strips ---------------------------------------------------------------------------------------------------

TEST(SeamStrip, JoinsAnyTwoRingsWithEveryEdgeOnceAndNoneTwice) {
  std::mt19937 random(20);
  std::uniform_real_distribution<double> unit(0, 1);
  for (int trial = 0; trial < 3000; ++trial) {
    const int m = 3 + static_cast<int>(random() % (trial % 3 ? 6 : 60)),
              n = 4 + static_cast<int>(random() % (trial % 2 ? 4 : 60));
    Ring seam, row;
    std::vector<Vec3> positions;
    std::vector<double> turns;
    for (int i = 0; i < m; ++i) turns.push_back(unit(random));
    const int kind = trial % 5;  // in order, crowded into a tenth, in any order, all the same, not numbers
    if (kind == 0 || kind == 1) std::sort(turns.begin(), turns.end());
    for (double& turn : turns) {
      if (kind == 1) turn *= 0.1;
      if (kind == 3) turn = 0.3;
      if (kind == 4) turn = std::nan("");
    }
    for (int i = 0; i < m + n; ++i) positions.push_back(Vec3(unit(random), unit(random), unit(random)));
    if (trial % 7 == 0) positions[trial % (m + n)].x() = INFINITY;
    for (int i = 0; i < m; ++i) seam.vertices.push_back(i);
    seam.turns = turns;
    for (int j = 0; j < n; ++j) {
      row.vertices.push_back(m + j);
      row.turns.push_back(static_cast<double>(j) / n);
    }
    std::vector<Triangle> triangles;
    const BoneEnd end = trial % 2 ? BoneEnd::kTail : BoneEnd::kHead;
    append_seam_strip(positions, seam, row, end, triangles);
    ASSERT_EQ(static_cast<int>(triangles.size()), m + n);
    // Closed off by two cones the strip is a sphere: the manifold check sees every edge.
    TriangleMesh mesh{positions, triangles};
    mesh.positions.push_back(Vec3::Zero());
    mesh.positions.push_back(Vec3::Zero());
    for (int i = 0; i < m; ++i) {
      const Triangle cap{(i + 1) % m, i, m + n};
      mesh.triangles.push_back(end == BoneEnd::kHead ? cap : Triangle{cap[1], cap[0], cap[2]});
    }
    for (int j = 0; j < n; ++j) {
      const Triangle cap{m + j, m + (j + 1) % n, m + n + 1};
      mesh.triangles.push_back(end == BoneEnd::kHead ? cap : Triangle{cap[1], cap[0], cap[2]});
    }
    ASSERT_EQ(broken_rule(mesh, 0), "") << "trial " << trial << ": seam of " << m << ", row of " << n;
  }
}

TEST(SeamStrip, BetweenEqualRingsIsALadder) {
  const int n = 24;
  Ring seam, row;
  std::vector<Vec3> positions;
  for (int ring_number = 0; ring_number < 2; ++ring_number)
    for (int i = 0; i < n; ++i) {
      const double turn = static_cast<double>(i) / n, angle = 2 * 3.14159265358979 * turn;
      positions.push_back(Vec3(std::cos(angle), std::sin(angle), 0.2 * ring_number));
      (ring_number ? row : seam).vertices.push_back(ring_number * n + i);
      (ring_number ? row : seam).turns.push_back(turn);
    }
  std::rotate(seam.vertices.begin(), seam.vertices.begin() + 5, seam.vertices.end());
  std::rotate(seam.turns.begin(), seam.turns.begin() + 5, seam.turns.end());
  std::vector<Triangle> triangles;
  append_seam_strip(positions, seam, row, BoneEnd::kHead, triangles);
  std::set<std::pair<int, int>> rungs;
  for (const Triangle& t : triangles)
    for (int i = 0; i < 3; ++i)
      if (t[i] < n && t[(i + 1) % 3] >= n) rungs.insert({t[i], t[(i + 1) % 3] - n});
  for (int i = 0; i < n; ++i) EXPECT_TRUE(rungs.count({i, i})) << i;
}

TEST(SeamStrip, HasNoCapsWhereAMergeWithoutIsAboutAsShort) {
  // A sample on the line between two columns, as where all three sit on one edge of the mesh.
  const int m = 48, n = 24;
  Ring seam, row;
  std::vector<Vec3> positions;
  const auto place = [](double turn, double height) {
    const double angle = 2 * 3.14159265358979 * turn;
    return Vec3(std::cos(angle), std::sin(angle), height);
  };
  for (int i = 0; i < m; ++i)
    positions.push_back(place((i + 0.5) / m, -0.1)), seam.vertices.push_back(i), seam.turns.push_back((i + 0.5) / m);
  for (int j = 0; j < n; ++j)
    positions.push_back(place(1.0 * j / n, 0)), row.vertices.push_back(m + j), row.turns.push_back(1.0 * j / n);
  for (const int column : {0, 7, 22}) {
    positions[2 * column + 1] = 0.5 * (positions[m + column] + positions[m + column + 1]);
    for (const BoneEnd end : {BoneEnd::kHead, BoneEnd::kTail}) {
      std::vector<Triangle> triangles;
      append_seam_strip(positions, seam, row, end, triangles);
      EXPECT_EQ(static_cast<int>(triangles.size()), m + n);
      for (const Triangle& t : triangles) {
        const Vec3 a = positions[t[0]], b = positions[t[1]], c = positions[t[2]];
        EXPECT_GT((b - a).cross(c - a).norm(),
                  0.01 * std::max({(b - a).squaredNorm(), (c - b).squaredNorm(), (a - c).squaredNorm()}))
            << column;
      }
    }
  }
}

TEST(SeamStrip, AnglesUnwrapToOneTurnThatNeverGoesBack) {
  std::mt19937 random(5);
  std::uniform_real_distribution<double> unit(0, 1);
  for (int trial = 0; trial < 2000; ++trial) {
    const int m = 3 + static_cast<int>(random() % 40);
    std::vector<double> turns;
    const double shift = unit(random), noise = (trial % 4) * 0.5 / m;
    for (int i = 0; i < m; ++i) {
      const double turn = (i + 0.5) / m + shift + noise * (unit(random) - 0.5);
      turns.push_back(turn - std::floor(turn));
    }
    std::vector<Vec3> points;
    for (const double turn : turns)
      points.push_back(Vec3(std::cos(2 * std::numbers::pi * turn), std::sin(2 * std::numbers::pi * turn), 0));
    const std::vector<double> result = seam_turns(points, turns);
    for (int i = 0; i + 1 < m; ++i) {
      EXPECT_LE(result[i], result[i + 1]);
      EXPECT_LE(result[i + 1] - result[i], 0.45 + 1e-12);
    }
    EXPECT_LE(result[m - 1], result[0] + 1 + 1e-12);
    EXPECT_GE(result[0], 0);
    EXPECT_LT(result[0], 1);
    if (noise > 0.5 / m || m < 6) continue;  // too few to leave every step below the limit
    for (int i = 0; i < m; ++i) EXPECT_NEAR(std::remainder(result[i] - turns[i], 1.0), 0, 1e-12);
  }
}

// --- Kernels against their twins -----------------------------------------------------------------------------------

TEST(ReconstructKernels, DisplaceAgreesWithItsTwinOnRandomAndUglyTexels) {
  const unsigned seed = 31;
  std::mt19937 random(seed);
  std::normal_distribution<float> normal;
  std::printf("seed %u\n", seed);
  const SyntheticSurface surface(random_tree(9, 4), 0.2);
  SkeletexModel model = surface.model(random_sizes(9, 4, 150, 8));
  for (std::size_t i = 0; i < model.texture.out.size(); ++i) {
    const float scale = std::pow(10.0f, 2 * normal(random));
    std::array<float, 3> texel{scale * normal(random), scale * normal(random), scale * normal(random)};
    switch (random() % 12) {
      case 0: texel = {0, 0, 0}; break;
      case 1: texel = {0, 0, texel[2]}; break;
      case 2: texel = {texel[0], 0, 0}; break;
      case 3: texel = {0, texel[1], 0}; break;
      case 4: texel = {1e-25f, 0, 1e-25f}; break;
      case 5: texel = {1e15f, 0, -1e15f}; break;
    }
    std::tie(model.texture.along[i], model.texture.around[i], model.texture.out[i]) =
        std::tie(texel[0], texel[1], texel[2]);
  }
  const FrameTables tables = frame_tables(model.skeleton, surface.separation(), model.patches, model.origin);
  for (const RowChoice choice : {RowChoice::kAll, RowChoice::kInner}) {
    const DeviceLattice lattice = upload_lattice(device(), tables, model.patches, model.texture, choice);
    DevicePlanes points = allocate_planes(device(), lattice.vertex_count);
    displace(device(), lattice, points);
    const auto [x, y, z] = download_planes(device(), points);
    std::size_t vertex = 0;
    for (std::size_t bone = 0; bone < model.patches.size(); ++bone) {
      const PatchRecord& patch = tables.patches[bone];
      const int margin = choice == RowChoice::kInner ? 1 : 0;
      for (int r = margin; r < patch.height - margin; ++r)
        for (int j = 0; j < patch.width; ++j, ++vertex) {
          const std::size_t at = static_cast<std::size_t>(patch.y + r) * model.texture.width + patch.x + j;
          const Vec3 texel(model.texture.along[at], model.texture.around[at], model.texture.out[at]);
          const auto expected =
              twin::displace(patch, tables.rows[patch.row_begin + r], tables.columns[patch.column_begin + j], texel);
          // A texel's direction d is exact to a few eps. The exit moves by at most (reach + reach^2 / e) per unit of d:
          // at the cylinder reach = e / sin, and d(reach) = reach / sin; the spheres are met less obliquely.
          const double eps = 1.2e-7;
          const double head = Vec3(patch.head[0], patch.head[1], patch.head[2]).norm();
          const double reach = expected.reach, e = expected.size;
          const double tolerance =
              16 * eps * (head + patch.length + reach + (e > 0 ? reach * std::min(reach / e, 1 / eps) : 0));
          const Vec3 got(x[vertex], y[vertex], z[vertex]);
          // Squares of less than the smallest float are zero: such texels end anywhere between foot and exit.
          if (e < 1e-17) {
            EXPECT_LE((got - expected.point).norm(), tolerance + reach + patch.length);
            continue;
          }
          ASSERT_LE((got - expected.point).norm(), tolerance)
              << "bone " << bone << " row " << r << " column " << j << " texel " << texel.transpose();
        }
    }
    EXPECT_EQ(vertex, lattice.vertex_count);
  }
}

TEST(ReconstructKernels, QuadsAgreeWithTheirTwinOnRandomPoints) {
  const SyntheticSurface surface(random_tree(7, 2), 0.2);
  SkeletexModel model = surface.model(random_sizes(7, 4, 140, 3));
  std::mt19937 random(2);
  std::normal_distribution<float> normal(0, 0.05f);
  for (auto* plane : {&model.texture.along, &model.texture.around, &model.texture.out})
    for (float& value : *plane) value += normal(random);
  const Lattice lattice = number_lattice(model);
  for (const DiagonalRule rule : {DiagonalRule::kNearest, DiagonalRule::kSmooth}) {
    model.diagonals = rule;
    const TriangleMesh mesh = reconstruct_mesh(device(), model);
    int quad = 0, unclear = 0;
    for (std::size_t bone = 0; bone < model.patches.size(); ++bone) {
      const auto [x, y, width, height] = model.patches[bone].rectangle;
      ASSERT_EQ(lattice.first_quad[bone], quad);
      for (int r = 1; r + 2 < height; ++r)
        for (int j = 0; j < width; ++j, ++quad) {
          const auto number = [&](int row, int column) {
            return lattice.first_inner[bone] + (row - 1) * width + (column + width) % width;
          };
          const auto point = [&](int row, int column) {
            return Vec3(mesh.positions[number(row, column)] - model.origin);
          };
          bool is_clear = false;
          const bool is_second = rule == DiagonalRule::kSmooth
                                     ? twin::takes_smoother_diagonal(point, r, j, height, is_clear)
                                     : twin::takes_second_diagonal(point, r, j, height, is_clear);
          unclear += !is_clear;
          if (!is_clear) continue;
          const int v00 = number(r, j), v01 = number(r, j + 1), v10 = number(r + 1, j), v11 = number(r + 1, j + 1);
          ASSERT_EQ(mesh.triangles[2 * quad], (is_second ? Triangle{v00, v01, v10} : Triangle{v00, v01, v11}));
          ASSERT_EQ(mesh.triangles[2 * quad + 1], (is_second ? Triangle{v10, v01, v11} : Triangle{v00, v11, v10}));
        }
    }
    EXPECT_EQ(quad, lattice.quad_count);
    EXPECT_LT(unclear, quad / 50);
  }
}

TEST(ReconstructKernels, QuadsOfASquareLatticeAllTakeTheSameDiagonal) {
  const SyntheticSurface surface(lone_bone(), 0.3, 0);
  SkeletexModel model = surface.model({{16, 40}});
  const TriangleMesh mesh = reconstruct_mesh(device(), model);
  const Lattice lattice = number_lattice(model);
  for (int quad = 0; quad < lattice.quad_count; ++quad)
    EXPECT_EQ(mesh.triangles[2 * quad][0], mesh.triangles[2 * quad + 1][0]) << quad;
}

}  // namespace skeletex
