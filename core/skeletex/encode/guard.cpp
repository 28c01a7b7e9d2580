// SPDX-License-Identifier: MIT
#include "skeletex/encode/guard.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <functional>
#include <future>
#include <iterator>
#include <limits>
#include <numeric>
#include <optional>
#include <utility>

#include "skeletex/measure/lattice_crossings.h"
#include "skeletex/measure/nearest_search.h"
#include "skeletex/measure/point_triangle.h"
#include "skeletex/model/parallel.h"
#include "skeletex/reconstruct/lattice_mesh.h"

namespace skeletex {
namespace {

constexpr int kPasses = 7;                // it takes some four
constexpr int kReach = 1;                 // columns and rows around a triangle that is too far that go back with it
constexpr float kShareOfFurthest = 0.9f;  // what is measured is not all that there is
constexpr float kWorthALook = 0.15f;      // of the limit, at the middle of a triangle: then it is measured more densely
constexpr double kShareOfEven = 0.005;    // of the even lattice's quads, the most suspicious: among them is its furthest
constexpr std::size_t kLeastOfEven = 1000;  // or so many quads of a small one
constexpr std::size_t kAskedOfEven = 32;  // of their triangles, those that seem furthest
constexpr float kWorthAWalk = 0.75f;      // of the limit: how far a quad could be
constexpr float kEvenWorthALook = 0.5f;   // of the furthest middle, in the even lattice
constexpr int kVertexReach = 6;           // columns and rows around a texel: diagonals depend on it, vertices are measured to their quads (guard.cl)
constexpr std::size_t kManyPairs = 500;   // from here on it is looked at whether the even lattice intersects itself as much
constexpr int kShareOfParts = 4;          // one in so many pairs of parts that intersect tells whether the even lattice does as much
constexpr int kTolerance = 2;             // columns and rows around a fault of the even lattice
constexpr double kMuchWorse = 1.1;        // the number of faults there, against the even lattice's
constexpr std::size_t kWorthALookFirst = 2000;  // triangles that have changed: of fewer all are measured
constexpr std::size_t kWorthAThread = 1000;  // triangles that have changed: crossings of fewer are found in less time than a thread takes
constexpr int kEndsInBox = 32;            // triangles of strips and fans that a vertex is compared to at once
// Places of a triangle, as shares of its first two sides: the middle, corners, quarters and middles of the sides, and points
// between them and the middle. As in guard.cl.
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

/// A vertex of the original inside a map.
struct PlacedVertex {
  int patch, point;  // its number among the vertices of DeviceMaps
  float x, y;        // in the cells of the patch
  int texel;         // whose quad it is measured around
};
/// By lines of the texture.
struct PlacedVertices {
  std::vector<PlacedVertex> all;
  std::vector<int> first_of_line;  // and the end
};
PlacedVertices place_vertices(std::span<const Chart> charts, std::span<const Patch> patches, const DeviceMaps& maps, const DeviceLayout& layout) {
  std::vector<PlacedVertex> placed;
  PlacedVertices by_line;
  by_line.first_of_line.assign(layout.height + 1, 0);
  for (int bone = 0; bone < static_cast<int>(charts.size()); ++bone) {
    if (patches[bone].method != Method::kVsm) continue;
    const Chart& chart = charts[bone];
    const Rectangle& r = patches[bone].rectangle;
    for (int i = 0; i < static_cast<int>(chart.positions.size()); ++i) {
      if (chart.kinds[i] != ChartVertex::kInner) continue;
      const auto x = static_cast<float>(chart.v[i] * r.width), y = static_cast<float>(row_of(patches[bone].row_u, chart.u[i]));
      const int column = static_cast<int>(std::floor(x)), line = r.y + std::clamp(static_cast<int>(std::floor(y)), 1, r.height - 3);
      placed.push_back({bone, maps.first_vertex[bone] + i, x, y, line * layout.width + r.x + (column % r.width + r.width) % r.width});
      ++by_line.first_of_line[line + 1];
    }
  }
  std::partial_sum(by_line.first_of_line.begin(), by_line.first_of_line.end(), by_line.first_of_line.begin());
  by_line.all.resize(placed.size());
  std::vector<int> next = by_line.first_of_line;
  for (const PlacedVertex& vertex : placed) by_line.all[next[vertex.texel / layout.width]++] = vertex;
  return by_line;
}

/// Normals of the mesh near texels, three planes.
ClBuffer<float> find_texel_normals(ClContext& context, const DeviceLayout& layout, const DeviceMaps& maps, const ClBuffer<int>& texel_triangles) {
  auto normals = context.allocate<float>(3 * static_cast<std::size_t>(maps.triangle_count)), texel_normals = context.allocate<float>(3 * layout.size());
  const int texels = static_cast<int>(layout.size());
  context.launch({"guard.cl", "find_normals"}, over(maps.triangle_count), maps.triangle_count, maps.corners, maps.x, maps.y, maps.z, normals);
  context.launch({"guard.cl", "normals_of_texels"}, over(texels), texels, maps.triangle_count, texel_triangles, normals, texel_normals);
  return texel_normals;
}

/// Per texel the square of how far its quad could be.
/// \param rows       quad_rows
/// \param arguments  of the kernel, between layout and points
template <class... Arguments>
ClBuffer<float> suspect(ClContext& context, const char* kernel, const DeviceLayout& layout, const ClBuffer<LatticeRow>& rows, const TexelPoints& points,
                        const Arguments&... arguments) {
  auto suspicions2 = context.allocate<float>(layout.size());
  context.fill(suspicions2, 0.f);
  context.launch({"guard.cl", kernel}, row_range(context, rows.size), static_cast<int>(rows.size), layout.width, static_cast<int>(layout.size()), rows, layout.patches,
                 arguments..., points.x, points.y, points.z, suspicions2);
  return suspicions2;
}

/// How far a lattice and the original are from each other, measured again where the lattice has changed. What is found from nearby
/// (guard.cl) can be too far; what looks too far is looked at again by a tree.
class Distances {
 public:
  Distances(ClContext& context, const GuardSources& sources, const DeviceLayout& layout, const DeviceMaps& maps, ClBuffer<float> texel_normals, NearestSearch search,
            PlacedVertices placed)
      : context_(context),
        sources_(sources),
        layout_(layout),
        maps_(maps),
        texel_normals_(std::move(texel_normals)),
        search_(std::move(search)),
        placed_(std::move(placed)) {}

  /// A triangle of the lattice as it was measured last.
  struct Measured {
    int triangle;
    float distance;  ///< of the furthest of its places that were looked at, or more
    bool is_turned;  ///< looks against the original
  };

  /// Of the even lattice, the triangles that look most suspicious, of which it chooses the diagonals. Those at ends are not looked at.
  /// \return the furthest of them
  float measure_even(LatticeMesh& lattice, const ClMapping<float>& suspicions2, const ClBuffer<int>& texel_triangles, std::vector<int>& turned) {
    std::vector<float> some;  // enough to tell how large the largest are, but for those that look against the mesh
    constexpr std::size_t kStep = 7;
    for (std::size_t i = 0; i < suspicions2.size(); i += kStep)
      if (!std::isinf(suspicions2[i])) some.push_back(suspicions2[i]);
    if (some.empty()) some.push_back(0);
    const auto asked_of = std::min(some.size() - 1, std::max(static_cast<std::size_t>(kShareOfEven * static_cast<double>(some.size())), kLeastOfEven / kStep));
    const auto last = some.begin() + static_cast<std::ptrdiff_t>(asked_of);
    std::nth_element(some.begin(), last, some.end(), std::greater<>());
    const std::vector<int> suspects = quads_above(suspicions2, *last);
    lattice.choose(suspects);
    const std::vector<int> asked = suspicious_of(lattice, triangles_of(suspects), texel_triangles, *last);
    constexpr float kNever = std::numeric_limits<float>::max();
    std::vector<Measured> measured = measure_near(lattice, asked, texel_triangles, {0, kNever, 0});
    const auto above = [&](float least) { return those_of(measured, [&](const Measured& each) { return each.distance >= least; }); };
    // Walks can end too far away, so the tree says how far those that seem furthest are: they tell which of the others matter.
    std::vector<Measured> front = measured;
    const auto end_of_front = front.begin() + static_cast<std::ptrdiff_t>(std::min(front.size(), kAskedOfEven));
    std::nth_element(front.begin(), end_of_front, front.end(), [](const Measured& one, const Measured& other) { return one.distance > other.distance; });
    front.erase(end_of_front, front.end());
    const std::vector<Measured> seem_turned = those_of(measured, [](const Measured& each) { return each.is_turned; });
    Queries queries;
    for (const std::vector<Measured>& all : {std::cref(front), std::cref(seem_turned)})
      for (const Measured& each : all) queries.add(lattice, each, kMiddle);
    queries.find(search_);
    float least = 0;
    for (std::size_t k = 0; k < front.size(); ++k) least = std::max(least, kEvenWorthALook * queries.result(k).furthest);
    for (std::size_t k = 0; k < seem_turned.size(); ++k)
      if (looks_against(lattice, seem_turned[k].triangle, queries.result(front.size() + k).nearest)) turned.push_back(seem_turned[k].triangle);
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
  /// Of another lattice than the even one, on a queue of its own.
  ClBuffer<float> suspect_quads(ClContext& on, const LatticeMesh& lattice, const ClBuffer<int>& texel_triangles) const {
    return suspect(on, "suspect_quads", layout_, lattice.device_rows(), lattice.device_points(), lattice.device_diagonals(), texel_triangles, texel_normals_);
  }
  /// All triangles of that lattice that look suspicious, and all at ends.
  /// \param suspects  told as soon as they are known: those of them that seem nearly as far as the limit, or look against the original
  void measure_suspects(const LatticeMesh& lattice, const ClMapping<float>& suspicions2, const ClBuffer<int>& texel_triangles, float limit,
                        std::promise<std::vector<int>> suspects) {
    std::vector<int> asked = triangles_of(quads_above(suspicions2, squared(kWorthAWalk * limit)));
    for (int i = lattice.first_end_triangle(); i < lattice.triangle_count(); ++i) asked.push_back(i);
    faults_.clear();
    measure_triangles(lattice, asked, texel_triangles, limit, std::move(suspects));
  }
  /// Some of them again.
  /// \param asked  in order
  void measure_changed(const LatticeMesh& lattice, const std::vector<int>& asked, const ClBuffer<int>& texel_triangles, float limit,
                       std::promise<std::vector<int>> suspects) {
    std::erase_if(faults_, [&](const Measured& each) { return std::binary_search(asked.begin(), asked.end(), each.triangle); });
    measure_triangles(lattice, asked.size() > kWorthALookFirst ? suspicious_of(lattice, asked, texel_triangles, squared(kWorthAWalk * limit)) : asked, texel_triangles, limit,
                      std::move(suspects));
  }
  /// Triangles that are further than the limit, or look against the original.
  const std::vector<Measured>& faults() const { return faults_; }

  /// Lists the original's vertices that no texel sits on, for `start_vertices`.
  /// \param anchors  per texel
  void list_vertices(std::span<const int> vertex_points, std::vector<int> anchors) {
    anchors_ = std::move(anchors);
    is_held_.assign(maps_.x.size, 0);
    for (const int anchor : anchors_)
      if (anchor > 0) is_held_[vertex_points[anchor - 1]] = 1;
    vertices_.resize(placed_.all.size());
    are_near_.assign(layout_.size(), 0), are_lines_near_.assign(layout_.height, 0);
    asked_.clear();
    for (std::size_t i = 0; i < placed_.all.size(); ++i)
      if (is_held_[placed_.all[i].point] == 0) asked_.push_back(static_cast<int>(i));
  }
  /// After a move: those near texels that have gone back.
  void list_vertices(std::span<const int> vertex_points, const LatticeMesh& lattice, const std::vector<int>& back) {
    for (const int texel : back) {
      if (anchors_[texel] > 0) is_held_[vertex_points[anchors_[texel] - 1]] = 0;
      anchors_[texel] = 0;
      add_around(lattice, texel);
    }
    asked_.clear();
    for (int line = 0; line < layout_.height; ++line) {
      if (std::exchange(are_lines_near_[line], 0) == 0) continue;
      for (int i = placed_.first_of_line[line]; i < placed_.first_of_line[line + 1]; ++i) {
        if (are_near_[placed_.all[i].texel] == 0) continue;
        vertices_[i].is_far = false;
        if (is_held_[placed_.all[i].point] == 0) asked_.push_back(i);
      }
      std::fill_n(are_near_.begin() + static_cast<std::ptrdiff_t>(line) * layout_.width, layout_.width, 0);
    }
    std::erase_if(far_, [&](int i) { return !vertices_[i].is_far; });
  }
  /// Measures those that are listed to the lattice, on a queue of its own, beside what asks for triangles.
  void start_vertices(ClContext& on, const LatticeMesh& lattice, float limit) {
    if (asked_.empty()) return;
    std::vector<int> points, patches;
    std::vector<float> places;
    for (const int i : asked_) {
      const PlacedVertex& vertex = placed_.all[i];
      points.push_back(vertex.point), patches.push_back(vertex.patch);
      places.push_back(vertex.x), places.push_back(vertex.y);
    }
    device_distances_ = on.allocate<float>(points.size()), device_nearest_ = on.allocate<int>(points.size());
    on.launch({"guard.cl", "measure_vertices"}, over(points.size()), static_cast<int>(points.size()), layout_.width, limit * limit, on.upload(points),
              on.upload(patches), on.upload(places), layout_.patches, lattice.device_diagonals(), maps_.x, maps_.y, maps_.z, lattice.device_points().x,
              lattice.device_points().y, lattice.device_points().z, device_distances_, device_nearest_);
  }
  /// \param changed  triangles since the call before
  /// \return of vertices that are further than the limit, the triangles that they are nearest to
  std::vector<int> take_far_vertices(ClContext& on, const LatticeMesh& lattice, const std::vector<int>& changed, float limit) {
    if (!asked_.empty()) {
      const auto [distances2, nearest] = on.download(device_distances_, device_nearest_);
      for (std::size_t k = 0; k < asked_.size(); ++k) {
        vertices_[asked_[k]] = {distances2[k], nearest[k], distances2[k] > limit * limit};
        if (vertices_[asked_[k]].is_far) far_.push_back(asked_[k]);
      }
    }
    return triangles_at_far(lattice, changed, limit);
  }
  /// What holds texels, but for those that have gone back since the last call.
  std::vector<int> take_anchors() { return std::move(anchors_); }

 private:
  /// Triangles of a list: at their middles, and more densely where these are further than a share of the limit.
  void measure_triangles(const LatticeMesh& lattice, const std::vector<int>& asked, const ClBuffer<int>& texel_triangles, float limit,
                         std::promise<std::vector<int>> suspects) {
    std::vector<Measured> measured = measure_near(lattice, asked, texel_triangles, {kWorthALook * limit, kWorthALook * limit, limit});
    suspects.set_value(numbers_of(those_of(measured, [&](const Measured& each) { return each.distance > kWorthAWalk * limit || each.is_turned; })));
    // What seems too far, and what seems to look against the original, by the tree.
    Queries queries;
    for (const Measured& each : measured) {
      if (each.distance > limit) queries.add(lattice, each, kPlaces);
      else if (each.is_turned) queries.add(lattice, each, kMiddle);
    }
    queries.find(search_);
    std::size_t next = 0;
    for (Measured& each : measured) {
      if (each.distance <= limit && !each.is_turned) continue;
      const Queries::Result result = queries.result(next++);
      if (each.distance > limit) each.distance = result.furthest;
      each.is_turned = each.is_turned && looks_against(lattice, each.triangle, result.nearest);
    }
    std::copy_if(measured.begin(), measured.end(), std::back_inserter(faults_), [&](const Measured& each) { return each.distance > limit || each.is_turned; });
  }
  static float squared(float x) { return x * x; }
  /// Those at ends, and of quads that are more suspicious than that or look against the mesh.
  std::vector<int> suspicious_of(const LatticeMesh& lattice, const std::vector<int>& asked, const ClBuffer<int>& texel_triangles, float least2) {
    std::vector<int> quads;
    for (const int triangle : asked)
      if (triangle < lattice.first_end_triangle() && (quads.empty() || quads.back() != triangle / 2)) quads.push_back(triangle / 2);
    if (quads.empty()) return asked;
    auto device_suspicions2 = context_.allocate<float>(quads.size());
    context_.launch({"guard.cl", "suspect_listed_quads"}, over(quads.size()), static_cast<int>(quads.size()), layout_.width, lattice.texel_count(),
                    context_.upload(quads), layout_.texel_patches, layout_.patches, lattice.device_diagonals(), texel_triangles, texel_normals_,
                    lattice.device_points().x, lattice.device_points().y, lattice.device_points().z, device_suspicions2);
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
  /// A vertex of the original as it was measured last, to the quads around it.
  struct MeasuredVertex {
    float distance2 = 0;
    int nearest = -1;
    bool is_far = false;
    bool is_compared = false;  ///< to strips and fans as well
    int nearer = -1;           ///< then the triangle that it is nearest to, -1 if it is not far
  };
  std::vector<int> triangles_at_far(const LatticeMesh& lattice, const std::vector<int>& changed, float limit) {
    std::vector<int> far;
    std::vector<int> at_ends;
    for (const int i : far_) {
      const PlacedVertex& vertex = placed_.all[i];
      if (vertex.y < 2 || vertex.y > static_cast<float>(sources_.model.patches[vertex.patch].rectangle.height - 3)) {
        at_ends.push_back(i);
      } else {
        far.push_back(vertices_[i].nearest);
      }
    }
    // Where these are not what they were, all are compared to them again.
    const bool have_ends_moved = std::any_of(changed.begin(), changed.end(), [&](int triangle) { return triangle >= lattice.first_end_triangle(); });
    // Strips and fans can be nearer: nearly always their own, those across the seam else.
    std::erase_if(at_ends, [&](int i) { return vertices_[i].is_compared && !have_ends_moved; });
    compare_to_ends(lattice, at_ends, limit);
    for (const int i : far_)
      if (vertices_[i].is_compared && vertices_[i].nearer >= 0) far.push_back(vertices_[i].nearer);
    return far;
  }
  /// Boxes tell which are too far away: nearly all. Most vertices need those of their own end alone.
  void compare_to_ends(const LatticeMesh& lattice, const std::vector<int>& asked, float limit) {
    if (asked.empty()) return;
    struct Box {
      Eigen::Array4f least, greatest;
    };
    const auto box_of = [&](const Triangle& t) {
      const Eigen::Array4f a = lattice.point(t[0]), b = lattice.point(t[1]), c = lattice.point(t[2]);
      return Box{a.min(b).min(c), a.max(b).max(c)};
    };
    const int first_end = lattice.first_end_triangle(), all = lattice.triangle_count();
    std::vector<std::optional<Box>> boxes((all - first_end + kEndsInBox - 1) / kEndsInBox);
    const auto box_with = [&](int triangle) -> const Box& {
      const int number = (triangle - first_end) / kEndsInBox, first = first_end + number * kEndsInBox;
      if (!boxes[number]) {
        Box around = box_of(lattice.triangle(first));
        for (int i = first + 1; i < std::min(first + kEndsInBox, all); ++i) {
          const Box box = box_of(lattice.triangle(i));
          around = {around.least.min(box.least), around.greatest.max(box.greatest)};
        }
        boxes[number] = around;
      }
      return *boxes[number];
    };
    const auto margin = static_cast<float>(1e-6 * sources_.model.diagonal);  // more than rounding
    for (const int asked_vertex : asked) {
      MeasuredVertex& measured = vertices_[asked_vertex];
      const PlacedVertex& vertex = placed_.all[asked_vertex];
      const Vec3& point = sources_.charts[vertex.patch].positions[vertex.point - maps_.first_vertex[vertex.patch]];
      Eigen::Array4f place = Eigen::Array4f::Zero();
      place.head<3>() = (point - sources_.model.origin).cast<float>().array();
      double least2 = measured.distance2;
      measured.is_compared = true, measured.nearer = measured.nearest;
      const auto is_too_far = [&](const Box& box) {
        const Eigen::Array4f gap = (box.least - place).max(place - box.greatest).max(margin) - margin;
        return static_cast<double>((gap * gap).sum()) > least2;
      };
      const auto [begin, end] = lattice.triangles_of_end(vertex.patch, vertex.y < 2 ? BoneEnd::kHead : BoneEnd::kTail);
      for (const auto& [first, last] : {std::pair(begin, end), std::pair(first_end, all)}) {
        for (int i = first; i < last; ++i) {
          if (is_too_far(box_with(i))) {
            i += kEndsInBox - 1 - (i - first_end) % kEndsInBox;
            continue;
          }
          const Triangle triangle = lattice.triangle(i);
          if (is_too_far(box_of(triangle))) continue;
          const auto [a, b, c] = lattice.corners(triangle);
          const double distance2 = offset_from_triangle(point, a, b, c).squaredNorm();
          if (distance2 < least2) least2 = distance2, measured.nearer = i;
        }
        if (least2 <= static_cast<double>(limit) * limit) measured.nearer = -1;
        if (measured.nearer < 0) break;
      }
    }
  }
  /// Texels whose vertices can be measured to a triangle that changes with one.
  void add_around(const LatticeMesh& lattice, int texel) {
    const Rectangle& r = lattice.model().patches[lattice.patch_of(texel)].rectangle;
    const int row = texel / layout_.width - r.y, column = texel % layout_.width - r.x;
    for (int i = std::max(1, row - kVertexReach); i <= std::min(r.height - 3, row + kVertexReach); ++i) {
      are_lines_near_[r.y + i] = 1;
      const auto line = are_near_.begin() + (r.y + i) * static_cast<std::ptrdiff_t>(layout_.width) + r.x;
      if (column >= kVertexReach && column + kVertexReach < r.width)
        std::fill_n(line + column - kVertexReach, 2 * kVertexReach + 1, 1);
      else
        for (int j = column - kVertexReach; j <= column + kVertexReach; ++j) line[(j % r.width + r.width) % r.width] = 1;
    }
  }
  /// Those that are more suspicious than that or look against the mesh.
  static std::vector<int> quads_above(const ClMapping<float>& suspicions2, float least) {
    std::vector<int> quads;
    for (int texel = 0; texel < static_cast<int>(suspicions2.size()); ++texel)
      if (suspicions2[texel] > least || std::isinf(suspicions2[texel])) quads.push_back(texel);
    return quads;
  }
  static std::vector<int> triangles_of(const std::vector<int>& quads) {
    std::vector<int> triangles;
    triangles.reserve(2 * quads.size());
    for (const int texel : quads) triangles.push_back(2 * texel), triangles.push_back(2 * texel + 1);
    return triangles;
  }
  template <class Is>
  static std::vector<Measured> those_of(const std::vector<Measured>& measured, const Is& is) {
    std::vector<Measured> those;
    std::copy_if(measured.begin(), measured.end(), std::back_inserter(those), is);
    return those;
  }
  static std::vector<int> numbers_of(const std::vector<Measured>& measured) {
    std::vector<int> numbers;
    for (const Measured& each : measured) numbers.push_back(each.triangle);
    return numbers;
  }
  /// How near walks need not come nearer: from middles, and from other places, where middles are further than worth a look.
  struct Enough {
    float middle, worth_a_look, places;
  };
  /// From nearby, or by the tree where there is no map.
  /// \param asked  in order
  std::vector<Measured> measure_near(const LatticeMesh& lattice, const std::vector<int>& asked, const ClBuffer<int>& texel_triangles, Enough enough) {
    std::vector<Measured> measured;
    if (asked.empty()) return measured;
    std::vector<Triangle> corners;
    corners.reserve(asked.size()), measured.reserve(asked.size());
    for (const int i : asked) corners.push_back(lattice.triangle(i));
    const DevicePlanes &points = lattice.device_points(), &ends = lattice.device_end_points();
    auto device_distances = context_.allocate<float>(asked.size());
    auto device_turned = context_.allocate<int>(asked.size());
    context_.launch({"guard.cl", "measure_triangles"}, over(asked.size()), static_cast<int>(asked.size()), lattice.texel_count(), enough.middle * enough.middle,
                    enough.worth_a_look * enough.worth_a_look, enough.places * enough.places, maps_.triangle_count, context_.upload(corners),
                    texel_triangles, maps_.corners, maps_.across, maps_.x, maps_.y, maps_.z, points.x, points.y, points.z, ends.x, ends.y, ends.z,
                    device_distances, device_turned);
    const auto [distances2, turned] = context_.download(device_distances, device_turned);
    std::vector<Measured> unmapped;
    for (std::size_t k = 0; k < asked.size(); ++k) {
      if (distances2[k] >= 0) measured.push_back({asked[k], std::sqrt(distances2[k]), turned[k] != 0});
      else if (asked[k] >= lattice.first_end_triangle()) unmapped.push_back({asked[k], std::numeric_limits<float>::infinity(), false});
    }
    Queries queries;
    for (const Measured& each : unmapped) queries.add(lattice, each, kPlaces);
    queries.find(search_);
    for (std::size_t k = 0; k < unmapped.size(); ++k) {
      const Queries::Result result = queries.result(k);
      measured.push_back({unmapped[k].triangle, result.furthest, looks_against(lattice, unmapped[k].triangle, result.nearest)});
    }
    return measured;
  }
  bool looks_against(const LatticeMesh& lattice, int triangle, int nearest) const {
    const auto [a, b, c] = lattice.corners(lattice.triangle(triangle));
    return (b - a).cross(c - a).dot(area_vector(sources_.mesh, sources_.mesh.triangles[nearest])) < 0;
  }
  /// Places of triangles of a lattice to be asked of the tree together.
  class Queries {
   public:
    /// \param asked  none of its places is further than its distance, as far as is known
    template <std::size_t kCount>
    void add(const LatticeMesh& lattice, const Measured& asked, const std::array<std::array<double, 2>, kCount>& places) {
      begins_.push_back(points_.size());
      const auto [a, b, c] = lattice.corners(lattice.triangle(asked.triangle));
      for (const auto& [s, t] : places) points_.push_back(a + s * (b - a) + t * (c - a)), bounds_.push_back(asked.distance);
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
      return {*std::max_element(first, distances_.begin() + static_cast<std::ptrdiff_t>(begins_[number + 1])), nearest_[begins_[number]]};
    }

   private:
    std::vector<std::size_t> begins_;
    std::vector<Vec3> points_;
    std::vector<float> bounds_, distances_;
    std::vector<int> nearest_;
  };

  ClContext& context_;
  const GuardSources& sources_;
  const DeviceLayout& layout_;
  const DeviceMaps& maps_;
  ClBuffer<float> texel_normals_;
  NearestSearch search_;
  PlacedVertices placed_;
  std::vector<Measured> faults_;
  std::vector<MeasuredVertex> vertices_;  // as placed_
  std::vector<int> asked_;                // of these
  ClBuffer<float> device_distances_;      // of those asked
  ClBuffer<int> device_nearest_;
  std::vector<int> far_;                  // of these
  std::vector<int> anchors_;              // per texel
  std::vector<char> is_held_;             // vertices of the maps that a texel sits on
  std::vector<char> are_near_, are_lines_near_;  // texels, and lines of the texture that have some
};

/// Each once, in order.
std::vector<int> triangles_in(const std::vector<std::array<int, 2>>& pairs) {
  std::vector<int> triangles;
  for (const auto& pair : pairs) triangles.insert(triangles.end(), pair.begin(), pair.end());
  std::sort(triangles.begin(), triangles.end());
  triangles.erase(std::unique(triangles.begin(), triangles.end()), triangles.end());
  return triangles;
}

/// A set of texels of inner rows.
class TexelSet {
 public:
  explicit TexelSet(const LatticeMesh& lattice) : lattice_(lattice), is_in_(lattice.texel_count(), 0) {}
  void clear() {
    for (const int texel : texels_) is_in_[texel] = 0;
    texels_.clear();
  }
  /// The texels of a triangle and all that are up to `reach` columns or rows from them.
  void add(const Triangle& triangle, int reach) {
    const int width = lattice_.model().texture.width;
    for (const int vertex : triangle) {
      if (!lattice_.is_texel(vertex)) continue;
      const Rectangle& r = lattice_.model().patches[lattice_.patch_of(vertex)].rectangle;
      const int line = vertex / width, row = line - r.y, column = vertex - line * width - r.x;
      for (int i = std::max(1, row - reach); i <= std::min(r.height - 2, row + reach); ++i)
        for (int j = column - reach; j <= column + reach; ++j) {
          const int texel = (r.y + i) * width + r.x + (j < 0 ? j + r.width : j < r.width ? j : j - r.width);
          if (std::exchange(is_in_[texel], 1) == 0) texels_.push_back(texel);
        }
    }
  }
  template <class Is>
  void erase_if(const Is& is) {
    std::erase_if(texels_, [&](int texel) { return is(texel) && std::exchange(is_in_[texel], 0) != 0; });
  }
  /// Whether it has all texels of a triangle.
  bool has(const Triangle& triangle) const {
    return std::all_of(triangle.begin(), triangle.end(), [&](int vertex) { return !lattice_.is_texel(vertex) || is_in_[vertex] != 0; });
  }
  const std::vector<int>& texels() const { return texels_; }

 private:
  const LatticeMesh& lattice_;
  std::vector<char> is_in_;
  std::vector<int> texels_;
};

}  // namespace

struct Guard::Even {
  ClContext& context;
  const GuardSources& sources;
  const DeviceLayout& layout;
  TexelPoints points, filtered;
  ClBuffer<int> triangles;
  // The device goes first: all that the host needs for more comes beside that, and its kernels stand in line with those of other queues.
  ClBuffer<float> texel_normals, suspicions2;
  LatticeMesh lattice;
  LatticeCrossings crossings;
  Distances distances;
  std::vector<int> turned;
  float limit = 0;
  std::future<void> measuring;  // the last two; lattice, distances and the queue are its own so long

  Even(ClContext& own_context, const GuardSources& own_sources, const DeviceLayout& own_layout, const DeviceMaps& maps, ClBuffer<int> own_triangles,
       TexelPoints own_points, TexelPoints stored, std::future<TriangleTree> own_tree, std::future<PlacedVertices> placed)
      : context(own_context),
        sources(own_sources),
        layout(own_layout),
        points(std::move(own_points)),
        filtered(std::move(stored)),
        triangles(std::move(own_triangles)),
        texel_normals(find_texel_normals(context, layout, maps, triangles)),
        suspicions2(suspect(context, "suspect_any_quads", layout, context.upload(quad_rows(sources.model.patches)), filtered, triangles, texel_normals)),
        lattice(context, sources.model, DiagonalRule::kNearest, layout.patches, filtered, LatticeMesh::Parts::kAsked),
        crossings(lattice),
        distances(context, sources, layout, maps, texel_normals,
                  own_tree.valid() ? NearestSearch(context, own_tree.get()) : NearestSearch(context, *sources.tree), placed.get()) {}
};

Guard::Guard(ClContext& context, const GuardSources& sources, const DeviceLayout& layout, const DeviceMaps& maps, ClBuffer<int> even_triangles,
             TexelPoints even, TexelPoints filtered)
    : even_(std::make_unique<Even>(context, sources, layout, maps, std::move(even_triangles), std::move(even), std::move(filtered),
                                   sources.tree ? std::future<TriangleTree>() : std::async(std::launch::async, [&] { return build_triangle_tree(sources.mesh); }),
                                   std::async(std::launch::async, [&] { return place_vertices(sources.charts, sources.model.patches, maps, layout); }))) {
  context.finish();
  even_->measuring = std::async(context.can_run_beside() ? std::launch::async : std::launch::deferred, [even = even_.get()] {
    const ClMapping<float> suspicions2 = even->context.map(std::exchange(even->suspicions2, {}));
    even->limit = kShareOfFurthest * even->distances.measure_even(even->lattice, suspicions2, even->triangles, even->turned);
  });
}

Guard::~Guard() = default;

GuardReport Guard::put_back_faults(ClContext& context, std::span<const int> vertex_points, const ClBuffer<int>& triangles, ReadingPositions& positions,
                                   TexelPoints& points) {
  LatticeMesh& even_lattice = even_->lattice;
  LatticeCrossings& crossings = even_->crossings;
  Distances& distances = even_->distances;
  std::vector<int> anchors = context.download(positions.anchors);
  LatticeMesh lattice(context, even_lattice, even_->sources.model.diagonals, points);
  std::future<void> measuring_parts = std::async(std::launch::async, [&] { crossings.measure(lattice); });
  ClBuffer<float> device_suspicions2 = distances.suspect_quads(context, lattice, triangles);
  distances.list_vertices(vertex_points, std::move(anchors));
  std::optional<ClMapping<float>> suspicions2(context.map(std::exchange(device_suspicions2, {})));
  even_->measuring.get();
  const float limit = even_->limit;
  using Pairs = std::vector<std::array<int, 2>>;
  GuardReport report;
  report.even_turned_triangles = static_cast<int>(even_->turned.size());

  TexelSet marks(lattice);
  // Where the even lattice is at fault itself there is nothing to go back to, as long as it is not much worse.
  TexelSet even_faults(lattice);
  for (const int triangle : even_->turned) even_faults.add(even_lattice.triangle(triangle), kTolerance);
  const auto is_near_even_fault = [&](int triangle) { return even_faults.has(lattice.triangle(triangle)); };
  const auto is_pair_near_even_fault = [&](const std::array<int, 2>& pair) { return is_near_even_fault(pair[0]) && is_near_even_fault(pair[1]); };
  bool tolerates_crossing = false, tolerates_turning = false;
  std::vector<int> back, changed;  // texels and triangles, since the pass before
  std::optional<TexelReturns> returns;  // in memory that measuring has given back
  for (int pass = 0; pass < kPasses; ++pass) {
    marks.clear();
    if (pass > 0) distances.list_vertices(vertex_points, lattice, back);
    distances.start_vertices(context, lattice, limit);
    // Crossings are the host's alone: they are found beside distances, which are for the most part the device's. Where the lattice lies on the original it
    // intersects itself no more than that does.
    std::promise<std::vector<int>> suspects;
    const bool is_worth_a_thread = pass == 0 || changed.size() > kWorthAThread;
    std::future<Pairs> finding =
        std::async(is_worth_a_thread ? std::launch::async : std::launch::deferred, [&, listed = suspects.get_future()]() mutable {
          pass == 0 ? measuring_parts.get() : crossings.measure(lattice, changed);
          return crossings.find(lattice, listed.get());
        });
    if (pass == 0) {
      distances.measure_suspects(lattice, *suspicions2, triangles, limit, std::move(suspects));
      suspicions2.reset();
    } else {
      distances.measure_changed(lattice, changed, triangles, limit, std::move(suspects));
    }
    const std::vector<int> far = distances.take_far_vertices(context, lattice, changed, limit);
    const Pairs pairs = finding.get();
    if (pass == 0 && pairs.size() > kManyPairs) {
      const LatticeCrossings::Others evens = crossings.find_between_same(pairs, even_lattice, kShareOfParts);
      for (const int triangle : triangles_in(evens.pairs)) even_faults.add(even_lattice.triangle(triangle), kTolerance);
      tolerates_crossing = evens.pairs.size() > kManyPairs && static_cast<double>(evens.given_there) <= kMuchWorse * static_cast<double>(evens.counted);
    }
    for (const auto& pair : pairs)
      if (!tolerates_crossing || !is_pair_near_even_fault(pair))
        for (const int triangle : pair) marks.add(lattice.triangle(triangle), 0);

    const auto is_turned = [](const Distances::Measured& fault) { return fault.is_turned; };
    report.turned_triangles = static_cast<int>(std::count_if(distances.faults().begin(), distances.faults().end(), is_turned));
    if (pass == 0) {
      const auto near = std::count_if(distances.faults().begin(), distances.faults().end(),
                                      [&](const Distances::Measured& fault) { return fault.is_turned && is_near_even_fault(fault.triangle); });
      tolerates_turning = static_cast<double>(near) <= kMuchWorse * report.even_turned_triangles;
    }
    for (const Distances::Measured& fault : distances.faults()) {
      if (fault.distance > limit)
        marks.add(lattice.triangle(fault.triangle), kReach);
      else if (!(tolerates_turning && is_near_even_fault(fault.triangle)))
        marks.add(lattice.triangle(fault.triangle), 0);
    }
    for (const int triangle : far) marks.add(lattice.triangle(triangle), kReach);

    // Vertices are given up only when the texels between them have been.
    const bool with_vertices = pass > 0;
    marks.erase_if([&](int texel) { return (lattice.point(texel) == even_lattice.point(texel)).all(); });
    if (marks.texels().empty()) break;
    lattice.release();
    if (!returns) returns.emplace(context, even_->layout);
    back = put_back_listed(context, even_->layout, even_->points, even_->filtered, marks.texels(), with_vertices, *returns, positions, points);
    report.texels_put_back += static_cast<int>(back.size());
    if (back.empty() && with_vertices) break;
    changed = lattice.move(back);
  }
  report.anchors = distances.take_anchors();
  for (const int texel : back) report.anchors[texel] = 0;
  return report;
}

}  // namespace skeletex
