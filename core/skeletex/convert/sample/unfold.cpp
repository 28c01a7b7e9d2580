// SPDX-License-Identifier: MIT
#include "skeletex/convert/sample/unfold.h"

#include <algorithm>

namespace skeletex {
namespace {

constexpr int kRelaxingPasses = 8;

}  // namespace

UnfoldReport unfold_lattice(ClContext& context, const DeviceLayout& layout, std::span<const Patch> patches,
                            const DeviceMaps& maps, const ClBuffer<int>& triangles,
                            const std::function<void(const ClBuffer<int>& texels, int count)>& read,
                            ReadingPositions& positions, TexelPoints& points) {
  std::vector<int> all;
  for (const Patch& patch : patches) {
    if (is_height_field(patch.method)) continue;
    const Rectangle& r = patch.rectangle;
    for (int row = 0; row + 1 < r.height; ++row)
      for (int j = 0; j < r.width; ++j) all.push_back((r.y + row) * layout.width + r.x + j);
  }
  auto quads = context.upload(all), quad_count = context.upload(std::vector{static_cast<int>(all.size())});
  auto marked = context.allocate<int>(layout.size()), is_marked = context.allocate<int>(layout.size()),
       is_listed = context.allocate<int>(layout.size());
  auto found = context.allocate<int>(2), back_count = context.allocate<int>(1);
  std::size_t most_quads = all.size();
  int marks = 0;
  const auto find = [&] {
    context.fill(found, 0);
    context.launch({"unfold.cl", "find_folds"}, ClRange(most_quads), layout.width, maps.triangle_count,
                   layout.texel_patches, layout.patches, triangles, maps.corners, maps.x, maps.y, maps.z, points.x,
                   points.y, points.z, quad_count, quads, is_listed, found, marked, is_marked);
    const std::vector<int> counts = context.download(found);
    marks = counts[1];
    most_quads = std::min(all.size(), 4 * static_cast<std::size_t>(marks));
    return counts[0];
  };
  const auto relax = [&](bool is_back) {
    context.fill(quad_count, 0), context.fill(back_count, 0);
    context.launch({"unfold.cl", "relax_folds"}, ClRange(marks), layout.width, marks, static_cast<int>(is_back), marked,
                   layout.texel_patches, layout.patches, triangles, points.x, points.y, points.z, is_marked,
                   positions.home_x, positions.home_y, quad_count, quads, is_listed, back_count);
    read(marked, marks);
    return is_back ? context.download(back_count)[0] : 0;
  };

  context.fill(is_listed, 0), context.fill(is_marked, 0);
  UnfoldReport report;
  report.folded_quads = report.left = find();
  for (int pass = 0; pass < kRelaxingPasses && report.left > 0; ++pass) {
    relax(false);
    report.left = find();
  }
  // A texel that goes back can fold a quad beside it. Texels only ever go back, so this ends.
  while (report.left > 0 && relax(true) > 0) report.left = find();
  return report;
}

}  // namespace skeletex
