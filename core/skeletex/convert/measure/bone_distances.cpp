// SPDX-License-Identifier: MIT
#include "skeletex/convert/measure/bone_distances.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <limits>
#include <numeric>

#include "skeletex/convert/measure/nearest_search.h"
#include "skeletex/geometry/parallel.h"
#include "skeletex/geometry/point_triangle.h"

namespace skeletex {
namespace {

constexpr std::size_t kBlock = 1 << 10;

/// The points of all bones behind each other. What has no weight counts for the furthest alone.
struct Samples {
  std::vector<Vec3> points;
  std::vector<double> weights;
  std::vector<std::size_t> begins{0};  ///< per bone, and the end

  void add(const Vec3& point, double weight) { points.push_back(point), weights.push_back(weight); }
  void add_middle(const Vec3& a, const Vec3& b, const Vec3& c) { add((a + b + c) / 3, (b - a).cross(c - a).norm()); }
  void end_bone() { begins.push_back(points.size()); }
};

std::vector<float> find_distances(ClContext& context, std::span<const Vec3> points, const TriangleMesh& mesh,
                                  const TriangleTree& tree, double enough) {
  std::vector<int> triangles(points.size());
  std::vector<float> distances(points.size());
  NearestSearch(context, mesh, tree).find(points, triangles, distances, static_cast<float>(enough));
  return distances;
}

std::vector<BoneDistance> summarize(const Samples& samples, std::vector<float> distances) {
  std::vector<BoneDistance> found(samples.begins.size() - 1);
  for (std::size_t bone = 0; bone < found.size(); ++bone) {
    double sum = 0, weight = 0;
    for (std::size_t i = samples.begins[bone]; i < samples.begins[bone + 1]; ++i) {
      const double distance = static_cast<double>(distances[i]);
      sum += samples.weights[i] * distance, weight += samples.weights[i];
      if (distance > found[bone].furthest) found[bone].furthest = distance, found[bone].place = samples.points[i];
    }
    if (weight > 0) found[bone].mean = sum / weight;
    const auto begin = distances.begin() + static_cast<std::ptrdiff_t>(samples.begins[bone]),
               end = distances.begin() + static_cast<std::ptrdiff_t>(samples.begins[bone + 1]),
               middle = begin + (end - begin) / 2;
    if (begin == end) continue;
    std::nth_element(begin, middle, end);
    found[bone].median = static_cast<double>(*middle);
  }
  return found;
}

/// The distance of a point from the nearer one of two triangles that follow each other.
double distance_from_quad(const TriangleMesh& mesh, int first, const Vec3& point) {
  double least = std::numeric_limits<double>::infinity();
  for (const TriangleIndex triangle : {first, first + 1}) {
    const auto& [a, b, c] = mesh.triangles[triangle];
    least =
        std::min(least, offset_from_triangle(point, mesh.positions[a], mesh.positions[b], mesh.positions[c]).norm());
  }
  return least;
}

}  // namespace

std::vector<BoneDistance> vertex_distances(std::span<const Chart> charts, const TriangleMesh& mesh,
                                           const TriangleTree& tree, std::span<const std::vector<int>> quads,
                                           double enough) {
  Samples samples;
  for (const Chart& chart : charts) {
    for (std::size_t i = 0; i < chart.positions.size(); ++i)
      if (chart.kinds[i] == ChartVertex::kInner) samples.add(chart.positions[i], 1);
    samples.end_bone();
  }
  std::vector<float> distances(samples.points.size());
  for (std::size_t bone = 0; bone < charts.size(); ++bone) {
    const std::size_t first = samples.begins[bone];
    for_each_block(samples.begins[bone + 1] - first, kBlock, [&](std::size_t, std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) {
        const Vec3& point = samples.points[first + i];
        double distance = quads[bone].empty() ? std::numeric_limits<double>::infinity()
                                              : distance_from_quad(mesh, 2 * quads[bone][i], point);
        if (distance > enough) distance = find_nearest_triangle(mesh, tree, point, distance).distance;
        distances[first + i] = static_cast<float>(distance);
      }
    });
  }
  return summarize(samples, std::move(distances));
}

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
  return summarize(samples, find_distances(context, samples.points, mesh, tree, enough));
}

std::vector<BoneDistance> distances_to_surface(ClContext& context, const SkeletexModel& model, const Lattice& lattice,
                                               const TriangleMesh& mesh, const TriangleMesh& input,
                                               const TriangleTree& tree) {
  Samples samples;
  for (std::size_t bone = 0; bone < model.patches.size(); ++bone) {
    const Rectangle& r = model.patches[bone].rectangle;
    const int first = 2 * lattice.first_quad[bone], end = first + 2 * r.width * (r.height - 3);
    for (TriangleIndex triangle = first; triangle < end; ++triangle) {
      const auto& [a, b, c] = mesh.triangles[triangle];
      samples.add_middle(mesh.positions[a], mesh.positions[b], mesh.positions[c]);
    }
    samples.end_bone();
  }
  return summarize(samples, find_distances(context, samples.points, input, tree, 0));
}

}  // namespace skeletex
