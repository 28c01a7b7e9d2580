// SPDX-License-Identifier: MIT
#include "skeletex/compact/encode/reduce_intersections.h"

#include <numeric>

#include "skeletex/compact/decode_model.h"
#include "skeletex/geometry/self_intersection.h"
#include "skeletex/reconstruct/reconstruct_mesh.h"
#include "skeletex/reconstruct/texture/corner_coordinates.h"

namespace skeletex {
namespace {

constexpr int kRounds = 4;
constexpr int kLargestSize = 1600;  // larger textures are looked at in a smaller size: their finest levels hardly fold
/// Fixed places are worth their bytes where they leave at most these shares of the intersections of a patch, and of
/// all.
constexpr double kMostLeft = 0.25, kMostLeftOfAll = 0.5;
/// With more pairs than this for each texel, no attempt came to that.
constexpr double kMostOfTexels = 0.004;

/// Pairs of triangles of a patch that intersect each other, or others, and where they lie in it.
struct Intersections {
  int pairs = 0;
  std::vector<Place> places;  ///< shares of the rows and columns
};

std::vector<Intersections> intersections_by_patch(ClContext& context, const CompactModel& compact) {
  int octaves = 0;
  while (octaves > -8 && decoded_size(compact, octaves) > kLargestSize) --octaves;
  const SkeletexModel model = decode_model(compact, octaves);
  const PreparedModel prepared(model);
  const TriangleMesh mesh = reconstruct_bind_mesh(context, prepared).mesh;
  const std::vector<int> bones = triangle_bones(prepared.lattice, mesh.triangles);
  const std::vector<std::array<double, 2>> coordinates = corner_coordinates(prepared, mesh);
  std::vector<Intersections> result(compact.patches.size());
  for (const auto& [first, second] : find_self_intersections(mesh)) {
    ++result[bones[first]].pairs;
    if (bones[second] != bones[first]) ++result[bones[second]].pairs;
    for (const TriangleIndex triangle : {first, second}) {
      const auto& [row, column] = coordinates[3 * static_cast<std::size_t>(triangle)];
      result[bones[triangle]].places.emplace_back(row, column);
    }
  }
  return result;
}

int count_of(const std::vector<Intersections>& patches) {
  return std::accumulate(patches.begin(), patches.end(), 0,
                         [](int sum, const Intersections& patch) { return sum + patch.pairs; });
}

}  // namespace

void reduce_intersections(ClContext& context, const SkeletexModel& model, const SourceSurface& source,
                          CompactOptions& options, CompactModel& compact) {
  const std::vector<Intersections> first = intersections_by_patch(context, compact);
  if (count_of(first) == 0 || count_of(first) > kMostOfTexels * options.size * options.size) return;
  CompactOptions trial = options;
  trial.weights = compact.weights;
  trial.fixed_places.assign(first.size(), {});
  std::vector<std::vector<Place>> best = trial.fixed_places;
  std::vector<Intersections> last = first;
  std::vector<int> left;
  for (const Intersections& patch : first) left.push_back(patch.pairs);
  for (int round = 0; round < kRounds && count_of(last) > 0; ++round) {
    for (std::size_t i = 0; i < last.size(); ++i)
      trial.fixed_places[i].insert(trial.fixed_places[i].end(), last[i].places.begin(), last[i].places.end());
    last = intersections_by_patch(context, encode_compact(model, source, trial));
    for (std::size_t i = 0; i < last.size(); ++i) {
      if (last[i].pairs >= left[i] || last[i].pairs > kMostLeft * first[i].pairs) continue;
      left[i] = last[i].pairs;
      best[i] = trial.fixed_places[i];
    }
  }
  if (std::accumulate(left.begin(), left.end(), 0) > kMostLeftOfAll * count_of(first)) return;
  trial.fixed_places = best;
  compact = encode_compact(model, source, trial);
  options = trial;
}

}  // namespace skeletex
