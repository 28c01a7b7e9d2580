// SPDX-License-Identifier: MIT
#include "skeletex/convert/snap/guard.h"

#include <algorithm>
#include <future>
#include <optional>
#include <utility>

#include "skeletex/convert/snap/lattice_crossings.h"
#include "skeletex/convert/snap/triangle_distances.h"

namespace skeletex {
namespace {

constexpr int kPasses = 7;                // it takes some four
constexpr int kReach = 1;                 // columns and rows around a triangle that is too far that go back with it
constexpr float kShareOfFurthest = 0.9f;  // what is measured is not all that there is
constexpr std::size_t kManyPairs =
    500;  // from here on it is looked at whether the regular grid intersects itself as much
constexpr int kShareOfParts =
    4;  // one in so many pairs of parts that intersect tells whether the regular grid does as much
constexpr int kTolerance = 2;       // columns and rows around a fault of the regular grid
constexpr double kMuchWorse = 1.1;  // the number of faults there, against the regular grid's
constexpr std::size_t kWorthAThread =
    1000;  // triangles that have changed: crossings of fewer are found in less time than a thread takes

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
    return std::all_of(triangle.begin(), triangle.end(),
                       [&](int vertex) { return !lattice_.is_texel(vertex) || is_in_[vertex] != 0; });
  }
  const std::vector<int>& texels() const { return texels_; }

 private:
  const LatticeMesh& lattice_;
  std::vector<char> is_in_;
  std::vector<int> texels_;
};

}  // namespace

GuardFrame frame_guard(const SkeletexModel& model, std::span<const Chart> charts) {
  return {frame_lattice(model), place_vertices(charts, model.patches, model.texture.width, model.texture.height)};
}

struct Guard::Even {
  ClContext& context;
  const GuardSources& sources;
  const DeviceLayout& layout;
  TexelPoints points, filtered;
  ClBuffer<int> triangles;
  // The device goes first: all that the host needs for more comes beside that, and its kernels stand in line with those
  // of other queues.
  ClBuffer<float> texel_normals, suspicions2;
  LatticeMesh lattice;
  LatticeCrossings crossings;
  TriangleDistances distances;
  VertexDistances vertices;
  std::vector<int> turned;
  float limit = 0;
  std::future<void> measuring;  // the last two; lattice, distances and the queue are its own so long

  Even(ClContext& own_context, const GuardSources& own_sources, const DeviceLayout& own_layout, const DeviceMaps& maps,
       ClBuffer<int> own_triangles, TexelPoints own_points, TexelPoints stored, std::future<TriangleTree> own_tree)
      : context(own_context),
        sources(own_sources),
        layout(own_layout),
        points(std::move(own_points)),
        filtered(std::move(stored)),
        triangles(std::move(own_triangles)),
        texel_normals(find_texel_normals(context, layout, maps, triangles)),
        suspicions2(suspect_any_quads(context, layout, context.upload(quad_rows(sources.model.patches)), filtered,
                                      triangles, texel_normals)),
        lattice(context, sources.model, DiagonalRule::kNearest, sources.frame.get().lattice, layout.patches, filtered,
                LatticeMesh::Parts::kAsked),
        crossings(lattice),
        distances(context, sources.mesh, layout, maps, texel_normals,
                  own_tree.valid() ? NearestSearch(context, own_tree.get()) : NearestSearch(context, *sources.tree)),
        vertices(sources.model, sources.charts, layout, maps, sources.frame.get().vertices) {}
};

Guard::Guard(ClContext& context, const GuardSources& sources, const DeviceLayout& layout, const DeviceMaps& maps,
             ClBuffer<int> even_triangles, TexelPoints even, TexelPoints filtered)
    : even_(std::make_unique<Even>(
          context, sources, layout, maps, std::move(even_triangles), std::move(even), std::move(filtered),
          sources.tree ? std::future<TriangleTree>()
                       : std::async(std::launch::async, [&] { return build_triangle_tree(sources.mesh); }))) {
  context.finish();
  even_->measuring =
      std::async(context.can_run_beside() ? std::launch::async : std::launch::deferred, [even = even_.get()] {
        const ClMapping<float> suspicions2 = even->context.map(std::exchange(even->suspicions2, {}));
        even->limit =
            kShareOfFurthest * even->distances.measure_even(even->lattice, suspicions2, even->triangles, even->turned);
      });
}

Guard::~Guard() = default;

GuardReport Guard::put_back_faults(ClContext& context, std::span<const int> vertex_points,
                                   const ClBuffer<int>& triangles, ReadingPositions& positions, TexelPoints& points) {
  LatticeMesh& regular_grid = even_->lattice;
  LatticeCrossings& crossings = even_->crossings;
  TriangleDistances& distances = even_->distances;
  VertexDistances& vertices = even_->vertices;
  std::optional<ClMapping<int>> anchors(context.map(positions.anchors));
  LatticeMesh lattice(context, regular_grid, even_->sources.model.diagonals, points);
  std::future<void> measuring_parts = std::async(std::launch::async, [&] { crossings.measure(lattice); });
  ClBuffer<float> device_suspicions2 = distances.suspect_quads(context, lattice, triangles);
  vertices.list(vertex_points, {anchors->data(), anchors->data() + anchors->size()});
  anchors.reset();
  std::optional<ClMapping<float>> suspicions2(context.map(std::exchange(device_suspicions2, {})));
  even_->measuring.get();
  const float limit = even_->limit;
  using Pairs = std::vector<std::array<int, 2>>;
  GuardReport report;
  report.even_turned_triangles = static_cast<int>(even_->turned.size());

  TexelSet marks(lattice);
  // Where the regular grid is at fault itself there is nothing to go back to, as long as it is not much worse.
  TexelSet even_faults(lattice);
  for (const int triangle : even_->turned) even_faults.add(regular_grid.triangle(triangle), kTolerance);
  const auto is_near_even_fault = [&](int triangle) { return even_faults.has(lattice.triangle(triangle)); };
  const auto is_pair_near_even_fault = [&](const std::array<int, 2>& pair) {
    return is_near_even_fault(pair[0]) && is_near_even_fault(pair[1]);
  };
  bool tolerates_crossing = false, tolerates_turning = false;
  std::vector<int> back, changed;       // texels and triangles, since the pass before
  std::optional<TexelReturns> returns;  // in memory that measuring has given back
  for (int pass = 0; pass < kPasses; ++pass) {
    marks.clear();
    // Crossings are the host's alone: they are found beside distances, which are for the most part the device's. Where
    // the lattice lies on the original it intersects itself no more than that does.
    std::promise<std::vector<int>> suspects;
    const bool is_worth_a_thread = pass == 0 || changed.size() > kWorthAThread;
    std::future<Pairs> finding = std::async(is_worth_a_thread ? std::launch::async : std::launch::deferred,
                                            [&, listed = suspects.get_future()]() mutable {
                                              pass == 0 ? measuring_parts.get() : crossings.measure(lattice, changed);
                                              return crossings.find(lattice, listed.get());
                                            });
    if (pass > 0) vertices.list(vertex_points, lattice, back);
    vertices.start(context, lattice, limit);
    if (pass == 0) {
      distances.measure_suspects(lattice, *suspicions2, triangles, limit, std::move(suspects));
      suspicions2.reset();
    } else {
      distances.measure_changed(lattice, changed, triangles, limit, std::move(suspects));
    }
    const std::vector<int> far = vertices.take_far(context, lattice, changed, limit);
    const Pairs pairs = finding.get();
    if (pass == 0 && pairs.size() > kManyPairs) {
      const LatticeCrossings::Others evens = crossings.find_between_same(pairs, regular_grid, kShareOfParts);
      for (const int triangle : triangles_in(evens.pairs)) even_faults.add(regular_grid.triangle(triangle), kTolerance);
      tolerates_crossing = evens.pairs.size() > kManyPairs &&
                           static_cast<double>(evens.given_there) <= kMuchWorse * static_cast<double>(evens.counted);
    }
    for (const auto& pair : pairs)
      if (!tolerates_crossing || !is_pair_near_even_fault(pair))
        for (const int triangle : pair) marks.add(lattice.triangle(triangle), 0);

    const auto is_turned = [](const TriangleDistances::Measured& fault) { return fault.is_turned; };
    report.turned_triangles =
        static_cast<int>(std::count_if(distances.faults().begin(), distances.faults().end(), is_turned));
    if (pass == 0) {
      const auto near = std::count_if(distances.faults().begin(), distances.faults().end(),
                                      [&](const TriangleDistances::Measured& fault) {
                                        return fault.is_turned && is_near_even_fault(fault.triangle);
                                      });
      tolerates_turning = static_cast<double>(near) <= kMuchWorse * report.even_turned_triangles;
    }
    for (const TriangleDistances::Measured& fault : distances.faults()) {
      if (fault.distance > limit)
        marks.add(lattice.triangle(fault.triangle), kReach);
      else if (!(tolerates_turning && is_near_even_fault(fault.triangle)))
        marks.add(lattice.triangle(fault.triangle), 0);
    }
    for (const int triangle : far) marks.add(lattice.triangle(triangle), kReach);

    // Vertices are given up only when the texels between them have been.
    const bool with_vertices = pass > 0;
    marks.erase_if([&](int texel) { return (lattice.point(texel) == regular_grid.point(texel)).all(); });
    if (marks.texels().empty()) break;
    lattice.release();
    if (!returns) returns.emplace(context, even_->layout);
    TexelsBack gone = put_back_listed(context, even_->layout, even_->points, even_->filtered, marks.texels(),
                                      with_vertices, *returns, positions, points);
    back = std::move(gone.texels);
    report.texels_put_back += static_cast<int>(back.size());
    if (back.empty() && with_vertices) break;
    changed = lattice.move(back, std::move(gone.points));
  }
  report.anchors = vertices.take_anchors();
  for (const int texel : back) report.anchors[texel] = 0;
  return report;
}

}  // namespace skeletex
