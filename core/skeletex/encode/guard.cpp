// SPDX-License-Identifier: MIT
#include "skeletex/encode/guard.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <future>
#include <limits>

#include "skeletex/measure/lattice_crossings.h"
#include "skeletex/measure/nearest_search.h"
#include "skeletex/model/parallel.h"
#include "skeletex/reconstruct/lattice_mesh.h"

namespace skeletex {
namespace {

constexpr int kPasses = 7;                // it takes some four
constexpr int kReach = 1;                 // columns and rows around a triangle that is too far that go back with it
constexpr float kShareOfFurthest = 0.9f;  // what is measured is not all that there is
constexpr float kWorthALook = 0.15f;      // of the limit, at the middle of a triangle: then it is measured more densely
constexpr double kShareOfEven = 0.02;     // of the even lattice's quads, the most suspicious: among them is its furthest
constexpr float kWorthAWalk = 0.75f;      // of the limit: how far a quad could be
constexpr float kEvenWorthALook = 0.5f;   // of the furthest middle, in the even lattice
constexpr std::size_t kManyPairs = 50;    // from here on it is looked at whether the even lattice intersects itself as well
constexpr int kTolerance = 2;             // columns and rows around a fault of the even lattice
constexpr double kMuchWorse = 1.1;        // the number of faults there, against the even lattice's
constexpr std::size_t kBlock = 1 << 13;
// Places of a triangle, as shares of its first two sides: the middle; or corners, quarters and middles of the sides, and points
// between them and the middle. As in guard.cl.
constexpr std::array<std::array<double, 2>, 1> kMiddle{{{1 / 3.0, 1 / 3.0}}};
constexpr std::array<std::array<double, 2>, 15> kPlaces{{{0, 0},
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

LatticeMesh::Planes download(ClContext& context, const TexelPoints& points) {
  return {context.download(points.x), context.download(points.y), context.download(points.z)};
}

/// A vertex of the original inside a map.
struct PlacedVertex {
  int patch, point;  // its number among the vertices of DeviceMaps
  float x, y;        // in the cells of the patch
};
std::vector<PlacedVertex> place_vertices(std::span<const Chart> charts, std::span<const Patch> patches, const DeviceMaps& maps) {
  std::vector<PlacedVertex> placed;
  for (int bone = 0; bone < static_cast<int>(charts.size()); ++bone) {
    if (patches[bone].method != Method::kVsm) continue;
    const Chart& chart = charts[bone];
    for (int i = 0; i < static_cast<int>(chart.positions.size()); ++i)
      if (chart.kinds[i] == ChartVertex::kInner)
        placed.push_back({bone, maps.first_vertex[bone] + i, static_cast<float>(chart.v[i] * patches[bone].rectangle.width),
                          static_cast<float>(row_of(patches[bone].row_u, chart.u[i]))});
  }
  return placed;
}

/// How far a lattice and the original are from each other, measured again where the lattice has changed. What is found from nearby
/// (guard.cl) can be too far; what looks too far is looked at again by a tree.
class Distances {
 public:
  Distances(ClContext& context, const GuardSources& sources, const DeviceLayout& layout, const DeviceMaps& maps, TriangleTree tree)
      : context_(context),
        sources_(sources),
        layout_(layout),
        maps_(maps),
        search_(context, std::move(tree)),
        placed_(place_vertices(sources.charts, sources.model.patches, maps)),
        first_quads_(context.upload(number_lattice(sources.model).first_quad)) {}

  /// From the triangles of the even lattice that look most suspicious. \return the furthest of them
  float measure_even(const LatticeMesh& lattice, const ClBuffer<int>& texel_triangles) {
    const std::vector<float> suspicions2 = suspect(lattice, texel_triangles);
    std::vector<float> sorted = suspicions2;
    const auto last = sorted.begin() + static_cast<std::ptrdiff_t>(kShareOfEven * static_cast<double>(sorted.size()));
    std::nth_element(sorted.begin(), last, sorted.end(), std::greater<>());
    const std::vector<int> asked = triangles_above(lattice, suspicions2, *last);
    measure_near(lattice, asked, texel_triangles, std::numeric_limits<float>::max());
    // Places beside the middle, where these could be the furthest.
    float furthest = *std::max_element(triangles_.begin(), triangles_.end());
    std::vector<int> far;
    for (const int i : asked)
      if (triangles_[i] > kEvenWorthALook * furthest) far.push_back(i);
    measure_near(lattice, far, texel_triangles, 0);
    // The furthest is at least that of any, and it is among those that seem further.
    furthest = *std::max_element(triangles_.begin(), triangles_.end());
    for (float limit = kEvenWorthALook * furthest; furthest > 0;) {
      const float seeming = limit;
      std::vector<int> suspects;
      for (const int i : asked)
        if (triangles_[i] >= seeming) suspects.push_back(i);
      furthest = 0;
      for (const float distance : measure_exactly(lattice, suspects)) furthest = std::max(furthest, distance);
      if (furthest >= seeming) break;
      limit = furthest;
    }
    look_again_at_turned(lattice, asked);
    return furthest;
  }
  /// From all triangles of a lattice that look suspicious.
  void measure_suspects(const LatticeMesh& lattice, const ClBuffer<int>& texel_triangles, float limit) {
    std::fill(triangles_.begin(), triangles_.end(), 0.0f);
    std::fill(is_turned_.begin(), is_turned_.end(), 0);
    const float least = kWorthAWalk * limit;
    measure_triangles(lattice, triangles_above(lattice, suspect(lattice, texel_triangles), least * least), texel_triangles, limit);
  }
  /// From some of its triangles: at their middles, and more densely where these are further than a share of the limit.
  void measure_triangles(const LatticeMesh& lattice, const std::vector<int>& asked, const ClBuffer<int>& texel_triangles, float limit) {
    measure_near(lattice, asked, texel_triangles, kWorthALook * limit);
    std::vector<int> suspects;
    for (const int i : asked)
      if (triangles_[i] > limit) suspects.push_back(i);
    const std::vector<float> exact = measure_exactly(lattice, suspects);
    for (std::size_t k = 0; k < suspects.size(); ++k) triangles_[suspects[k]] = exact[k];
    look_again_at_turned(lattice, asked);
  }
  const std::vector<float>& of_triangles() const { return triangles_; }
  bool is_turned(std::size_t triangle) const { return is_turned_[triangle] != 0; }
  /// Triangles that look against the original.
  int turned() const { return static_cast<int>(std::count(is_turned_.begin(), is_turned_.end(), 1)); }

  /// From the original's vertices that no texel sits on to the lattice.
  /// \return those that are further than the limit: the triangles that they are nearest to
  std::vector<int> find_far_vertices(const LatticeMesh& lattice, const SnapFeatures& features, const std::vector<int>& anchors, float limit) {
    std::vector<char> is_held(maps_.x.size, 0);
    for (const int anchor : anchors)
      if (anchor > 0) is_held[features.vertices[anchor - 1].point] = 1;
    std::vector<int> points, patches, asked;  // asked: of placed_
    std::vector<float> places;
    for (std::size_t i = 0; i < placed_.size(); ++i) {
      const PlacedVertex& vertex = placed_[i];
      if (is_held[vertex.point]) continue;
      asked.push_back(static_cast<int>(i));
      points.push_back(vertex.point), patches.push_back(vertex.patch);
      places.push_back(vertex.x), places.push_back(vertex.y);
    }
    if (points.empty()) return {};
    auto device_distances = context_.allocate<float>(points.size());
    auto device_nearest = context_.allocate<int>(points.size());
    context_.launch({"guard.cl", "measure_vertices"}, over(points.size()), static_cast<int>(points.size()), limit * limit, context_.upload(points),
                    context_.upload(patches), context_.upload(places), layout_.patches, first_quads_, lattice.device_triangles(), maps_.x, maps_.y,
                    maps_.z, lattice.device_points().x, lattice.device_points().y, lattice.device_points().z, device_distances, device_nearest);
    const std::vector<float> distances2 = context_.download(device_distances);
    const std::vector<int> nearest = context_.download(device_nearest);
    std::vector<int> far;
    std::vector<std::size_t> at_ends;
    std::vector<Vec3> end_points;
    for (std::size_t i = 0; i < nearest.size(); ++i) {
      if (distances2[i] <= limit * limit) continue;
      const PlacedVertex& vertex = placed_[asked[i]];
      if (vertex.y < 2 || vertex.y > static_cast<float>(sources_.model.patches[vertex.patch].rectangle.height - 3)) {
        at_ends.push_back(i);
        end_points.push_back(sources_.charts[vertex.patch].positions[vertex.point - maps_.first_vertex[vertex.patch]]);
      } else {
        far.push_back(nearest[i]);
      }
    }
    if (at_ends.empty()) return far;
    // Strips at seams, and fans, can be nearer.
    const TriangleMesh& mesh = lattice.mesh();
    const int first = 2 * lattice.lattice().quad_count;
    TriangleMesh ends;
    for (std::size_t i = static_cast<std::size_t>(first); i < mesh.triangles.size(); ++i) {
      const int corner = static_cast<int>(ends.positions.size());
      for (const int vertex : mesh.triangles[i]) ends.positions.push_back(mesh.positions[vertex]);
      ends.triangles.push_back({corner, corner + 1, corner + 2});
    }
    NearestSearch search(context_, build_triangle_tree(ends));
    std::vector<int> triangles(end_points.size());
    std::vector<float> distances(end_points.size());
    search.find(end_points, triangles, distances);
    for (std::size_t k = 0; k < at_ends.size(); ++k) {
      const bool is_nearer = distances[k] * distances[k] < distances2[at_ends[k]];
      if (!is_nearer || distances[k] > limit) far.push_back(is_nearer ? first + triangles[k] : nearest[at_ends[k]]);
    }
    return far;
  }

 private:
  /// Per quad the square of how far it could be.
  std::vector<float> suspect(const LatticeMesh& lattice, const ClBuffer<int>& texel_triangles) {
    if (vertex_texels_.size == 0) vertex_texels_ = context_.upload(lattice.texels());
    if (normals_.size == 0) {
      normals_ = context_.allocate<float>(3 * static_cast<std::size_t>(maps_.triangle_count));
      context_.launch({"guard.cl", "find_normals"}, over(maps_.triangle_count), maps_.triangle_count, maps_.corners, maps_.x, maps_.y, maps_.z,
                      normals_);
    }
    const int quads = lattice.lattice().quad_count;
    const auto suspicions2 = context_.allocate<float>(quads);
    context_.launch({"guard.cl", "suspect_quads"}, over(quads), quads, maps_.triangle_count, lattice.device_triangles(), vertex_texels_,
                    texel_triangles, normals_, lattice.device_points().x, lattice.device_points().y, lattice.device_points().z, suspicions2);
    return context_.download(suspicions2);
  }
  /// Those of quads that are more suspicious than that or look against the mesh, and all at ends.
  static std::vector<int> triangles_above(const LatticeMesh& lattice, const std::vector<float>& suspicions2, float least) {
    std::vector<int> triangles;
    for (int quad = 0; quad < static_cast<int>(suspicions2.size()); ++quad)
      if (suspicions2[quad] > least || std::isinf(suspicions2[quad])) triangles.push_back(2 * quad), triangles.push_back(2 * quad + 1);
    for (int i = 2 * static_cast<int>(suspicions2.size()); i < static_cast<int>(lattice.mesh().triangles.size()); ++i) triangles.push_back(i);
    return triangles;
  }
  /// From nearby, triangles at ends by the tree.
  void measure_near(const LatticeMesh& lattice, const std::vector<int>& asked, const ClBuffer<int>& texel_triangles, float worth_a_look) {
    triangles_.resize(lattice.mesh().triangles.size());
    is_turned_.resize(lattice.mesh().triangles.size());
    const auto first_end = std::lower_bound(asked.begin(), asked.end(), 2 * lattice.lattice().quad_count);
    const std::vector<int> inner(asked.begin(), first_end), ends(first_end, asked.end());
    if (!inner.empty()) {
      auto device_distances = context_.allocate<float>(inner.size());
      auto device_turned = context_.allocate<int>(inner.size());
      context_.launch({"guard.cl", "measure_triangles"}, over(inner.size()), static_cast<int>(inner.size()), worth_a_look * worth_a_look,
                      maps_.triangle_count, context_.upload(inner), lattice.device_triangles(), vertex_texels_, texel_triangles, maps_.corners,
                      maps_.across, maps_.x, maps_.y, maps_.z, lattice.device_points().x, lattice.device_points().y, lattice.device_points().z,
                      device_distances, device_turned);
      const std::vector<float> distances2 = context_.download(device_distances);
      const std::vector<int> turned = context_.download(device_turned);
      for (std::size_t k = 0; k < inner.size(); ++k)
        triangles_[inner[k]] = std::sqrt(distances2[k]), is_turned_[inner[k]] = static_cast<char>(turned[k]);
    }
    std::vector<int> nearest, far;
    std::vector<float> distances;
    find(lattice.mesh(), ends, kMiddle, nearest, distances);
    for (std::size_t k = 0; k < ends.size(); ++k) {
      triangles_[ends[k]] = distances[k];
      is_turned_[ends[k]] = looks_against(lattice.mesh(), ends[k], nearest[k]);
      if (distances[k] > worth_a_look) far.push_back(ends[k]);
    }
    const std::vector<float> exact = measure_exactly(lattice, far);
    for (std::size_t k = 0; k < far.size(); ++k) triangles_[far[k]] = exact[k];
  }
  bool looks_against(const TriangleMesh& lattice, int triangle, int nearest) const {
    return area_vector(lattice, lattice.triangles[triangle]).dot(area_vector(sources_.mesh, sources_.mesh.triangles[nearest])) < 0;
  }
  void look_again_at_turned(const LatticeMesh& lattice, const std::vector<int>& asked) {
    std::vector<int> suspects, nearest;
    for (const int i : asked)
      if (is_turned_[i]) suspects.push_back(i);
    std::vector<float> distances;
    find(lattice.mesh(), suspects, kMiddle, nearest, distances);
    for (std::size_t k = 0; k < suspects.size(); ++k) is_turned_[suspects[k]] = looks_against(lattice.mesh(), suspects[k], nearest[k]);
  }
  std::vector<float> measure_exactly(const LatticeMesh& lattice, const std::vector<int>& asked) {
    std::vector<float> most, distances;
    std::vector<int> nearest;
    find(lattice.mesh(), asked, kMiddle, nearest, most);
    find(lattice.mesh(), asked, kPlaces, nearest, distances);
    for (std::size_t k = 0; k < distances.size(); ++k) most[k / kPlaces.size()] = std::max(most[k / kPlaces.size()], distances[k]);
    return most;
  }
  template <std::size_t kCount>
  void find(const TriangleMesh& lattice, const std::vector<int>& asked, const std::array<std::array<double, 2>, kCount>& places,
            std::vector<int>& nearest, std::vector<float>& distances) {
    std::vector<Vec3> points(asked.size() * kCount);
    for_each_block(asked.size(), kBlock, [&](std::size_t, std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) {
        const auto [a, b, c] = lattice.triangles[asked[i]];
        const Vec3 &p = lattice.positions[a], ab = lattice.positions[b] - p, ac = lattice.positions[c] - p;
        for (std::size_t k = 0; k < kCount; ++k) points[i * kCount + k] = p + places[k][0] * ab + places[k][1] * ac;
      }
    });
    nearest.resize(points.size()), distances.resize(points.size());
    search_.find(points, nearest, distances);
  }

  ClContext& context_;
  const GuardSources& sources_;
  const DeviceLayout& layout_;
  const DeviceMaps& maps_;
  NearestSearch search_;
  std::vector<PlacedVertex> placed_;
  ClBuffer<int> first_quads_, vertex_texels_;
  ClBuffer<float> normals_;  // of the maps' triangles
  std::vector<float> triangles_;
  std::vector<char> is_turned_;
};

/// A set of texels.
class TexelSet {
 public:
  TexelSet(const SkeletexModel& model, const LatticeMesh& lattice)
      : model_(model), first_inner_(lattice.lattice().first_inner), texels_(lattice.texels()) {
    clear();
  }
  void clear() { is_in_.assign(static_cast<std::size_t>(model_.texture.width) * model_.texture.height, 0); }
  /// The texels of a triangle and all that are up to `reach` columns or rows from them.
  void add(const Triangle& triangle, int reach) {
    for (const int vertex : triangle) {
      if (vertex >= static_cast<int>(texels_.size())) continue;
      const auto after = std::upper_bound(first_inner_.begin(), first_inner_.end(), vertex);
      const Rectangle& r = model_.patches[after - first_inner_.begin() - 1].rectangle;
      const int at = vertex - *(after - 1), row = 1 + at / r.width, column = at % r.width;
      for (int i = std::max(1, row - reach); i <= std::min(r.height - 2, row + reach); ++i)
        for (int j = -reach; j <= reach; ++j)
          is_in_[(r.y + i) * static_cast<std::size_t>(model_.texture.width) + r.x + ((column + j) % r.width + r.width) % r.width] = 1;
    }
  }
  /// Whether it has all texels of a triangle.
  bool has(const Triangle& triangle) const {
    return std::all_of(triangle.begin(), triangle.end(),
                       [&](int vertex) { return vertex >= static_cast<int>(texels_.size()) || is_in_[texels_[vertex]] != 0; });
  }
  const std::vector<int>& plane() const { return is_in_; }

 private:
  const SkeletexModel& model_;
  std::vector<int> first_inner_, texels_;  // texels_: per inner vertex
  std::vector<int> is_in_;
};

}  // namespace

GuardReport put_back_faults(ClContext& context, const GuardSources& sources, const DeviceLayout& layout, const DeviceMaps& maps,
                            const SnapFeatures& features, const ClBuffer<int>& even_triangles, const ClBuffer<int>& triangles,
                            const TexelPoints& even, const TexelPoints& filtered, ReadingPositions& positions, TexelPoints& points) {
  GuardReport report;
  const SkeletexModel& model = sources.model;
  auto tree = std::async(std::launch::async, [&] { return build_triangle_tree(sources.mesh); });
  const LatticeMesh::Planes home = download(context, filtered);
  const LatticeMesh even_lattice(context, model, DiagonalRule::kNearest, home);
  Distances distances(context, sources, layout, maps, tree.get());
  const float limit = kShareOfFurthest * distances.measure_even(even_lattice, even_triangles);
  report.even_turned_triangles = distances.turned();

  LatticeMesh lattice(context, model, model.diagonals, download(context, points));
  const TriangleMesh& mesh = lattice.mesh();
  LatticeCrossings crossings(model, lattice.lattice());
  std::vector<int> inner_vertices(layout.size(), -1);  // per texel
  for (std::size_t i = 0; i < lattice.texels().size(); ++i) inner_vertices[lattice.texels()[i]] = static_cast<int>(i);
  TexelSet marks(model, lattice);
  // Where the even lattice is at fault itself there is nothing to go back to, as long as it is not much worse.
  TexelSet even_faults = marks;
  for (std::size_t i = 0; i < even_lattice.mesh().triangles.size(); ++i)
    if (distances.is_turned(i)) even_faults.add(even_lattice.mesh().triangles[i], kTolerance);
  const auto is_near_even_fault = [&](int triangle) { return even_faults.has(mesh.triangles[triangle]); };
  const auto is_pair_near_even_fault = [&](const std::array<int, 2>& pair) { return is_near_even_fault(pair[0]) && is_near_even_fault(pair[1]); };
  bool tolerates_crossing = false, tolerates_turning = false;
  std::vector<int> changed;  // triangles, since the pass before
  for (int pass = 0; pass < kPasses; ++pass) {
    marks.clear();
    const auto pairs = pass == 0 ? crossings.find(mesh) : crossings.find(mesh, changed);
    if (pass == 0 && pairs.size() > kManyPairs) {
      const auto even_pairs = crossings.find_around(pairs, mesh, even_lattice.mesh());
      for (const auto& pair : even_pairs)
        for (const int triangle : pair) even_faults.add(even_lattice.mesh().triangles[triangle], kTolerance);
      const auto near = std::count_if(pairs.begin(), pairs.end(), is_pair_near_even_fault);
      tolerates_crossing = static_cast<double>(near) <= kMuchWorse * static_cast<double>(even_pairs.size());
    }
    for (const auto& pair : pairs)
      if (!tolerates_crossing || !is_pair_near_even_fault(pair))
        for (const int triangle : pair) marks.add(mesh.triangles[triangle], 0);

    if (pass == 0)
      distances.measure_suspects(lattice, triangles, limit);
    else
      distances.measure_triangles(lattice, changed, triangles, limit);
    report.turned_triangles = distances.turned();
    const int count = static_cast<int>(mesh.triangles.size());
    if (pass == 0) {
      int near = 0;
      for (int i = 0; i < count; ++i) near += distances.is_turned(i) && is_near_even_fault(i);
      tolerates_turning = near <= kMuchWorse * report.even_turned_triangles;
    }
    for (int i = 0; i < count; ++i) {
      if (distances.of_triangles()[i] > limit)
        marks.add(mesh.triangles[i], kReach);
      else if (distances.is_turned(i) && !(tolerates_turning && is_near_even_fault(i)))
        marks.add(mesh.triangles[i], 0);
    }
    for (const int triangle : distances.find_far_vertices(lattice, features, context.download(positions.anchors), limit))
      marks.add(mesh.triangles[triangle], kReach);

    // Vertices are given up only when the texels between them have been.
    const bool with_vertices = pass > 0;
    std::vector<int> back = put_back_marked(context, layout, even, filtered, context.upload(marks.plane()), with_vertices, positions, points);
    report.texels_put_back += static_cast<int>(back.size());
    if (back.empty() && with_vertices) break;
    for (int& texel : back) texel = inner_vertices[texel];
    changed = lattice.move(back, home);
  }
  return report;
}

}  // namespace skeletex
