// SPDX-License-Identifier: MIT
#include "skeletex/convert/snap/revert_faults.h"

#include <algorithm>
#include <numeric>
#include <utility>

#include "skeletex/convert/snap/lattice_faults.h"
#include "skeletex/convert/snap/snap.h"
#include "skeletex/geometry/self_intersection.h"

namespace skeletex {
namespace {

constexpr int kPasses = 7;                 // it takes some four
constexpr int kAroundFar = 1;              // columns and rows around a triangle that is too far that revert with it
constexpr double kShareOfFurthest = 0.85;  // what is measured is not all that there is
constexpr double kShareOfSuspects = 0.75;  // of the limit: triangles that are nearer intersect as the original does
constexpr std::size_t kManyPairs = 500;    // from here on it counts whether the regular grid intersects as much
constexpr int kTolerance = 2;              // columns and rows around a fault of the regular grid
constexpr double kMuchWorse = 1.1;         // the number of faults there, against the regular grid's

using Pairs = std::vector<std::array<int, 2>>;

/// Each once, in order.
std::vector<int> triangles_in(const Pairs& pairs) {
  std::vector<int> triangles;
  for (const auto& pair : pairs) triangles.insert(triangles.end(), pair.begin(), pair.end());
  std::sort(triangles.begin(), triangles.end());
  triangles.erase(std::unique(triangles.begin(), triangles.end()), triangles.end());
  return triangles;
}

/// A set of texels of inner rows.
class TexelSet {
 public:
  explicit TexelSet(const LatticeFrame& frame) : frame_(frame), is_in_(frame.texel_patches.size(), 0) {}
  /// The texels of a triangle and all that are up to `around` columns or rows from them.
  void add(const Triangle& triangle, int around) {
    const int width = frame_.model.texture.width;
    for (const VertexIndex vertex : triangle) {
      if (!frame_.is_inner(vertex)) continue;
      const int center = frame_.texels[vertex];
      const Rectangle& r = frame_.model.patches[frame_.texel_patches[center]].rectangle;
      const int row = center / width - r.y, column = center % width - r.x;
      for (int i = std::max(1, row - around); i <= std::min(r.height - 2, row + around); ++i)
        for (int j = column - around; j <= column + around; ++j) {
          const TexelIndex texel = (r.y + i) * width + r.x + wrapped(j, r.width);
          if (std::exchange(is_in_[texel], 1) == 0) texels_.push_back(texel);
        }
    }
  }
  /// Whether it has all texels of a triangle.
  bool has(const Triangle& triangle) const {
    return std::all_of(triangle.begin(), triangle.end(), [&](VertexIndex vertex) {
      return !frame_.is_inner(vertex) || is_in_[frame_.texels[vertex]] != 0;
    });
  }
  const std::vector<int>& texels() const { return texels_; }

 private:
  const LatticeFrame& frame_;
  std::vector<char> is_in_;
  std::vector<int> texels_;
};

/// The regular grid, and where it is at fault itself: there is nothing to revert to, as long as it is not much worse.
struct RegularGrid {
  const PlacedTexels& texels;
  RegularGridFaults faults;
  TexelSet near_faults;
  bool tolerates_inversion = false, tolerates_intersection = false;

  bool is_near_fault(const Triangle& triangle) const { return near_faults.has(triangle); }
};

/// \param mesh  out, of the regular grid
RegularGrid prepare_regular_grid(ClContext& context, const LatticeFrame& frame, const OriginalSurface& original,
                                 const PlacedTexels& texels, TriangleMesh& mesh) {
  build_lattice_mesh(context, frame, DiagonalRule::kNearest, texels.on_device, mesh);
  RegularGrid grid{texels, measure_regular_grid({frame, mesh, texels.map_triangles}, original), TexelSet(frame)};
  for (const TriangleIndex triangle : grid.faults.inverted) grid.near_faults.add(mesh.triangles[triangle], kTolerance);
  return grid;
}

/// The lattice as it is in a pass.
struct Pass {
  TriangleMesh mesh;
  TriangleTree tree;
  std::vector<MeasuredTriangle> suspects;    // triangles that are nearly too far, or inverted
  Pairs intersections;                       // of suspects
  std::vector<int> nearest_to_far_vertices;  // triangles

  const Triangle& triangle(int number) const { return mesh.triangles[number]; }
};

std::vector<char> held_vertices(const PlacedTexels& texels, std::span<const int> vertex_points,
                                const OriginalSurface& original) {
  std::vector<char> is_held(original.vertices.empty() ? 0 : original.vertices.back().number + 1, 0);
  for (const int anchor : texels.anchors)
    if (anchor > 0) is_held[vertex_points[anchor - 1]] = 1;
  return is_held;
}

/// Measures triangles of a lattice that are new, or have changed.
/// \param changed  in order
void measure(const LatticeFrame& frame, const OriginalSurface& original, std::span<const int> vertex_points,
             const PlacedTexels& texels, double limit, std::span<const int> changed, Pass& pass) {
  const TriangleMesh& mesh = pass.mesh;
  const LatticeSurface surface{frame, mesh, texels.map_triangles};
  std::erase_if(pass.suspects, [&](const MeasuredTriangle& suspect) {
    return std::binary_search(changed.begin(), changed.end(), suspect.triangle);
  });
  const std::vector<MeasuredTriangle> measured = measure_triangles(surface, original, changed, limit, kShareOfSuspects);
  pass.suspects.insert(pass.suspects.end(), measured.begin(), measured.end());
  std::vector<int> query;
  for (const MeasuredTriangle& suspect : measured) query.push_back(suspect.triangle);
  pass.intersections = find_self_intersections(mesh, pass.tree, query);
  pass.nearest_to_far_vertices =
      nearest_to_far_vertices(surface, original, pass.tree, held_vertices(texels, vertex_points, original), limit);
}

/// The first pass measures all.
/// \param mesh  of the regular grid, whose memory is used again
Pass start_passes(ClContext& context, const LatticeFrame& frame, const OriginalSurface& original,
                  std::span<const int> vertex_points, const PlacedTexels& texels, double limit, TriangleMesh mesh) {
  Pass pass{std::move(mesh), {}, {}, {}, {}};
  build_lattice_mesh(context, frame, frame.model.diagonals, texels.on_device, pass.mesh);
  pass.tree = build_triangle_tree(pass.mesh, frame.triangle_order);
  std::vector<int> all(pass.mesh.triangles.size());
  std::iota(all.begin(), all.end(), 0);
  measure(frame, original, vertex_points, texels, limit, all, pass);
  return pass;
}

/// Further ones measure what has changed.
void next_pass(ClContext& context, const LatticeFrame& frame, const OriginalSurface& original,
               std::span<const int> vertex_points, PlacedTexels& texels, double limit, std::span<const int> reverted,
               Pass& pass) {
  const std::vector<int> changed =
      move_texels(context, frame, frame.model.diagonals, reverted, texels.points, texels.on_device, pass.mesh);
  std::vector<int> places;
  for (const TriangleIndex triangle : changed) places.push_back(frame.triangle_places[triangle]);
  update_triangle_tree(pass.mesh, places, pass.tree);
  measure(frame, original, vertex_points, texels, limit, changed, pass);
}

/// Decides by the first pass which faults near those of the regular grid are left.
void choose_tolerances(ClContext& context, const LatticeFrame& frame, const Pass& pass, RegularGrid& grid) {
  const auto inverted = std::count_if(pass.suspects.begin(), pass.suspects.end(), [&](const MeasuredTriangle& t) {
    return t.is_inverted && grid.is_near_fault(pass.triangle(t.triangle));
  });
  grid.tolerates_inversion =
      static_cast<double>(inverted) <= kMuchWorse * static_cast<double>(grid.faults.inverted.size());
  if (pass.intersections.size() <= kManyPairs) return;
  TriangleMesh mesh;
  build_lattice_mesh(context, frame, DiagonalRule::kNearest, grid.texels.on_device, mesh);
  const Pairs pairs =
      find_self_intersections(mesh, build_triangle_tree(mesh, frame.triangle_order), triangles_in(pass.intersections));
  for (const TriangleIndex triangle : triangles_in(pairs)) grid.near_faults.add(mesh.triangles[triangle], kTolerance);
  const auto near = std::count_if(pass.intersections.begin(), pass.intersections.end(), [&](const auto& pair) {
    return grid.is_near_fault(pass.triangle(pair[0])) && grid.is_near_fault(pass.triangle(pair[1]));
  });
  grid.tolerates_intersection =
      pairs.size() > kManyPairs && static_cast<double>(near) <= kMuchWorse * static_cast<double>(pairs.size());
}

/// Texels at the faults of a pass that are not the regular grid's.
TexelSet texels_at_faults(const LatticeFrame& frame, const Pass& pass, const RegularGrid& grid, double limit) {
  TexelSet texels(frame);
  const auto is_near_fault = [&](TriangleIndex triangle) { return grid.is_near_fault(pass.triangle(triangle)); };
  for (const auto& [first, second] : pass.intersections) {
    if (grid.tolerates_intersection && is_near_fault(first) && is_near_fault(second)) continue;
    texels.add(pass.triangle(first), 0), texels.add(pass.triangle(second), 0);
  }
  for (const MeasuredTriangle& suspect : pass.suspects) {
    const Triangle& triangle = pass.triangle(suspect.triangle);
    if (suspect.distance > limit)
      texels.add(triangle, kAroundFar);
    else if (suspect.is_inverted && !(grid.tolerates_inversion && is_near_fault(suspect.triangle)))
      texels.add(triangle, 0);
  }
  for (const TriangleIndex triangle : pass.nearest_to_far_vertices) texels.add(pass.triangle(triangle), kAroundFar);
  return texels;
}

}  // namespace

RevertReport revert_faults(ClContext& context, const RevertSources& sources, std::span<const int> vertex_points,
                           const PlacedTexels& regular, PlacedTexels& texels) {
  const LatticeFrame frame = frame_lattice(context, sources.model);
  const OriginalSurface original = prepare_original(sources.mesh, sources.tree, sources.charts, frame);
  TriangleMesh mesh;
  RegularGrid grid = prepare_regular_grid(context, frame, original, regular, mesh);
  const double limit = kShareOfFurthest * grid.faults.furthest;
  RevertReport report;
  report.regular_inverted_triangles = static_cast<int>(grid.faults.inverted.size());
  Pass pass = start_passes(context, frame, original, vertex_points, texels, limit, std::move(mesh));
  report.triangles = static_cast<int>(pass.mesh.triangles.size());
  choose_tolerances(context, frame, pass, grid);
  for (int number = 0;; ++number) {
    report.inverted_triangles =
        static_cast<int>(std::count_if(pass.suspects.begin(), pass.suspects.end(),
                                       [](const MeasuredTriangle& suspect) { return suspect.is_inverted; }));
    std::vector<int> listed = texels_at_faults(frame, pass, grid, limit).texels();
    std::erase_if(listed, [&](TexelIndex texel) { return texels.has_same_point(texel, regular); });
    if (listed.empty() || number == kPasses) break;
    // Vertices are given up only when the texels between them have been.
    const bool with_vertices = number > 0;
    const std::vector<int> reverted = revert_texels(frame, listed, with_vertices, regular, texels);
    report.reverted_texels += static_cast<int>(reverted.size());
    if (reverted.empty() && with_vertices) break;
    next_pass(context, frame, original, vertex_points, texels, limit, reverted, pass);
  }
  report.distances =
      vertex_distances(sources.charts, pass.mesh, pass.tree, original.quads, kNearEnough * frame.model.diagonal);
  return report;
}

}  // namespace skeletex
