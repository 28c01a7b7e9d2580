// SPDX-License-Identifier: MIT
#include "skeletex/convert/layers/surface_points.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "skeletex/convert/measure/nearest_search.h"
#include "skeletex/geometry/parallel.h"
#include "skeletex/geometry/point_triangle.h"
#include "skeletex/reconstruct/displace.h"

namespace skeletex {
namespace {

constexpr std::size_t kBlock = 1 << 12;
constexpr double kNearEnough = 1e-6;  // of the diagonal, some rounding errors of single precision

/// The points of all rows of a model, and where each patch begins among them.
struct RowPoints {
  std::vector<Vec3> points;
  std::vector<int> first;

  /// Half the cross product of the lattice's steps along and around: against the outward normal, with the area of a
  /// cell. Zero at poles.
  Vec3 inward(const Patch& patch, BoneIndex bone, int row, int column) const {
    const Rectangle& r = patch.rectangle;
    const auto at = [&](int i, int j) { return points[first[bone] + i * r.width + (j + r.width) % r.width]; };
    const int before = std::max(row - 1, 0), after = std::min(row + 1, r.height - 1);
    return (at(after, column) - at(before, column)).cross(at(row, column + 1) - at(row, column - 1)) / 2;
  }
};

RowPoints points_of_rows(ClContext& context, const PreparedModel& prepared) {
  RowPoints rows;
  const DevicePlanes planes = row_points(context, prepared, RowChoice::kAll);
  rows.points.resize(planes.count);
  download_points(context, planes, prepared.model.origin, rows.points);
  int count = 0;
  for (const Patch& patch : prepared.model.patches) {
    rows.first.push_back(count);
    count += patch.rectangle.width * patch.rectangle.height;
  }
  return rows;
}

}  // namespace

SurfacePoint nearest_in_triangle(const TriangleMesh& mesh, TriangleIndex triangle, const Vec3& p) {
  const Triangle& t = mesh.triangles[triangle];
  return point_in_triangle(
      mesh, triangle, p - offset_from_triangle(p, mesh.positions[t[0]], mesh.positions[t[1]], mesh.positions[t[2]]));
}

SurfacePoint point_in_triangle(const TriangleMesh& mesh, TriangleIndex triangle, const Vec3& nearest) {
  const Triangle& t = mesh.triangles[triangle];
  const Vec3 &a = mesh.positions[t[0]], &b = mesh.positions[t[1]], &c = mesh.positions[t[2]];
  const Vec3 normal = (b - a).cross(c - a);
  const double squared = normal.squaredNorm();
  if (!(squared > 0)) return {triangle, {1, 0, 0}};
  Vec3 weights;
  weights[1] = (nearest - a).cross(c - a).dot(normal) / squared;
  weights[2] = (b - a).cross(nearest - a).dot(normal) / squared;
  weights[0] = 1 - weights[1] - weights[2];
  weights = weights.cwiseMax(0);
  return {triangle, (weights / weights.sum()).cast<float>()};
}

std::vector<SurfacePoint> find_surface_points(ClContext& context, const TriangleMesh& mesh, const TriangleTree& tree,
                                              std::span<const Probe> probes) {
  std::vector<Vec3> points;
  points.reserve(probes.size());
  for (const Probe& probe : probes) points.push_back(probe.point);
  std::vector<int> nearest(points.size());
  NearestSearch(context, mesh, tree).find(points, nearest, {}, static_cast<float>(kNearEnough * tree.scale));
  std::vector<SurfacePoint> found(points.size());
  for_each_index(points.size(), kBlock, [&](std::size_t i) {
    const auto looks_away = [&](int t) { return area_vector(mesh, mesh.triangles[t]).dot(probes[i].outward) < 0; };
    TriangleIndex triangle = nearest[i];
    if (looks_away(triangle)) {
      const NearestTriangle other =
          find_nearest_triangle(mesh, tree, points[i], probes[i].reach, [&](int t) { return !looks_away(t); });
      if (other.triangle >= 0) triangle = other.triangle;
    }
    found[i] = nearest_in_triangle(mesh, triangle, points[i]);
  });
  return found;
}

std::vector<SurfacePoint> points_on_original(ClContext& context, const TriangleMesh& original, const TriangleMesh& mesh,
                                             std::span<const SurfacePoint> points) {
  constexpr double kReach = 0.005;  // diagonals: for the other side of a thin part
  const double reach = kReach * bounding_box(mesh).diagonal();
  std::vector<Probe> probes(points.size());
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (points[i].triangle < 0) continue;
    const Triangle& t = mesh.triangles[points[i].triangle];
    for (int k = 0; k < 3; ++k) probes[i].point += static_cast<double>(points[i].weights[k]) * mesh.positions[t[k]];
    probes[i].outward = area_vector(mesh, t);
    probes[i].reach = reach;
  }
  std::vector<SurfacePoint> found = find_surface_points(context, original, build_triangle_tree(original), probes);
  for (std::size_t i = 0; i < points.size(); ++i)
    if (points[i].triangle < 0) found[i].triangle = -1;
  return found;
}

std::vector<SurfacePoint> surface_points(ClContext& context, const PreparedModel& prepared, const TriangleMesh& mesh,
                                         const TriangleTree& tree) {
  const SkeletexModel& model = prepared.model;
  const RowPoints rows = points_of_rows(context, prepared);
  std::vector<Probe> probes(rows.points.size());
  for_each_index(prepared.all_rows.size(), 8, [&](std::size_t k) {
    const auto [bone, row, vertex, quad] = prepared.all_rows[k];
    for (int j = 0; j < model.patches[bone].rectangle.width; ++j) {
      const Vec3 inward = rows.inward(model.patches[bone], bone, row, j);
      probes[vertex + j] = {rows.points[vertex + j], -inward, std::sqrt(inward.norm())};
    }
  });
  const std::vector<SurfacePoint> found = find_surface_points(context, mesh, tree, probes);
  std::vector<SurfacePoint> result(static_cast<std::size_t>(model.texture.width) * model.texture.height);
  for (const auto& [bone, row, vertex, quad] : prepared.all_rows) {
    const Rectangle& r = model.patches[bone].rectangle;
    std::copy_n(found.begin() + vertex, r.width,
                result.begin() + static_cast<std::ptrdiff_t>(r.y + row) * model.texture.width + r.x);
  }
  return result;
}

}  // namespace skeletex
