// SPDX-License-Identifier: MIT
#include "skeletex/convert/measure/bone_distances.h"

#include <Eigen/Geometry>
#include <numeric>

#include "skeletex/geometry/nearest_search.h"

namespace skeletex {
namespace {

/// The points of all bones behind each other. What has no weight counts for the furthest alone.
struct Samples {
  std::vector<Vec3> points;
  std::vector<double> weights;
  std::vector<std::size_t> begins{0};  ///< per bone, and the end

  void add(const Vec3& point, double weight) { points.push_back(point), weights.push_back(weight); }
  void add_middle(const Vec3& a, const Vec3& b, const Vec3& c) { add((a + b + c) / 3, (b - a).cross(c - a).norm()); }
  void end_bone() { begins.push_back(points.size()); }
};

std::vector<BoneDistance> measure(ClContext& context, const Samples& samples, const TriangleMesh& mesh,
                                  const TriangleTree& tree, double enough) {
  std::vector<int> triangles(samples.points.size());
  std::vector<float> distances(samples.points.size());
  NearestSearch(context, mesh, tree).find(samples.points, triangles, distances, static_cast<float>(enough));
  std::vector<BoneDistance> found(samples.begins.size() - 1);
  for (std::size_t bone = 0; bone < found.size(); ++bone) {
    double sum = 0, weight = 0;
    for (std::size_t i = samples.begins[bone]; i < samples.begins[bone + 1]; ++i) {
      const double distance = static_cast<double>(distances[i]);
      sum += samples.weights[i] * distance, weight += samples.weights[i];
      if (distance > found[bone].furthest) found[bone].furthest = distance, found[bone].place = samples.points[i];
    }
    if (weight > 0) found[bone].mean = sum / weight;
  }
  return found;
}

}  // namespace

std::vector<BoneDistance> distances_from_bones(ClContext& context, std::span<const Chart> charts,
                                               const TriangleMesh& mesh, const TriangleTree& tree, double enough) {
  Samples samples;
  for (const Chart& chart : charts) {
    if (enough == 0)
      for (const auto& [a, b, c] : chart.triangles)
        samples.add_middle(chart.positions[a], chart.positions[b], chart.positions[c]);
    for (const Vec3& position : chart.positions) samples.add(position, enough == 0 ? 0 : 1);
    samples.end_bone();
  }
  return measure(context, samples, mesh, tree, enough);
}

std::vector<BoneDistance> distances_to_surface(ClContext& context, const SkeletexModel& model, const Lattice& lattice,
                                               const TriangleMesh& mesh, const TriangleMesh& input,
                                               const TriangleTree& tree) {
  Samples samples;
  for (std::size_t bone = 0; bone < model.patches.size(); ++bone) {
    const Rectangle& r = model.patches[bone].rectangle;
    const int first = 2 * lattice.first_quad[bone], end = first + 2 * r.width * (r.height - 3);
    for (int triangle = first; triangle < end; ++triangle) {
      const auto& [a, b, c] = mesh.triangles[triangle];
      samples.add_middle(mesh.positions[a], mesh.positions[b], mesh.positions[c]);
    }
    samples.end_bone();
  }
  return measure(context, samples, input, tree, 0);
}

}  // namespace skeletex
