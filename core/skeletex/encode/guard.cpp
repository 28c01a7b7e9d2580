// SPDX-License-Identifier: MIT
#include "skeletex/encode/guard.h"

#include <algorithm>

#include "skeletex/measure/nearest_search.h"
#include "skeletex/measure/parallel.h"
#include "skeletex/measure/self_intersection.h"
#include "skeletex/reconstruct/reconstruct_mesh.h"

namespace skeletex {
namespace {

constexpr int kPasses = 7;                // it takes some four
constexpr int kReach = 1;                 // columns and rows around a triangle that is too far that go back with it
constexpr float kShareOfFurthest = 0.9f;  // what is measured is not all that there is
constexpr float kWorthALook = 0.15f;    // of the limit, at the middle of a triangle: then it is measured more densely
constexpr std::size_t kManyPairs = 50;    // from here on it is looked at whether the even lattice intersects itself as well
constexpr int kTolerance = 2;             // columns and rows around a fault of the even lattice
constexpr double kMuchWorse = 1.1;        // the number of faults there, against the even lattice's
constexpr std::size_t kBlock = 1 << 13;
// Places of a triangle, as shares of its first two sides: the middle; or corners, quarters and middles of the sides, and points
// between them and the middle.
constexpr std::array<std::array<double, 2>, 1> kMiddle{{{1 / 3.0, 1 / 3.0}}};
constexpr std::array<std::array<double, 2>, 15> kPlaces{{{0, 0}, {1, 0}, {0, 1}, {0.25, 0}, {0.5, 0}, {0.75, 0}, {0, 0.25}, {0, 0.5}, {0, 0.75}, {0.75, 0.25},
                                                         {0.5, 0.5}, {0.25, 0.75}, {0.6, 0.2}, {0.2, 0.6}, {0.2, 0.2}}};

using Planes = std::array<std::vector<float>, 3>;

Planes download(ClContext& context, const TexelPoints& points) { return {context.download(points.x), context.download(points.y), context.download(points.z)}; }

/// Per vertex of a lattice its texel; -1 of poles and seams.
std::vector<int> texels_of_vertices(const SkeletexModel& model, const Lattice& lattice) {
  std::vector<int> texels(lattice.vertex_count, -1);
  for (std::size_t bone = 0; bone < model.patches.size(); ++bone) {
    const Rectangle& r = model.patches[bone].rectangle;
    for (int row = 1; row + 1 < r.height; ++row)
      for (int j = 0; j < r.width; ++j) texels[lattice.first_inner[bone] + (row - 1) * r.width + j] = (r.y + row) * model.texture.width + r.x + j;
  }
  return texels;
}

/// How far a lattice and the original are from each other, measured again where the lattice has changed.
class Distances {
 public:
  Distances(ClContext& context, const TriangleMesh& original) : original_(original), search_(context, build_triangle_tree(original)) {}

  /// From the lattice's triangles to the original: at their middles, and more densely where these are further than a share of
  /// `furthest`, or of the furthest of them.
  void measure_triangles(const TriangleMesh& lattice, const std::vector<char>& is_changed, float furthest) {
    triangles_.resize(lattice.triangles.size());
    is_turned_.resize(lattice.triangles.size());
    std::vector<int> asked;
    for (std::size_t i = 0; i < is_changed.size(); ++i)
      if (is_changed[i]) asked.push_back(static_cast<int>(i));
    std::vector<float> distances;
    std::vector<int> nearest;
    find(lattice, asked, kMiddle, nearest, distances);
    std::vector<int> far;
    for (const float distance : distances) furthest = std::max(furthest, distance);
    for (std::size_t k = 0; k < asked.size(); ++k) {
      const int i = asked[k];
      triangles_[i] = distances[k];
      is_turned_[i] = area_vector(lattice, lattice.triangles[i]).dot(area_vector(original_, original_.triangles[nearest[k]])) < 0;
      if (distances[k] > kWorthALook * furthest) far.push_back(i);
    }
    find(lattice, far, kPlaces, nearest, distances);
    for (std::size_t k = 0; k < distances.size(); ++k) {
      float& distance = triangles_[far[k / kPlaces.size()]];
      distance = std::max(distance, distances[k]);
    }
  }
  const std::vector<float>& of_triangles() const { return triangles_; }
  bool is_turned(std::size_t triangle) const { return is_turned_[triangle] != 0; }
  /// Triangles that look against the original.
  int turned() const { return static_cast<int>(std::count(is_turned_.begin(), is_turned_.end(), 1)); }

  /// From the original's vertices to the lattice.
  void measure_vertices(NearestSearch search, const std::vector<char>& is_changed) {
    std::vector<int> asked;
    for (int i = 0; i < static_cast<int>(original_.positions.size()); ++i)
      if (nearest_.empty() || is_changed[nearest_[i]]) asked.push_back(i);
    nearest_.resize(original_.positions.size());
    vertices_.resize(original_.positions.size());
    std::vector<Vec3> points;
    for (const int i : asked) points.push_back(original_.positions[i]);
    std::vector<int> nearest(points.size());
    std::vector<float> distances(points.size());
    search.find(points, nearest, distances);
    for (std::size_t k = 0; k < asked.size(); ++k) nearest_[asked[k]] = nearest[k], vertices_[asked[k]] = distances[k];
  }
  const std::vector<float>& of_vertices() const { return vertices_; }
  /// The triangles that they are nearest to.
  const std::vector<int>& nearest() const { return nearest_; }

 private:
  template <std::size_t kCount>
  void find(const TriangleMesh& lattice, const std::vector<int>& asked, const std::array<std::array<double, 2>, kCount>& places, std::vector<int>& nearest,
            std::vector<float>& distances) {
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

  const TriangleMesh& original_;
  NearestSearch search_;
  std::vector<float> triangles_, vertices_;
  std::vector<char> is_turned_;
  std::vector<int> nearest_;
};

/// Per triangle of a lattice whether it differs from that of the lattice before.
std::vector<char> changed_triangles(const TriangleMesh& before, const TriangleMesh& now) {
  std::vector<char> is_changed(now.triangles.size(), 1);
  if (before.triangles.size() != now.triangles.size()) return is_changed;
  for (std::size_t i = 0; i < is_changed.size(); ++i) {
    const Triangle& t = now.triangles[i];
    is_changed[i] = t != before.triangles[i] || now.positions[t[0]] != before.positions[t[0]] || now.positions[t[1]] != before.positions[t[1]] ||
                    now.positions[t[2]] != before.positions[t[2]];
  }
  return is_changed;
}

/// A set of texels.
class TexelSet {
 public:
  explicit TexelSet(const SkeletexModel& model) : model_(model), lattice_(number_lattice(model)), texels_(texels_of_vertices(model, lattice_)) { clear(); }
  void clear() { is_in_.assign(static_cast<std::size_t>(model_.texture.width) * model_.texture.height, 0); }
  /// The texels of a triangle and all that are up to `reach` columns or rows from them.
  void add(const Triangle& triangle, int reach) {
    for (const int vertex : triangle) {
      if (texels_[vertex] < 0) continue;
      const auto after = std::upper_bound(lattice_.first_inner.begin(), lattice_.first_inner.end(), vertex);
      const Rectangle& r = model_.patches[after - lattice_.first_inner.begin() - 1].rectangle;
      const int at = vertex - *(after - 1), row = 1 + at / r.width, column = at % r.width;
      for (int i = std::max(1, row - reach); i <= std::min(r.height - 2, row + reach); ++i)
        for (int j = -reach; j <= reach; ++j)
          is_in_[(r.y + i) * static_cast<std::size_t>(model_.texture.width) + r.x + ((column + j) % r.width + r.width) % r.width] = 1;
    }
  }
  /// Whether it has all texels of a triangle.
  bool has(const Triangle& triangle) const {
    return std::all_of(triangle.begin(), triangle.end(), [&](int vertex) { return texels_[vertex] < 0 || is_in_[texels_[vertex]] != 0; });
  }
  const std::vector<int>& plane() const { return is_in_; }

 private:
  const SkeletexModel& model_;
  Lattice lattice_;
  std::vector<int> texels_;  // per vertex of the lattice
  std::vector<int> is_in_;
};

}  // namespace

GuardReport put_back_faults(ClContext& context, const GuardSources& sources, const DeviceLayout& layout, const TexelPoints& even, const TexelPoints& filtered,
                            ReadingPositions& positions, TexelPoints& points) {
  GuardReport report;
  Distances distances(context, sources.mesh);
  const TriangleMesh even_mesh = mesh_of_points(context, sources.model, DiagonalRule::kNearest, download(context, filtered));
  distances.measure_triangles(even_mesh, std::vector<char>(even_mesh.triangles.size(), 1), 0);
  report.even_turned_triangles = distances.turned();
  const float limit = kShareOfFurthest * *std::max_element(distances.of_triangles().begin(), distances.of_triangles().end());

  TriangleMesh mesh;
  std::vector<int> order;
  TexelSet marks(sources.model);
  // Where the even lattice is at fault itself there is nothing to go back to, as long as it is not much worse.
  TexelSet even_faults = marks;
  for (std::size_t i = 0; i < even_mesh.triangles.size(); ++i)
    if (distances.is_turned(i)) even_faults.add(even_mesh.triangles[i], kTolerance);
  const auto is_near_even_fault = [&](int triangle) { return even_faults.has(mesh.triangles[triangle]); };
  const auto is_pair_near_even_fault = [&](const std::array<int, 2>& pair) { return is_near_even_fault(pair[0]) && is_near_even_fault(pair[1]); };
  bool tolerates_crossing = false, tolerates_turning = false;
  for (int pass = 0; pass < kPasses; ++pass) {
    TriangleMesh now = mesh_of_points(context, sources.model, sources.model.diagonals, download(context, points));
    const std::vector<char> is_changed = changed_triangles(mesh, now);
    mesh = std::move(now);
    TriangleTree tree = order.empty() ? build_triangle_tree(mesh) : build_triangle_tree(mesh, order);
    order = tree.order;
    marks.clear();

    const auto pairs = find_self_intersections(mesh, tree, pass == 0 ? std::span<const char>() : is_changed);
    if (pass == 0 && pairs.size() > kManyPairs) {
      const auto even_pairs = find_self_intersections(even_mesh);
      for (const auto& pair : even_pairs)
        for (const int triangle : pair) even_faults.add(even_mesh.triangles[triangle], kTolerance);
      const auto near = std::count_if(pairs.begin(), pairs.end(), is_pair_near_even_fault);
      tolerates_crossing = static_cast<double>(near) <= kMuchWorse * static_cast<double>(even_pairs.size());
    }
    for (const auto& pair : pairs)
      if (!tolerates_crossing || !is_pair_near_even_fault(pair))
        for (const int triangle : pair) marks.add(mesh.triangles[triangle], 0);

    distances.measure_triangles(mesh, is_changed, limit);
    report.turned_triangles = distances.turned();
    const int triangles = static_cast<int>(mesh.triangles.size());
    if (pass == 0) {
      int near = 0;
      for (int i = 0; i < triangles; ++i) near += distances.is_turned(i) && is_near_even_fault(i);
      tolerates_turning = near <= kMuchWorse * report.even_turned_triangles;
    }
    for (int i = 0; i < triangles; ++i) {
      if (distances.of_triangles()[i] > limit) marks.add(mesh.triangles[i], kReach);
      else if (distances.is_turned(i) && !(tolerates_turning && is_near_even_fault(i))) marks.add(mesh.triangles[i], 0);
    }
    distances.measure_vertices({context, std::move(tree)}, is_changed);
    for (std::size_t i = 0; i < distances.nearest().size(); ++i)
      if (distances.of_vertices()[i] > limit) marks.add(mesh.triangles[distances.nearest()[i]], kReach);

    // Vertices are given up only when the texels between them have been.
    const bool with_vertices = pass > 0;
    const int back = put_back_marked(context, layout, even, filtered, context.upload(marks.plane()), with_vertices, positions, points);
    report.texels_put_back += back;
    if (back == 0 && with_vertices) break;
  }
  return report;
}

}  // namespace skeletex
