// SPDX-License-Identifier: MIT
#include "skeletex/convert/snap/triangle_distances.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <functional>
#include <iterator>
#include <limits>
#include <utility>

#include "skeletex/geometry/for_each_where.h"
#include "skeletex/geometry/point_triangle.h"

namespace skeletex {
namespace {

constexpr float kWorthALook = 0.15f;    // of the limit, at the middle of a triangle: then it is measured more densely
constexpr double kShareOfEven = 0.005;  // of the regular grid's quads, the most suspicious: among them is its furthest
constexpr std::size_t kLeastOfEven = 1000;      // or so many quads of a small one
constexpr std::size_t kAskedOfEven = 32;        // of their triangles, those that seem furthest
constexpr float kWorthAWalk = 0.75f;            // of the limit: how far a quad could be
constexpr float kEvenWorthALook = 0.5f;         // of the furthest middle, in the regular grid
constexpr std::size_t kWorthALookFirst = 2000;  // triangles that have changed: of fewer all are measured
// Places of a triangle, as shares of its first two sides: the middle, corners, quarters and middles of the sides, and
// points between them and the middle. As in guard.cl.
constexpr std::array<std::array<double, 2>, 1> kMiddle{{{1 / 3.0, 1 / 3.0}}};
constexpr std::array<std::array<double, 2>, 16> kPlaces{{{1 / 3.0, 1 / 3.0},
                                                         {0, 0},
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
                                                         {0.2, 0.2}}};

/// One work-item per entry of a list, in groups of one size: PoCL compiles a kernel for every size that it meets.
ClRange over(std::size_t count) { return {{count, 1}, {64, 1}}; }

/// \param arguments  of the kernel, between layout and points
template <class... Arguments>
ClBuffer<float> suspect(ClContext& context, const char* kernel, const DeviceLayout& layout,
                        const ClBuffer<LatticeRow>& rows, const TexelPoints& points, const Arguments&... arguments) {
  auto suspicions2 = context.allocate<float>(layout.size());
  context.fill(suspicions2, 0.f);
  context.launch({"guard.cl", kernel}, row_range(context, rows.size), static_cast<int>(rows.size), layout.width,
                 static_cast<int>(layout.size()), rows, layout.patches, arguments..., points.x, points.y, points.z,
                 suspicions2);
  return suspicions2;
}

using Measured = TriangleDistances::Measured;

/// Places of triangles of a lattice to be asked of the tree together.
class Queries {
 public:
  /// \param asked  none of its places is further than its distance, as far as is known
  template <std::size_t kCount>
  void add(const LatticeMesh& lattice, const Measured& asked, const std::array<std::array<double, 2>, kCount>& places) {
    begins_.push_back(points_.size());
    const auto [a, b, c] = lattice.corners(lattice.triangle(asked.triangle));
    for (const auto& [s, t] : places)
      points_.push_back(a + s * (b - a) + t * (c - a)), bounds_.push_back(asked.distance);
  }
  void find(NearestSearch& search) {
    nearest_.resize(points_.size()), distances_.resize(points_.size());
    search.find(points_, nearest_, distances_, 0, bounds_);
    begins_.push_back(points_.size());
  }
  struct Result {
    float furthest;  ///< of the places
    int nearest;     ///< of the original's triangles, to the first place
  };
  /// In the order in which they were added.
  Result result(std::size_t number) const {
    const auto first = distances_.begin() + static_cast<std::ptrdiff_t>(begins_[number]);
    return {*std::max_element(first, distances_.begin() + static_cast<std::ptrdiff_t>(begins_[number + 1])),
            nearest_[begins_[number]]};
  }

 private:
  std::vector<std::size_t> begins_;
  std::vector<Vec3> points_;
  std::vector<float> bounds_, distances_;
  std::vector<int> nearest_;
};

float squared(float x) { return x * x; }

/// Those that are more suspicious than that or look against the mesh. \param least  finite
std::vector<int> quads_above(const ClMapping<float>& suspicions2, float least) {
  std::vector<int> quads;
  for_each_where(
      std::span(suspicions2.data(), suspicions2.size()), [least](float suspicion2) { return suspicion2 > least; },
      [&](std::size_t texel) { quads.push_back(static_cast<int>(texel)); });
  return quads;
}
std::vector<int> triangles_of(const std::vector<int>& quads) {
  std::vector<int> triangles;
  triangles.reserve(2 * quads.size());
  for (const int texel : quads) triangles.push_back(2 * texel), triangles.push_back(2 * texel + 1);
  return triangles;
}
template <class Is>
std::vector<Measured> those_of(const std::vector<Measured>& measured, const Is& is) {
  std::vector<Measured> those;
  std::copy_if(measured.begin(), measured.end(), std::back_inserter(those), is);
  return those;
}
std::vector<int> numbers_of(const std::vector<Measured>& measured) {
  std::vector<int> numbers;
  for (const Measured& each : measured) numbers.push_back(each.triangle);
  return numbers;
}

}  // namespace

ClBuffer<float> find_texel_normals(ClContext& context, const DeviceLayout& layout, const DeviceMaps& maps,
                                   const ClBuffer<int>& texel_triangles) {
  auto normals = context.allocate<float>(3 * static_cast<std::size_t>(maps.triangle_count)),
       texel_normals = context.allocate<float>(3 * layout.size());
  const int texels = static_cast<int>(layout.size());
  context.launch({"guard.cl", "find_normals"}, over(maps.triangle_count), maps.triangle_count, maps.corners, maps.x,
                 maps.y, maps.z, normals);
  context.launch({"guard.cl", "normals_of_texels"}, over(texels), texels, maps.triangle_count, texel_triangles, normals,
                 texel_normals);
  return texel_normals;
}

ClBuffer<float> suspect_any_quads(ClContext& context, const DeviceLayout& layout, const ClBuffer<LatticeRow>& rows,
                                  const TexelPoints& points, const ClBuffer<int>& texel_triangles,
                                  const ClBuffer<float>& texel_normals) {
  return suspect(context, "suspect_any_quads", layout, rows, points, texel_triangles, texel_normals);
}

TriangleDistances::TriangleDistances(ClContext& context, const TriangleMesh& mesh, const DeviceLayout& layout,
                                     const DeviceMaps& maps, ClBuffer<float> texel_normals, NearestSearch search)
    : context_(context),
      mesh_(mesh),
      layout_(layout),
      maps_(maps),
      texel_normals_(std::move(texel_normals)),
      search_(std::move(search)) {}

float TriangleDistances::measure_even(LatticeMesh& lattice, const ClMapping<float>& suspicions2,
                                      const ClBuffer<int>& texel_triangles, std::vector<int>& turned) {
  std::vector<float> some;  // enough to tell how large the largest are, but for those that look against the mesh
  constexpr std::size_t kStep = 7;
  for (std::size_t i = 0; i < suspicions2.size(); i += kStep)
    if (!std::isinf(suspicions2[i])) some.push_back(suspicions2[i]);
  if (some.empty()) some.push_back(0);
  const auto asked_of = std::min(
      some.size() - 1,
      std::max(static_cast<std::size_t>(kShareOfEven * static_cast<double>(some.size())), kLeastOfEven / kStep));
  const auto last = some.begin() + static_cast<std::ptrdiff_t>(asked_of);
  std::nth_element(some.begin(), last, some.end(), std::greater<>());
  const std::vector<int> suspects = quads_above(suspicions2, *last);
  lattice.choose(suspects);
  const std::vector<int> asked = suspicious_of(lattice, triangles_of(suspects), texel_triangles, *last);
  constexpr float kNever = std::numeric_limits<float>::max();
  std::vector<Measured> measured = measure_near(lattice, asked, texel_triangles, {0, kNever, 0});
  const auto above = [&](float least) {
    return those_of(measured, [&](const Measured& each) { return each.distance >= least; });
  };
  // Walks can end too far away, so the tree says how far those that seem furthest are: they tell which of the others
  // matter.
  std::vector<Measured> front = measured;
  const auto end_of_front = front.begin() + static_cast<std::ptrdiff_t>(std::min(front.size(), kAskedOfEven));
  std::nth_element(front.begin(), end_of_front, front.end(),
                   [](const Measured& one, const Measured& other) { return one.distance > other.distance; });
  front.erase(end_of_front, front.end());
  const std::vector<Measured> seem_turned = those_of(measured, [](const Measured& each) { return each.is_turned; });
  Queries queries;
  for (const std::vector<Measured>& all : {std::cref(front), std::cref(seem_turned)})
    for (const Measured& each : all) queries.add(lattice, each, kMiddle);
  queries.find(search_);
  float least = 0;
  for (std::size_t k = 0; k < front.size(); ++k) least = std::max(least, kEvenWorthALook * queries.result(k).furthest);
  for (std::size_t k = 0; k < seem_turned.size(); ++k)
    if (looks_against(lattice, seem_turned[k].triangle, queries.result(front.size() + k).nearest))
      turned.push_back(seem_turned[k].triangle);
  // Places beside the middle, where these could be the furthest.
  measured = measure_near(lattice, numbers_of(above(least)), texel_triangles, {0, 0, least});
  // The furthest is at least that of any, and it is among those that seem further.
  float furthest = 0;
  for (const Measured& each : measured) furthest = std::max(furthest, each.distance);
  for (float limit = kEvenWorthALook * furthest; furthest > 0; limit = furthest) {
    furthest = 0;
    const std::vector<Measured> asked_again = above(limit);
    Queries exact;
    for (const Measured& each : asked_again) exact.add(lattice, each, kPlaces);
    exact.find(search_);
    for (std::size_t k = 0; k < asked_again.size(); ++k) furthest = std::max(furthest, exact.result(k).furthest);
    if (furthest >= limit) break;
  }
  return furthest;
}

ClBuffer<float> TriangleDistances::suspect_quads(ClContext& on, const LatticeMesh& lattice,
                                                 const ClBuffer<int>& texel_triangles) const {
  return suspect(on, "suspect_quads", layout_, lattice.device_rows(), lattice.device_points(),
                 lattice.device_diagonals(), texel_triangles, texel_normals_);
}

void TriangleDistances::measure_suspects(const LatticeMesh& lattice, const ClMapping<float>& suspicions2,
                                         const ClBuffer<int>& texel_triangles, float limit,
                                         std::promise<std::vector<int>> suspects) {
  std::vector<int> asked = triangles_of(quads_above(suspicions2, squared(kWorthAWalk * limit)));
  for (int i = lattice.first_end_triangle(); i < lattice.triangle_count(); ++i) asked.push_back(i);
  faults_.clear();
  measure_triangles(lattice, asked, texel_triangles, limit, std::move(suspects));
}

void TriangleDistances::measure_changed(const LatticeMesh& lattice, const std::vector<int>& asked,
                                        const ClBuffer<int>& texel_triangles, float limit,
                                        std::promise<std::vector<int>> suspects) {
  std::erase_if(faults_,
                [&](const Measured& each) { return std::binary_search(asked.begin(), asked.end(), each.triangle); });
  measure_triangles(lattice,
                    asked.size() > kWorthALookFirst
                        ? suspicious_of(lattice, asked, texel_triangles, squared(kWorthAWalk * limit))
                        : asked,
                    texel_triangles, limit, std::move(suspects));
}

/// Triangles of a list: at their middles, and more densely where these are further than a share of the limit.
void TriangleDistances::measure_triangles(const LatticeMesh& lattice, const std::vector<int>& asked,
                                          const ClBuffer<int>& texel_triangles, float limit,
                                          std::promise<std::vector<int>> suspects) {
  std::vector<Measured> measured =
      measure_near(lattice, asked, texel_triangles, {kWorthALook * limit, kWorthALook * limit, limit});
  suspects.set_value(numbers_of(
      those_of(measured, [&](const Measured& each) { return each.distance > kWorthAWalk * limit || each.is_turned; })));
  // What seems too far, and what seems to look against the original, by the tree.
  Queries queries;
  for (const Measured& each : measured) {
    if (each.distance > limit)
      queries.add(lattice, each, kPlaces);
    else if (each.is_turned)
      queries.add(lattice, each, kMiddle);
  }
  queries.find(search_);
  std::size_t next = 0;
  for (Measured& each : measured) {
    if (each.distance <= limit && !each.is_turned) continue;
    const Queries::Result result = queries.result(next++);
    if (each.distance > limit) each.distance = result.furthest;
    each.is_turned = each.is_turned && looks_against(lattice, each.triangle, result.nearest);
  }
  std::copy_if(measured.begin(), measured.end(), std::back_inserter(faults_),
               [&](const Measured& each) { return each.distance > limit || each.is_turned; });
}

/// Those at ends, and of quads that are more suspicious than that or look against the mesh.
std::vector<int> TriangleDistances::suspicious_of(const LatticeMesh& lattice, const std::vector<int>& asked,
                                                  const ClBuffer<int>& texel_triangles, float least2) {
  std::vector<int> quads;
  for (const int triangle : asked)
    if (triangle < lattice.first_end_triangle() && (quads.empty() || quads.back() != triangle / 2))
      quads.push_back(triangle / 2);
  if (quads.empty()) return asked;
  auto device_suspicions2 = context_.allocate<float>(quads.size());
  context_.launch({"guard.cl", "suspect_listed_quads"}, over(quads.size()), static_cast<int>(quads.size()),
                  layout_.width, lattice.texel_count(), context_.upload(quads), layout_.texel_patches, layout_.patches,
                  lattice.device_diagonals(), texel_triangles, texel_normals_, lattice.device_points().x,
                  lattice.device_points().y, lattice.device_points().z, device_suspicions2);
  const std::vector<float> suspicions2 = context_.download(device_suspicions2);
  std::vector<int> suspicious;
  std::size_t quad = 0;
  for (const int triangle : asked) {
    if (triangle < lattice.first_end_triangle()) {
      while (quads[quad] != triangle / 2) ++quad;
      if (suspicions2[quad] <= least2) continue;
    }
    suspicious.push_back(triangle);
  }
  return suspicious;
}

/// From nearby, or by the tree where there is no map.
/// \param asked  in order
std::vector<Measured> TriangleDistances::measure_near(const LatticeMesh& lattice, const std::vector<int>& asked,
                                                      const ClBuffer<int>& texel_triangles, Enough enough) {
  std::vector<Measured> measured;
  if (asked.empty()) return measured;
  std::vector<Triangle> corners;
  corners.reserve(asked.size()), measured.reserve(asked.size());
  for (std::size_t k = 0; k < asked.size(); ++k) {
    const int i = asked[k];
    if (i % 2 == 0 && i < lattice.first_end_triangle() && k + 1 < asked.size() && asked[k + 1] == i + 1) {
      const auto [lower, upper] = lattice.triangles_of(i / 2, lattice.right_of(i / 2));
      corners.push_back(lower), corners.push_back(upper);
      ++k;
    } else {
      corners.push_back(lattice.triangle(i));
    }
  }
  const TexelPoints &points = lattice.device_points(), &ends = lattice.device_end_points();
  auto device_distances = context_.allocate<float>(asked.size());
  auto device_turned = context_.allocate<int>(asked.size());
  context_.launch({"guard.cl", "measure_triangles"}, over(asked.size()), static_cast<int>(asked.size()),
                  lattice.texel_count(), enough.middle * enough.middle, enough.worth_a_look * enough.worth_a_look,
                  enough.places * enough.places, maps_.triangle_count, context_.upload(corners), texel_triangles,
                  maps_.corners, maps_.across, maps_.x, maps_.y, maps_.z, points.x, points.y, points.z, ends.x, ends.y,
                  ends.z, device_distances, device_turned);
  const auto [distances2, turned] = context_.download(device_distances, device_turned);
  std::vector<Measured> unmapped;
  for (std::size_t k = 0; k < asked.size(); ++k) {
    if (distances2[k] >= 0)
      measured.push_back({asked[k], std::sqrt(distances2[k]), turned[k] != 0});
    else if (asked[k] >= lattice.first_end_triangle())
      unmapped.push_back({asked[k], std::numeric_limits<float>::infinity(), false});
  }
  Queries queries;
  for (const Measured& each : unmapped) queries.add(lattice, each, kPlaces);
  queries.find(search_);
  for (std::size_t k = 0; k < unmapped.size(); ++k) {
    const Queries::Result result = queries.result(k);
    measured.push_back(
        {unmapped[k].triangle, result.furthest, looks_against(lattice, unmapped[k].triangle, result.nearest)});
  }
  return measured;
}

bool TriangleDistances::looks_against(const LatticeMesh& lattice, int triangle, int nearest) const {
  const auto [a, b, c] = lattice.corners(lattice.triangle(triangle));
  return (b - a).cross(c - a).dot(area_vector(mesh_, mesh_.triangles[nearest])) < 0;
}

}  // namespace skeletex
