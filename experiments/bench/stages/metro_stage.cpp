// SPDX-License-Identifier: MIT
#include <random>

#include "embree_scene.h"
#include "skeletex/analysis/metro.h"
#include "skeletex/geometry/hilbert_order.h"
#include "skeletex/geometry/parallel.h"
#include "skeletex/geometry/point_triangle.h"
#include "stages.h"

namespace skeletex {
namespace {

/// Points near a mesh, as the vertices of a reconstruction are; 16 per triangle, along a curve.
std::vector<Vec3> points_near(const TriangleMesh& mesh, double noise_rel_diag) {
  std::mt19937 random(1);
  std::uniform_real_distribution<double> share(0, 1);
  std::normal_distribution<double> noise(0, noise_rel_diag * bounding_box(mesh).diagonal());
  std::vector<Vec3> points;
  for (const auto& [a, b, c] : mesh.triangles)
    for (int k = 0; k < 16; ++k) {
      const double s = share(random), t = share(random) * (1 - s);
      points.push_back(mesh.positions[a] + s * (mesh.positions[b] - mesh.positions[a]) +
                       t * (mesh.positions[c] - mesh.positions[a]) + Vec3(noise(random), noise(random), noise(random)));
    }
  std::vector<Vec3> sorted;
  for (const int i : hilbert_order(points)) sorted.push_back(points[i]);
  return sorted;
}

double distance_from_triangle(const Vec3& point, const Vec3& a, const Vec3& b, const Vec3& c) {
  return offset_from_triangle(point, a, b, c).norm();
}

}  // namespace

Stage metro_stage(ClContext& context, MeshInputPointer input, double noise_rel_diag) {
  Stage stage;
  stage.name = "metro";
  stage.model = input->name;
  stage.size = static_cast<int>(input->mesh.triangles.size());
  stage.reference = "Embree's rtcPointQuery of the same points on all threads";
  const auto points = std::make_shared<const std::vector<Vec3>>(points_near(input->mesh, noise_rel_diag));
  stage.run = [&context, input, points] { closest_distances(context, input->mesh, *points); };
  stage.run_reference = [input, points] {
    std::vector<double> distances(points->size());
    return wall_ms([&] {
      const EmbreeScene scene(input->mesh.positions, input->mesh.triangles, distance_from_triangle);
      for_each_index(points->size(), 4096, [&](std::size_t i) { distances[i] = scene.closest_distance((*points)[i]); });
    });
  };
  stage.details = [points] {
    return std::vector<std::pair<std::string, double>>{{"points", static_cast<double>(points->size())}};
  };
  return stage;
}

}  // namespace skeletex
