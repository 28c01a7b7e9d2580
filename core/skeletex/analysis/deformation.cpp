// SPDX-License-Identifier: MIT
#include "skeletex/analysis/deformation.h"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <tuple>

#include "skeletex/geometry/self_intersection.h"
#include "skeletex/model/error.h"

namespace skeletex {
namespace {

constexpr double kFoldDegrees = 90;

std::vector<Vec3> unit_normals(const TriangleMesh& mesh, std::span<const Vec3> positions) {
  std::vector<Vec3> normals;
  normals.reserve(mesh.triangles.size());
  for (const Triangle& t : mesh.triangles)
    normals.push_back((positions[t[1]] - positions[t[0]]).cross(positions[t[2]] - positions[t[0]]).normalized());
  return normals;
}

std::vector<double> bends_of(const TriangleMesh& mesh, const SurfaceEdges& edges, std::span<const Vec3> positions) {
  const std::vector<Vec3> normals = unit_normals(mesh, positions);
  std::vector<double> bends;
  bends.reserve(edges.triangles.size());
  for (const auto& [first, second] : edges.triangles)
    bends.push_back(std::acos(std::clamp(normals[first].dot(normals[second]), -1.0, 1.0)) * 180 / std::numbers::pi);
  return bends;
}

/// A triangle in its own plane: first edge along x.
Eigen::Matrix2d in_plane(const Vec3& a, const Vec3& b, const Vec3& c) {
  const Vec3 first = b - a, second = c - a;
  const double length = first.norm();
  Eigen::Matrix2d edges;
  edges << length, first.dot(second) / length, 0, first.cross(second).norm() / length;
  return edges;
}

void check_count(const BindSurface& bind, std::span<const Vec3> positions) {
  if (positions.size() != bind.mesh.positions.size())
    throw InputError(
        fmt::format("the mesh in the pose has {} vertices, in the bind pose {}; they must be two poses of one model",
                    positions.size(), bind.mesh.positions.size()));
}

}  // namespace

SurfaceEdges surface_edges(const TriangleMesh& mesh) {
  SurfaceEdges edges;
  std::vector<std::tuple<int, int, int>> sides;  // lower vertex, higher vertex, triangle
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t)
    for (int i = 0; i < 3; ++i) {
      const auto [low, high] = std::minmax(mesh.triangles[t][i], mesh.triangles[t][(i + 1) % 3]);
      sides.emplace_back(low, high, static_cast<int>(t));
    }
  std::sort(sides.begin(), sides.end());
  for (std::size_t i = 0; i + 1 < sides.size(); ++i) {
    const auto& [a, b, first] = sides[i];
    const auto& [c, d, second] = sides[i + 1];
    if (a != c || b != d) continue;
    edges.vertices.push_back({a, b});
    edges.triangles.push_back({first, second});
  }
  edges.bends = bends_of(mesh, edges, mesh.positions);
  return edges;
}

std::vector<int> new_folds(const TriangleMesh& bind, const SurfaceEdges& edges, std::span<const Vec3> positions) {
  const std::vector<double> bends = bends_of(bind, edges, positions);
  std::vector<int> folds;
  for (std::size_t i = 0; i < bends.size(); ++i)
    if (bends[i] > kFoldDegrees && edges.bends[i] <= kFoldDegrees) folds.push_back(static_cast<int>(i));
  return folds;
}

BindSurface make_bind_surface(TriangleMesh mesh) {
  SurfaceEdges edges = surface_edges(mesh);
  auto intersections = find_self_intersections(mesh);
  return {std::move(mesh), std::move(edges), std::move(intersections)};
}

std::vector<TriangleEnergy> triangle_energies(const BindSurface& bind, std::span<const Vec3> positions) {
  check_count(bind, positions);
  std::vector<TriangleEnergy> energies;
  for (const Triangle& t : bind.mesh.triangles) {
    const auto& p = bind.mesh.positions;
    const Eigen::Matrix2d before = in_plane(p[t[0]], p[t[1]], p[t[2]]);
    const double area = 0.5 * before.determinant();
    if (!(area > 0)) continue;
    const Eigen::Matrix2d map = in_plane(positions[t[0]], positions[t[1]], positions[t[2]]) * before.inverse();
    const double size = map.squaredNorm(), determinant = map.determinant();
    // |J^-1|^2 of a 2 x 2 matrix is |J|^2 / det^2.
    energies.push_back({std::isfinite(size) && determinant > 0
                            ? std::min(1e6, 0.25 * (size + size / (determinant * determinant)))
                            : 1e6,
                        area});
  }
  return energies;
}

double energy_below(std::vector<TriangleEnergy> energies, double share) {
  std::sort(energies.begin(), energies.end(),
            [](const TriangleEnergy& a, const TriangleEnergy& b) { return a.energy < b.energy; });
  double area = 0, below = 0;
  for (const TriangleEnergy& triangle : energies) area += triangle.area;
  for (const TriangleEnergy& triangle : energies)
    if ((below += triangle.area) >= share * area) return triangle.energy;
  return energies.empty() ? 1 : energies.back().energy;
}

DeformationReport measure_deformation(const BindSurface& bind, std::span<const Vec3> positions) {
  check_count(bind, positions);
  DeformationReport report;
  report.new_folds = static_cast<long>(new_folds(bind.mesh, bind.edges, positions).size());
  const TriangleMesh posed{{positions.begin(), positions.end()}, bind.mesh.triangles};
  for (const auto& pair : find_self_intersections(posed))
    report.new_intersections += !std::binary_search(bind.intersections.begin(), bind.intersections.end(), pair);
  const std::vector<TriangleEnergy> energies = triangle_energies(bind, positions);
  double area = 0, sum = 0;
  for (const TriangleEnergy& triangle : energies) {
    area += triangle.area;
    sum += triangle.area * triangle.energy;
  }
  if (area > 0) report.energy_mean = sum / area;
  report.energy_99 = energy_below(energies, 0.99);
  const double volume = signed_volume(bind.mesh);
  report.volume_ratio = volume != 0 ? signed_volume(posed) / volume : 1;
  return report;
}

double added_bend(const BindSurface& bind, std::span<const Vec3> positions, const std::vector<bool>& is_chosen,
                  double share) {
  check_count(bind, positions);
  const std::vector<double> bends = bends_of(bind.mesh, bind.edges, positions);
  std::vector<double> added;
  for (std::size_t i = 0; i < bends.size(); ++i)
    if (is_chosen[i]) added.push_back(bends[i] - bind.edges.bends[i]);
  if (added.empty()) return 0;
  const auto at = added.begin() + static_cast<std::ptrdiff_t>(share * static_cast<double>(added.size() - 1));
  std::nth_element(added.begin(), at, added.end());
  return *at;
}

}  // namespace skeletex
