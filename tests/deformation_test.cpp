// SPDX-License-Identifier: MIT
#include "skeletex/analysis/deformation.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <numbers>

#include "skeletex/edit/polish.h"
#include "skeletex/model/error.h"

namespace skeletex {
namespace {

/// A closed tube along x: `rings` rings of `sides` vertices, and at each end a tip, so that no bend is 90 degrees.
TriangleMesh tube(int rings, int sides, double radius, double length) {
  TriangleMesh mesh;
  for (int i = 0; i < rings; ++i)
    for (int j = 0; j < sides; ++j) {
      const double angle = 2 * std::numbers::pi * j / sides;
      mesh.positions.push_back({length * i / (rings - 1), radius * std::cos(angle), radius * std::sin(angle)});
    }
  const int head = static_cast<int>(mesh.positions.size());
  mesh.positions.push_back({-0.3, 0, 0});
  mesh.positions.push_back({length + 0.3, 0, 0});
  const auto at = [&](int i, int j) { return i * sides + j % sides; };
  for (int j = 0; j < sides; ++j) {
    mesh.triangles.push_back({head, at(0, j + 1), at(0, j)});
    mesh.triangles.push_back({head + 1, at(rings - 1, j), at(rings - 1, j + 1)});
    for (int i = 0; i + 1 < rings; ++i) {
      mesh.triangles.push_back({at(i, j), at(i + 1, j + 1), at(i + 1, j)});
      mesh.triangles.push_back({at(i, j), at(i, j + 1), at(i + 1, j + 1)});
    }
  }
  if (signed_volume(mesh) < 0)
    for (Triangle& t : mesh.triangles) std::swap(t[1], t[2]);
  return mesh;
}

std::vector<Vec3> moved(const TriangleMesh& mesh, const auto& map) {
  std::vector<Vec3> positions;
  for (const Vec3& p : mesh.positions) positions.push_back(map(p));
  return positions;
}

TEST(Deformation, ARigidMotionChangesNothing) {
  const BindSurface bind = make_bind_surface(tube(9, 12, 1, 8));
  const Eigen::Quaterniond rotation(Eigen::AngleAxisd(1.2, Vec3(1, 2, -1).normalized()));
  const DeformationReport report =
      measure_deformation(bind, moved(bind.mesh, [&](const Vec3& p) -> Vec3 { return rotation * p + Vec3(5, 6, 7); }));
  EXPECT_EQ(report.new_folds, 0);
  EXPECT_EQ(report.new_intersections, 0);
  EXPECT_NEAR(report.energy_mean, 1, 1e-12);
  EXPECT_NEAR(report.energy_99, 1, 1e-12);
  EXPECT_NEAR(report.volume_ratio, 1, 1e-12);
}

TEST(Deformation, EnergyAndVolumeOfAScalingAreKnown) {
  const BindSurface bind = make_bind_surface(tube(9, 12, 1, 8));
  const DeformationReport report =
      measure_deformation(bind, moved(bind.mesh, [](const Vec3& p) -> Vec3 { return 2 * p; }));
  EXPECT_NEAR(report.energy_mean, 0.25 * (8 + 0.5), 1e-12);
  EXPECT_NEAR(report.energy_99, 0.25 * (8 + 0.5), 1e-12);
  EXPECT_NEAR(report.volume_ratio, 8, 1e-12);
}

TEST(Deformation, OnlyWhatIsNewCounts) {
  // The end at x = 8 is pushed through the tube to x = -1: its separation plane turns back, and the other end is
  // pierced.
  const BindSurface bind = make_bind_surface(tube(9, 12, 1, 8));
  std::vector<Vec3> pushed = bind.mesh.positions;
  for (int j = 0; j < 12; ++j)
    pushed[8 * 12 + j] = Vec3(-1, 0.5 * pushed[8 * 12 + j].y(), 0.5 * pushed[8 * 12 + j].z());
  pushed.back() = Vec3(-1, 0, 0);
  const DeformationReport report = measure_deformation(bind, pushed);
  EXPECT_GE(report.new_folds, 12);
  EXPECT_GE(report.new_intersections, 12);
  EXPECT_GT(report.energy_99, 2);
  // Measured against itself as the bind pose nothing of it is new.
  const DeformationReport same = measure_deformation(make_bind_surface({pushed, bind.mesh.triangles}), pushed);
  EXPECT_EQ(same.new_folds, 0);
  EXPECT_EQ(same.new_intersections, 0);
}

TEST(Deformation, AddedBendIsThatOfTheChosenEdges) {
  const BindSurface bind = make_bind_surface(tube(3, 4, 1, 2));
  // A square tube bent at its middle ring: its two level sides turn by 30 degrees over that ring.
  const double angle = std::numbers::pi / 6;
  const auto bent = moved(bind.mesh, [&](const Vec3& p) -> Vec3 {
    return p.x() > 1.5 ? Vec3(Vec3(1, 0, 0) + Eigen::AngleAxisd(angle, Vec3::UnitZ()) * (p - Vec3(1, 0, 0))) : p;
  });
  std::vector<bool> middle, none(bind.edges.vertices.size(), false);
  for (const auto& [a, b] : bind.edges.vertices) middle.push_back(a / 4 == 1 && b / 4 == 1);
  const double most = added_bend(bind, bent, middle, 1);
  EXPECT_GT(most, 15);
  EXPECT_LT(most, 45);
  EXPECT_LE(added_bend(bind, bent, middle, 0), most);
  EXPECT_EQ(added_bend(bind, bent, none, 1), 0);
}

TEST(Deformation, AnotherMeshIsRefused) {
  const BindSurface bind = make_bind_surface(tube(3, 4, 1, 2));
  EXPECT_THROW(measure_deformation(bind, tube(4, 4, 1, 2).positions), InputError);
}

TEST(Polish, TakesFoldsAwayAndLeavesTheRest) {
  // One vertex in the middle of a bent tube is pulled over its neighbours.
  const TriangleMesh bind = tube(17, 24, 1, 8);
  const auto posed = moved(bind, [](const Vec3& p) -> Vec3 {
    return p.x() > 4 ? Vec3(Vec3(4, 0, 0) + Eigen::AngleAxisd(0.4, Vec3::UnitZ()) * (p - Vec3(4, 0, 0))) : p;
  });
  std::vector<Vec3> folded = posed, polished;
  const int pulled = 4 * 24 + 3;
  folded[pulled] += Vec3(1.3, 0, 0);
  polished = folded;
  const PolishReport report = polish_pose(bind, polished);
  EXPECT_GT(report.folds_before, 0);
  EXPECT_EQ(report.folds_after, 0);
  EXPECT_EQ(measure_deformation(make_bind_surface(bind), polished).new_folds, 0);
  EXPECT_LT((polished[pulled] - posed[pulled]).norm(), 0.6);
  std::size_t moved_vertices = 0;
  for (std::size_t v = 0; v < folded.size(); ++v) {
    moved_vertices += polished[v] != folded[v];
    if ((bind.positions[v] - bind.positions[pulled]).norm() > 3) {
      EXPECT_EQ(polished[v], folded[v]) << v;
    }
  }
  EXPECT_EQ(report.moved_vertices, moved_vertices);
  EXPECT_GT(report.farthest, 0.1);
}

TEST(Polish, APoseWithoutFoldsStaysAsItIs) {
  const TriangleMesh bind = tube(9, 12, 1, 8);
  const auto posed =
      moved(bind, [](const Vec3& p) -> Vec3 { return Eigen::AngleAxisd(1.2, Vec3::UnitZ()) * p + Vec3(0, 3, 0); });
  std::vector<Vec3> polished = posed;
  const PolishReport report = polish_pose(bind, polished);
  EXPECT_EQ(polished, posed);
  EXPECT_EQ(report.moved_vertices, 0u);
  EXPECT_EQ(report.rounds, 0);
}

TEST(Polish, NeverMakesFoldsOrIntersectionsMore) {
  // Vertices thrown about: folds and intersections everywhere.
  const TriangleMesh bind = tube(17, 24, 1, 8);
  const BindSurface surface = make_bind_surface(bind);
  for (const double size : {0.2, 0.4, 0.8}) {
    std::uint32_t state = 7;
    const auto next = [&] { return (state = state * 1664525u + 1013904223u) / 4294967296.0 - 0.5; };
    const auto thrown = moved(bind, [&](const Vec3& p) -> Vec3 {
      return p.x() > 3 && p.x() < 5 ? Vec3(p + size * Vec3(next(), next(), next())) : p;
    });
    std::vector<Vec3> polished = thrown;
    const PolishReport report = polish_pose(bind, polished);
    const DeformationReport before = measure_deformation(surface, thrown),
                            after = measure_deformation(surface, polished);
    EXPECT_EQ(before.new_folds, report.folds_before);
    EXPECT_EQ(after.new_folds, report.folds_after);
    EXPECT_LE(after.new_folds, before.new_folds);
    EXPECT_LE(after.new_intersections, before.new_intersections);
  }
}

TEST(Polish, AnotherMeshIsRefused) {
  std::vector<Vec3> positions = tube(4, 4, 1, 2).positions;
  EXPECT_THROW(polish_pose(tube(3, 4, 1, 2), positions), InputError);
}

}  // namespace
}  // namespace skeletex
