// SPDX-License-Identifier: MIT
#include "skeletex/analysis/metro.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numbers>

#include "skeletex/convert/layers/surface_points.h"
#include "skeletex/convert/measure/nearest_search.h"
#include "skeletex/geometry/hilbert_order.h"
#include "skeletex/geometry/parallel.h"
#include "skeletex/geometry/point_triangle.h"
#include "skeletex/model/error.h"

namespace skeletex {
namespace {

constexpr std::size_t kPointsAtOnce = std::size_t{1} << 20;
constexpr std::size_t kBlock = 1 << 13;

void check_mesh(const TriangleMesh& mesh, const char* which) {
  if (mesh.triangles.empty()) throw InputError(fmt::format("{} has no triangles; nothing can be measured", which));
  const int count = static_cast<int>(mesh.positions.size());
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t)
    for (const int v : mesh.triangles[t])
      if (v < 0 || v >= count)
        throw InputError(fmt::format("{}: triangle {} names vertex {}, but there are {}", which, t, v, count));
  for (int v = 0; v < count; ++v)
    if (!mesh.positions[v].allFinite())
      throw InputError(fmt::format("{}: the position of vertex {} is not finite", which, v));
}

/// Distances from points that follow each other in space. The device finds the triangles; the distances are then
/// computed in double, because those between a mesh and its reconstruction come down to float32's resolution.
class DistanceSearch {
 public:
  DistanceSearch(ClContext& context, const TriangleMesh& mesh)
      : mesh_(mesh), search_(context, mesh, build_triangle_tree(mesh)) {}
  /// Places along the curve -> triangles.
  const std::vector<int>& order() const { return search_.order(); }

  /// \param feet  when given, the nearest points
  void find(std::span<const Vec3> points, std::span<double> distances, std::span<SurfacePoint> feet = {}) {
    nearest_.resize(points.size());
    search_.find(points, nearest_);
    for_each_index(points.size(), kBlock, [&](std::size_t i) {
      const Triangle& t = mesh_.triangles[nearest_[i]];
      const Vec3 offset =
          offset_from_triangle(points[i], mesh_.positions[t[0]], mesh_.positions[t[1]], mesh_.positions[t[2]]);
      distances[i] = offset.norm();
      if (!feet.empty()) feet[i] = point_in_triangle(mesh_, nearest_[i], points[i] - offset);
    });
  }

 private:
  const TriangleMesh& mesh_;
  NearestSearch search_;
  std::vector<int> nearest_;
};

class Accumulator {
 public:
  void add(std::span<const double> distances) {
    for (const double d : distances) {
      sum_ += d;
      squares_ += d * d;
      max_ = std::max(max_, d);
    }
    count_ += distances.size();
  }
  DistanceStatistics statistics(double unit) const {
    if (count_ == 0) return {};
    const double n = static_cast<double>(count_), mean = sum_ / n;
    return {mean / unit, std::sqrt(std::max(0.0, squares_ / n - mean * mean)) / unit, std::sqrt(squares_ / n) / unit,
            max_ / unit};
  }

 private:
  double sum_ = 0, squares_ = 0, max_ = 0;
  std::size_t count_ = 0;
};

/// The normals of a mesh, by triangle and for shading.
class MeshNormals {
 public:
  /// \param shading  without, those of vertex_normals
  MeshNormals(const TriangleMesh& mesh, const CornerValues<Vec3>* shading)
      : mesh_(mesh), shading_(shading ? *shading : CornerValues<Vec3>{vertex_normals(mesh), {}}) {}

  Vec3 of_triangle(const SurfacePoint& p) const {
    return area_vector(mesh_, mesh_.triangles[p.triangle]).stableNormalized();
  }
  Vec3 for_shading(const SurfacePoint& p) const {
    const Triangle& corners = shading_.of(mesh_, p.triangle);
    Vec3 sum = Vec3::Zero();
    for (int k = 0; k < 3; ++k) sum += static_cast<double>(p.weights[k]) * shading_.values[corners[k]];
    return sum;
  }

 private:
  const TriangleMesh& mesh_;
  CornerValues<Vec3> shading_;
};

/// Counts angles by hundredths of a degree.
class AngleCounter {
 public:
  /// \param degrees  below 0: there is none
  void add(double degrees) {
    if (degrees < 0) return;
    sum_ += degrees;
    ++count_;
    ++counts_[std::min(static_cast<std::size_t>(degrees * kPerDegree), counts_.size() - 1)];
  }
  AngleStatistics statistics() const {
    if (count_ == 0) return {};
    return {sum_ / static_cast<double>(count_), below(0.95), below(0.99)};
  }

 private:
  static constexpr double kPerDegree = 100;

  double below(double share) const {
    std::size_t i = 0;
    for (auto sum = static_cast<double>(counts_[0]);
         i + 1 < counts_.size() && sum < share * static_cast<double>(count_);)
      sum += static_cast<double>(counts_[++i]);
    return static_cast<double>(i + 1) / kPerDegree;
  }

  double sum_ = 0;
  std::size_t count_ = 0;
  std::vector<std::size_t> counts_ = std::vector<std::size_t>(18000);
};

/// Degrees between two directions of any length; -1 where one has none.
double angle_between(const Vec3& a, const Vec3& b) {
  const double dot = a.dot(b), cross = a.cross(b).norm();
  return dot == 0 && cross == 0 ? -1 : std::atan2(cross, dot) * 180 / std::numbers::pi;
}

/// Points spread evenly over a surface: triangle t of the order gets the whole numbers between the cumulated areas
/// before and after it, so that no stretch of the curve has one point more or less than its share. Inside the triangles
/// the points follow one plane-filling sequence (R2: multiples of the plastic number's powers, modulo 1).
class SurfaceSamples {
 public:
  SurfaceSamples(const TriangleMesh& mesh, const std::vector<int>& order, std::int64_t count, const char* which)
      : mesh_(mesh), order_(order), begin_(order.size() + 1) {
    std::vector<double> cumulated(order.size() + 1, 0);
    for (std::size_t i = 0; i < order.size(); ++i)
      cumulated[i + 1] = cumulated[i] + area_vector(mesh, mesh.triangles[order[i]]).norm();
    if (!(cumulated.back() > 0))
      throw InputError(fmt::format("{} has no area; no points can be spread over it", which));
    for (std::size_t i = 0; i <= order.size(); ++i)
      begin_[i] =
          static_cast<std::int64_t>(std::floor(cumulated[i] / cumulated.back() * static_cast<double>(count) + 0.5));
  }
  std::int64_t count() const { return begin_.back(); }

  void write(std::int64_t first, std::span<Vec3> points, std::span<SurfacePoint> places) const {
    for_each_block(points.size(), kBlock, [&](std::size_t, std::size_t block_begin, std::size_t block_end) {
      std::int64_t sample = first + static_cast<std::int64_t>(block_begin);
      auto place =
          static_cast<std::size_t>(std::upper_bound(begin_.begin(), begin_.end(), sample) - begin_.begin()) - 1;
      for (std::size_t i = block_begin; i < block_end; ++i, ++sample) {
        while (begin_[place + 1] <= sample) ++place;
        // Fractions in units of 2^-64: exact for any number of points.
        constexpr std::uint64_t kStepX = 13925035116211876495u, kStepY = 10511698010929265437u;
        const auto n = static_cast<std::uint64_t>(sample);
        double x = std::ldexp(static_cast<double>((n * kStepX + (std::uint64_t{1} << 63)) >> 11), -53);
        double y = std::ldexp(static_cast<double>((n * kStepY + (std::uint64_t{1} << 63)) >> 11), -53);
        if (x + y > 1) {
          x = 1 - x;
          y = 1 - y;
        }
        const Triangle& t = mesh_.triangles[order_[place]];
        const Vec3& a = mesh_.positions[t[0]];
        points[i] = a + x * (mesh_.positions[t[1]] - a) + y * (mesh_.positions[t[2]] - a);
        places[i] = {order_[place], Vec3(1 - x - y, x, y).cast<float>()};
      }
    });
  }

 private:
  const TriangleMesh& mesh_;
  const std::vector<int>& order_;
  std::vector<std::int64_t> begin_;  // first sample of each triangle of the order
};

struct SurfaceStatistics {
  DistanceStatistics distances;
  NormalStatistics normals;
};
/// \param own, other  of the surface that the samples lie on, and of the one that is searched; null: no angles
SurfaceStatistics measure_surface(DistanceSearch& search, const SurfaceSamples& samples, const MeshNormals* own,
                                  const MeshNormals* other, double unit) {
  Accumulator accumulator;
  AngleCounter surface, shading;
  std::vector<Vec3> points;
  std::vector<double> distances;
  std::vector<SurfacePoint> places, feet;
  std::vector<std::array<float, 2>> angles;
  for (std::int64_t first = 0; first < samples.count(); first += static_cast<std::int64_t>(kPointsAtOnce)) {
    points.resize(std::min<std::size_t>(kPointsAtOnce, static_cast<std::size_t>(samples.count() - first)));
    distances.resize(points.size());
    places.resize(points.size()), feet.resize(points.size()), angles.resize(points.size());
    samples.write(first, points, places);
    search.find(points, distances, feet);
    accumulator.add(distances);
    if (own == nullptr) continue;
    for_each_index(points.size(), kBlock, [&](std::size_t i) {
      angles[i] = {static_cast<float>(angle_between(own->of_triangle(places[i]), other->of_triangle(feet[i]))),
                   static_cast<float>(angle_between(own->for_shading(places[i]), other->for_shading(feet[i])))};
    });
    for (const auto& [of_surface, of_shading] : angles) surface.add(of_surface), shading.add(of_shading);
  }
  return {accumulator.statistics(unit), {surface.statistics(), shading.statistics()}};
}

/// Distances from points in any order; they are visited along a Hilbert curve.
std::vector<double> distances_in_order(DistanceSearch& search, std::span<const Vec3> points) {
  const std::vector<int> order = hilbert_order(points);
  std::vector<double> distances(points.size()), some_distances;
  std::vector<Vec3> some;
  for (std::size_t first = 0; first < order.size(); first += kPointsAtOnce) {
    const std::size_t count = std::min(kPointsAtOnce, order.size() - first);
    some.resize(count);
    some_distances.resize(count);
    for (std::size_t i = 0; i < count; ++i) some[i] = points[order[first + i]];
    search.find(some, some_distances);
    for (std::size_t i = 0; i < count; ++i) distances[order[first + i]] = some_distances[i];
  }
  return distances;
}

}  // namespace

struct SymmetricMetro::Prepared {
  DistanceSearch search;
  SurfaceSamples samples;
  double diagonal;

  Prepared(ClContext& context, const TriangleMesh& mesh, long count, const char* which)
      : search(context, mesh), samples(mesh, search.order(), count, which), diagonal(bounding_box(mesh).diagonal()) {}
};

SymmetricMetro::SymmetricMetro(ClContext& context, const TriangleMesh& surface, long samples)
    : context_(context), samples_(samples) {
  check_mesh(surface, "the first mesh");
  prepared_ = std::make_unique<Prepared>(context, surface, samples, "the first mesh");
}

SymmetricMetro::~SymmetricMetro() = default;

SymmetricDistance SymmetricMetro::measure(const TriangleMesh& other) {
  check_mesh(other, "the second mesh");
  Prepared second(context_, other, samples_, "the second mesh");
  const auto distances = [&](Prepared& to, const Prepared& from) {
    return measure_surface(to.search, from.samples, nullptr, nullptr, prepared_->diagonal).distances;
  };
  const DistanceStatistics forward = distances(second, *prepared_), backward = distances(*prepared_, second);
  return {(forward.mean + backward.mean) / 2, std::max(forward.max, backward.max)};
}

MetroReport measure_metro(ClContext& context, const TriangleMesh& a, const TriangleMesh& b,
                          const MetroOptions& options) {
  const auto start = std::chrono::steady_clock::now();
  check_mesh(a, "the first mesh");
  check_mesh(b, "the second mesh");
  if (options.samples < 0)
    throw InputError(
        fmt::format("{} samples were asked for; give a positive number, or 0 for the default", options.samples));
  const long count = options.samples > 0
                         ? options.samples
                         : std::max(100000L, 10L * static_cast<long>(std::max(a.positions.size(), b.positions.size())));
  MetroReport report;
  report.diagonal = bounding_box(a).diagonal();
  if (!(report.diagonal > 0))
    throw InputError("the first mesh is a single point; its diagonal, the unit of the result, is 0");

  DistanceSearch search_a(context, a);
  DistanceSearch search_b(context, b);
  const MeshNormals normals_a(a, options.normals_a), normals_b(b, options.normals_b);
  const SurfaceStatistics forward =
                              measure_surface(search_b, SurfaceSamples(a, search_a.order(), count, "the first mesh"),
                                              &normals_a, &normals_b, report.diagonal),
                          backward =
                              measure_surface(search_a, SurfaceSamples(b, search_b.order(), count, "the second mesh"),
                                              &normals_b, &normals_a, report.diagonal);
  report.forward = forward.distances, report.forward_normals = forward.normals;
  report.backward = backward.distances, report.backward_normals = backward.normals;
  const std::vector<double> distances = distances_in_order(search_b, a.positions);
  Accumulator accumulator;
  accumulator.add(distances);
  report.vertex = accumulator.statistics(report.diagonal);
  report.vertex_distances.assign(distances.begin(), distances.end());
  report.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return report;
}

std::vector<float> closest_distances(ClContext& context, const TriangleMesh& mesh, std::span<const Vec3> points) {
  check_mesh(mesh, "the mesh");
  for (std::size_t i = 0; i < points.size(); ++i)
    if (!points[i].allFinite()) throw InputError(fmt::format("point {} is not finite", i));
  DistanceSearch search(context, mesh);
  const std::vector<double> distances = distances_in_order(search, points);
  return {distances.begin(), distances.end()};
}

}  // namespace skeletex
