// SPDX-License-Identifier: MIT
#include "skeletex/convert/sample/unfold.h"

#include <algorithm>
#include <vector>

namespace skeletex {
namespace {

constexpr int kRelaxingPasses = 8;

}  // namespace

UnfoldReport unfold_lattice(ClContext& context, const DeviceLayout& layout, std::span<const Patch> patches,
                            const DeviceMaps& maps, const ClBuffer<int>& triangles,
                            const std::function<void(const ClBuffer<int>& texels, int first, int count)>& read,
                            ReadingPositions& positions, DevicePlanes& points) {
  std::vector<int> all;
  for (const Patch& patch : patches) {
    if (is_height_field(patch.method)) continue;
    const Rectangle& r = patch.rectangle;
    for (int row = 0; row + 1 < r.height; ++row)
      for (int j = 0; j < r.width; ++j) all.push_back((r.y + row) * layout.width + r.x + j);
  }
  const auto quad_count = static_cast<int>(all.size()), size = static_cast<int>(layout.size());
  auto lists = context.allocate<int>(4 * layout.size()), counts = context.allocate<int>(FOLD_COUNTS);
  context.fill(lists, 0), context.write(lists, all);  // see FoldLists of unfold.cl
  MapParameters parameters{maps.sizes, layout.width, size, 0, 2 * size, 0, 0};
  // What is counted from here on, but for the quads.
  const auto start_count = [&](int quads) { context.write(counts, std::vector{quads, 0, 0, 0}); };
  const auto find = [&](int most_quads) {
    context.launch({"unfold.cl", "find_folds"}, ClRange(most_quads), parameters, layout.texel_patches,
                   layout.tables.patches, triangles, maps.triangles, maps.values, points.values, counts, lists);
    const std::vector<int> found = context.download(counts);
    parameters.count = found[FOLD_MARKED];
    return found[FOLD_FOUND];
  };
  const auto relax = [&](bool is_back) {
    parameters.is_back = is_back;
    start_count(0);
    context.launch({"unfold.cl", "relax_folds"}, ClRange(parameters.count), parameters, layout.texel_patches,
                   layout.tables.patches, triangles, points.values, positions.home, counts, lists);
    read(lists, parameters.first, parameters.count);
    return is_back ? context.download(counts)[FOLD_RETURNED] : 0;
  };
  // Four quads are at a texel at most.
  const auto find_again = [&] { return find(std::min(quad_count, 4 * parameters.count)); };

  start_count(quad_count);
  UnfoldReport report;
  report.folded_quads = report.left = find(quad_count);
  for (int pass = 0; pass < kRelaxingPasses && report.left > 0; ++pass) {
    relax(false);
    report.left = find_again();
  }
  // A texel that goes back can fold a quad beside it. Texels only ever go back, so this ends.
  while (report.left > 0 && relax(true) > 0) report.left = find_again();
  return report;
}

}  // namespace skeletex
